#pragma once
/// \file
/// BagReader: messages of a bag in the order of their log times.

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/bag_writer.hpp"
#include "services/bags/format/findings.hpp"
#include "services/bags/format/message.hpp"

namespace jostle::bags {

struct TopicInfo {
  Topic topic;
  std::uint64_t messages = 0;
};

struct AttachmentInfo {
  std::string name, media_type;
  std::uint64_t bytes = 0;
};

struct BagInfo {
  std::filesystem::path path;  ///< as opened
  std::string storage;         ///< "mcap" or "sqlite3"
  std::vector<std::filesystem::path> files;
  std::uint64_t bytes = 0;  ///< size of the files
  Time start = 0, end = 0;  ///< log times of the first and the last message
  std::uint64_t messages = 0;
  std::vector<TopicInfo> topics;  ///< in the order of their names; those of one name differ in type or definition
  std::map<std::string, Note> notes;
  std::vector<NamedNote> earlier_notes;  ///< other notes under names that `notes` has
  std::vector<AttachmentInfo> attachments;
};

/// Reads what BagWriter or rosbag2 wrote. Messages, topics and times are judged one by one: one that cannot be given
/// out is counted among findings(), and the rest comes. What a checksum or an index covers is believed whole or not at
/// all: there reading ends with an error, whose remedy steps over it.
///
/// Threads  one.
class BagReader {
 public:
  /// Opens a bag by its folder, or by one of its files.
  /// Errors   kNotFound         nothing there
  ///          kInvalidArgument  no bag, of a newer version, damaged or cut off; says where
  ///                            (file and byte) and the remedy (`jostle bag recover`)
  static Result<std::unique_ptr<BagReader>> open(const std::filesystem::path& path);
  virtual ~BagReader() = default;

  virtual const BagInfo& info() const = 0;

  /// Returns the index of a topic by name, or nothing.
  std::optional<int> find_topic(const std::string& name) const;

  /// Lets next() go on with the first message at or after `from`, of these topics; all if empty.
  virtual void seek(Time from, std::vector<int> topics = {}) = 0;

  /// Returns the next message; nothing at the end. Messages of equal time come in the order they were written.
  /// Errors   kInvalidArgument, kIo: damaged here; says file and byte
  virtual Result<std::optional<Message>> next() = 0;

  /// Returns what was found so far that is not as it should be: parts that are not given out, each with the reason,
  /// and parts that are all the same. Reading may find more.
  virtual std::vector<Finding> findings() const = 0;

  /// Returns the newest message of a topic at or before `time`, if there is one. Does not move next().
  virtual Result<std::optional<Message>> last_at(int topic, Time time) = 0;
};

}  // namespace jostle::bags
