#pragma once
/// \file
/// rosbag2's databases as a kind of bag file.
///
/// Source  rosbag2's sqlite_storage.cpp. Version 2 has tables topics and messages, 3 (Humble)
///         adds schema and metadata, 4 (Iron) definitions and type hashes.

#include <filesystem>
#include <memory>

#include "services/bags/format/storage.hpp"

namespace jostle::bags {

/// Notes have a table of their own, which rosbag2 does not look at: it takes every row of its
/// table `metadata` for a bag's whole metadata.yaml, and fails on any other text.
inline constexpr const char* kNotesTable = "jostle_notes";
/// The row of that table which says how many of the first messages repeat earlier files.
inline constexpr const char* kRepeatedRow = "jostle.repeated";

Result<std::unique_ptr<FileWriter>> create_sqlite(const std::filesystem::path& file, const BagOptions& options);
Result<std::unique_ptr<FileReader>> open_sqlite(const std::filesystem::path& file, const OpenOptions& options);

}  // namespace jostle::bags
