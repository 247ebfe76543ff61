#pragma once
/// \file
/// An independent count of what is in a bag's file, to hold against what the readers of services/bags say.

#include <cstdint>
#include <filesystem>
#include <string>

namespace jostle::fuzz {

struct Met {
  std::uint64_t messages = 0;
  /// Whether the whole file could be walked, so that the count is exact; else it is what stands before the place
  /// where walking ended.
  bool is_exact = true;
};

/// Walks an MCAP file from its first record on: no index, no definitions, no checksums. A message is a record of its
/// kind, whatever is in it. For a chunk that cannot be decompressed its message indexes count.
Met walk_mcap(const std::string& bytes);

/// Counts the rows of a database that sqlite calls sound.
Met count_database(const std::filesystem::path& file);

}  // namespace jostle::fuzz
