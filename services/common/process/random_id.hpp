#pragma once
/// \file
/// Ids that nobody has to give out.

#include <cstdint>
#include <random>

namespace jostle::common {

/// Returns an id that no other process picks, and none of this one again; never 0.
inline std::uint64_t random_id() {
  std::random_device device;
  std::uint64_t id = 0;
  while (id == 0) id = (static_cast<std::uint64_t>(device()) << 32) | device();
  return id;
}

}  // namespace jostle::common
