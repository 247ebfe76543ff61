#pragma once
/// \file
/// MCAP as a kind of bag file.

#include <filesystem>
#include <memory>

#include "services/bags/format/storage.hpp"

namespace jostle::bags {

// What rosbag2 wants in its MCAP files.
inline constexpr const char* kMessageEncoding = "cdr";
inline constexpr const char* kSchemaEncoding = "ros2msg";
inline constexpr const char* kQosKey = "offered_qos_profiles";

/// What the header of our own files says wrote them begins with this.
inline constexpr const char* kOurLibrary = "jostle ";

/// A Metadata record of this name stands in front of a chunk that repeats earlier files.
inline constexpr const char* kRepeatedNote = "jostle.repeated";

Result<std::unique_ptr<FileWriter>> create_mcap(const std::filesystem::path& file, const BagOptions& options);
Result<std::unique_ptr<FileReader>> open_mcap(const std::filesystem::path& file, const OpenOptions& options);

}  // namespace jostle::bags
