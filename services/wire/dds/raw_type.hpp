#pragma once
/// \file
/// Types of which only the name is known. For the .cpp files of this room.

#include <cstddef>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <span>
#include <string>
#include <vector>

namespace jostle::wire {

inline constexpr std::size_t kEncapsulation = 4;  ///< bytes, RTPS 2.2, 10.5

/// A sample as it is on the wire, its encapsulation included.
struct RawSample {
  std::span<const std::byte> bytes;
  std::vector<std::byte> own;  ///< what bytes shows, after reading
};

/// Returns the code that takes samples of a type for what they are, RawSample. A participant uses a type either so or
/// as what it is.
eprosima::fastdds::dds::TypeSupport raw_type(const std::string& name);

}  // namespace jostle::wire
