#pragma once
/// \file
/// Guid: the name of a writer or reader, unique in all domains.

#include <array>
#include <cstdint>

namespace jostle::wire {

/// A Guid is as on the wire; its first 12 bytes are those of its participant.
using Guid = std::array<std::uint8_t, 16>;

}  // namespace jostle::wire
