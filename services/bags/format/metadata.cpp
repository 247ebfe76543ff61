#include "services/bags/format/metadata.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <limits>

#include "services/bags/format/qos_text.hpp"
#include "services/common/process/files.hpp"

namespace jostle::bags {
namespace {

constexpr int kVersion = 5;
constexpr const char* kRoot = "rosbag2_bagfile_information";
constexpr const char* kNotes = "jostle_notes";
// What rosbag2 writes where nothing was recorded.
constexpr Time kNoTime = std::numeric_limits<Time>::max();

void add_times(YAML::Emitter& out, Time start, Time duration) {
  out << YAML::Key << "starting_time" << YAML::Value << YAML::BeginMap << YAML::Key << "nanoseconds_since_epoch"
      << YAML::Value << start << YAML::EndMap;
  out << YAML::Key << "duration" << YAML::Value << YAML::BeginMap << YAML::Key << "nanoseconds" << YAML::Value
      << duration << YAML::EndMap;
}

}  // namespace

std::string metadata_text(const BagMetadata& metadata) {
  std::uint64_t messages = 0;
  Time start = kNoTime, end = std::numeric_limits<Time>::min();
  for (const MetadataEntry& file : metadata.files) {
    if (file.messages == 0) continue;
    messages += file.messages;
    start = std::min(start, file.start);
    end = std::max(end, file.end);
  }
  YAML::Emitter out;
  out << YAML::BeginMap << YAML::Key << kRoot << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "version" << YAML::Value << kVersion;
  out << YAML::Key << "storage_identifier" << YAML::Value << metadata.storage;
  add_times(out, start, messages == 0 ? 0 : end - start);
  out << YAML::Key << "message_count" << YAML::Value << messages;
  out << YAML::Key << "topics_with_message_count" << YAML::Value << YAML::BeginSeq;
  for (const TopicInfo& topic : metadata.topics) {
    out << YAML::BeginMap << YAML::Key << "topic_metadata" << YAML::Value << YAML::BeginMap;
    out << YAML::Key << "name" << YAML::Value << topic.topic.name;
    out << YAML::Key << "type" << YAML::Value << topic.topic.type;
    out << YAML::Key << "serialization_format" << YAML::Value << topic.topic.encoding;
    out << YAML::Key << "offered_qos_profiles" << YAML::Value << YAML::DoubleQuoted << qos_text(topic.topic.qos);
    out << YAML::EndMap << YAML::Key << "message_count" << YAML::Value << topic.messages << YAML::EndMap;
  }
  out << YAML::EndSeq;
  out << YAML::Key << "compression_format" << YAML::Value << YAML::DoubleQuoted << "";
  out << YAML::Key << "compression_mode" << YAML::Value << YAML::DoubleQuoted << "";
  out << YAML::Key << "relative_file_paths" << YAML::Value << YAML::BeginSeq;
  for (const MetadataEntry& file : metadata.files) out << file.path;
  out << YAML::EndSeq;
  out << YAML::Key << "files" << YAML::Value << YAML::BeginSeq;
  for (const MetadataEntry& file : metadata.files) {
    out << YAML::BeginMap << YAML::Key << "path" << YAML::Value << file.path;
    add_times(out, file.messages == 0 ? kNoTime : file.start, file.messages == 0 ? 0 : file.end - file.start);
    out << YAML::Key << "message_count" << YAML::Value << file.messages << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  if (!metadata.notes.empty()) {
    out << YAML::Key << kNotes << YAML::Value << YAML::BeginMap;
    for (const auto& [name, note] : metadata.notes) {
      out << YAML::Key << name << YAML::Value << YAML::BeginMap;
      for (const auto& [key, value] : note) {
        out << YAML::Key << YAML::DoubleQuoted << key << YAML::Value << YAML::DoubleQuoted << value;
      }
      out << YAML::EndMap;
    }
    out << YAML::EndMap;
  }
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

namespace {

// Where a file lies that metadata.yaml names. Early versions wrote the bag's folder in front; and what is not in the
// folder is not this bag's.
std::optional<std::filesystem::path> file_in(const std::filesystem::path& folder,
                                             const std::filesystem::path& relative) {
  const std::filesystem::path whole = relative.lexically_normal();
  const bool is_inside = whole.is_relative() && (whole.empty() || *whole.begin() != "..");
  std::error_code ignored;
  if (is_inside && std::filesystem::exists(folder / whole, ignored)) return folder / whole;
  if (std::filesystem::exists(folder / whole.filename(), ignored)) return folder / whole.filename();
  if (is_inside) return folder / whole;  // opening it says that it is missing
  return {};
}

Result<ReadMetadata> parse_metadata(const std::filesystem::path& folder, const std::filesystem::path& file,
                                    const std::string& text) {
  const auto wrong = [&](const std::string& what) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: {}; remedy: jostle bag recover reads the files themselves", file.string(), what)};
  };
  try {
    const YAML::Node root = YAML::Load(text)[kRoot];
    if (!root.IsMap()) return wrong(fmt::format("got no {}, wanted rosbag2's", kRoot));
    if (const auto compression = root["compression_format"].as<std::string>(""); !compression.empty()) {
      return Error{
          Code::kInvalidArgument,
          fmt::format(
              "{}: got a bag that rosbag2 compressed ({}, {} mode), wanted plain files; remedy: ros2 bag convert",
              file.string(), compression, root["compression_mode"].as<std::string>("?"))};
    }
    ReadMetadata metadata{.storage = root["storage_identifier"].as<std::string>("")};
    if (const YAML::Node count = root["message_count"]) metadata.messages = count.as<std::uint64_t>();
    for (const YAML::Node& path : root["relative_file_paths"]) {
      const auto relative = path.as<std::string>();
      auto found = file_in(folder, relative);
      if (!found) return wrong(fmt::format("relative_file_paths: got {}, wanted a file in the folder", relative));
      metadata.files.push_back(std::move(*found));
    }
    if (metadata.files.empty()) return wrong("relative_file_paths: got none, wanted the files of the bag");
    return metadata;
  } catch (const YAML::Exception& problem) {
    return wrong(fmt::format("line {}: {}", problem.mark.line + 1, problem.msg));
  }
}

}  // namespace

Result<ReadMetadata> read_metadata(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / kMetadataFile;
  std::error_code problem;
  const auto size = std::filesystem::file_size(file, problem);
  if (problem == std::errc::no_such_file_or_directory) {
    return Error{Code::kNotFound, fmt::format("{}: not there", file.string())};
  }
  if (!problem && size == 0) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("{}: the file is empty, wanted rosbag2's; remedy: jostle bag recover reads the files themselves",
                    file.string())};
  }
  auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  return parse_metadata(folder, file, *text_result);
}

}  // namespace jostle::bags
