#pragma once
/// \file
/// metadata.yaml: what rosbag2 reads before it opens a file of a bag.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/storage.hpp"

namespace jostle::bags {

inline constexpr const char* kMetadataFile = "metadata.yaml";

/// One file of a bag; counts as a plain reader of the file has them, repeated samples included.
struct MetadataEntry {
  std::string path;  ///< relative to the folder
  Time start = 0, end = 0;
  std::uint64_t messages = 0;
};

struct BagMetadata {
  std::string storage;
  std::vector<TopicInfo> topics;
  std::vector<MetadataEntry> files;
  Notes notes;
};

/// Writes version 5, Humble's. Notes stand under a root key of their own: `custom_data` came with
/// version 6, and rosbag2 looks at its own root key only.
std::string metadata_text(const BagMetadata& metadata);

/// What a reader needs of metadata.yaml.
struct ReadMetadata {
  std::string storage;  ///< may be empty
  std::vector<std::filesystem::path> files;
  std::optional<std::uint64_t> messages;  ///< in all files, as a plain reader of each counts
};

/// Errors   kNotFound         no such file
///          kInvalidArgument  malformed, a file outside of the folder, or files compressed as a whole; says the remedy
Result<ReadMetadata> read_metadata(const std::filesystem::path& folder);

}  // namespace jostle::bags
