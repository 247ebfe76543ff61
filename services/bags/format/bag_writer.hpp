#pragma once
/// \file
/// BagWriter: a folder of files, and metadata.yaml beside them, as rosbag2 lays them out.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "idl/types/result.hpp"
#include "services/bags/format/message.hpp"

namespace jostle::bags {

/// A Note is text by name: what a bag says of itself beyond its messages.
using Note = std::map<std::string, std::string>;
using NamedNote = std::pair<std::string, Note>;

/// The note that counts lost samples by topic. It is written over and over, and of several the last one counts.
inline constexpr const char* kLostNote = "lost";

struct BagOptions {
  enum class Storage {
    kMcap,    ///< profile ros2, indexed, zstd chunks
    kSqlite,  ///< rosbag2's .db3, for tools that read nothing else
  };
  Storage storage = Storage::kMcap;
  bool compress = true;                    ///< MCAP only: a third of the size, for some processor time
  std::uint64_t split_bytes = 0;           ///< a new file once one is this large; 0: never
  std::chrono::nanoseconds split_time{0};  ///< a new file after so much log time; 0: never
};

/// Writes FOLDER/NAME_0.mcap (or .db3), NAME_1 …, and metadata.yaml when closed; NAME is
/// the folder's. Every file stands for itself: it begins with the last sample of every
/// latched topic before it, which BagReader does not give out twice.
///
/// Threads  one.
/// Failure  kIo with file and reason. After a failed write (a full disk) the file ends at
///          its last whole chunk; close() still completes index and metadata if they fit.
///          A writer that dies leaves everything up to the last flush() readable.
class BagWriter {
 public:
  /// Makes the folder. Error kInvalidArgument if it exists and is not empty; kIo.
  static Result<std::unique_ptr<BagWriter>> create(const std::filesystem::path& folder, const BagOptions& options);
  virtual ~BagWriter() = default;  ///< closes what was not closed

  /// Returns the topic's index for write(). Topics may be added at any time before close().
  virtual Result<int> add_topic(const Topic& topic) = 0;

  /// Writes a message. Messages come roughly in the order of their log times.
  virtual Result<void> write(int topic, const MessageView& message) = 0;

  /// Hands everything written so far to the operating system: it survives this process.
  virtual Result<void> flush() = 0;

  /// Sets a note, which the next flush() or close() stores under `name`, as do all files that follow.
  virtual void set_note(const std::string& name, Note note) = 0;

  /// Writes a file within the bag, or a note that stays beside others of its name.
  /// Error kInvalidArgument: databases have no room for it.
  virtual Result<void> attach(const Attachment& attachment) = 0;
  virtual Result<void> add_note(const NamedNote& note) = 0;

  /// Writes index, statistics, notes and metadata.yaml.
  virtual Result<void> close() = 0;

  virtual std::uint64_t bytes() const = 0;  ///< size of all files, so far
  virtual int files() const = 0;
};

}  // namespace jostle::bags
