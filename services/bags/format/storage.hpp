#pragma once
/// \file
/// One file of a bag: what MCAP and sqlite3 do each in their way. Inside this room only.

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/bag_reader.hpp"
#include "services/bags/format/bag_writer.hpp"
#include "services/bags/format/findings.hpp"
#include "services/bags/format/message.hpp"

namespace jostle::bags {

using Notes = std::map<std::string, Note>;

/// Which messages have been written to a file.
struct WrittenFile {
  std::vector<std::uint64_t> messages;  ///< by topic
  Time start = 0, end = 0;              ///< log times
};

/// A file that is being written. Topics count from 0 in the order they were added.
///
/// Failure  as BagWriter promises: after a failed write the file ends where it was whole,
///          every further write() returns that error, close() completes what fits.
class FileWriter {
 public:
  virtual ~FileWriter() = default;

  virtual Result<void> add_topic(const Topic& topic) = 0;
  virtual Result<void> write(int topic, const MessageView& message) = 0;
  /// `notes`: those that have changed since they were last written to this file.
  virtual Result<void> flush(const Notes& notes) = 0;

  /// Writes what only some kinds of files have room for. Error kInvalidArgument: this kind has none.
  virtual Result<void> attach(const Attachment& attachment) = 0;
  /// Writes a note that stays beside others of its name.
  virtual Result<void> add_note(const NamedNote& note) = 0;

  /// Marks everything written so far as a repetition of what earlier files hold. Called before
  /// anything else is written.
  virtual Result<void> end_repeated() = 0;
  virtual Result<void> close(const Notes& notes) = 0;  ///< as flush(), and what ends a file

  virtual std::uint64_t bytes() const = 0;  ///< written or about to be
  virtual WrittenFile written() const = 0;  ///< handed to the operating system
};

struct FileInfo {
  std::vector<TopicInfo> topics;
  Time start = 0, end = 0;  ///< log times of the first and the last message
  std::uint64_t messages = 0;
  std::uint64_t repeated = 0;  ///< messages that earlier files have, which are left out
  Notes notes;
  std::vector<NamedNote> earlier_notes;  ///< under names that a later one has, too
  std::vector<AttachmentInfo> attachments;
  Findings findings;  ///< grows while the file is read
};

struct OpenOptions {
  bool skip_repeated = false;  ///< leave out what repeats earlier files
  /// Take what is readable; FileInfo::findings say what is not. next() steps over damage, too.
  bool recover = false;
  std::stop_token stop;  ///< ends a long look at a whole file with kCancelled
};

/// A file that is being read; messages have the file's own topic indices.
class FileReader {
 public:
  virtual ~FileReader() = default;

  virtual const FileInfo& info() const = 0;
  /// `wanted`: by topic index.
  virtual void seek(Time from, std::vector<bool> wanted) = 0;
  virtual Result<std::optional<Message>> next() = 0;
  virtual Result<std::optional<Message>> last_at(int topic, Time time) = 0;
  /// `index`: into FileInfo::attachments. Error as next().
  virtual Result<Attachment> attachment(std::size_t index) const = 0;

  /// Reads the whole file for what next() does not look at: checksums and counts of the
  /// file itself, and whether it holds what it says. Error as next().
  virtual Result<std::vector<Finding>> verify() = 0;
};

/// How a kind of file is written and opened.
struct Storage {
  const char* name;       ///< as metadata.yaml has it
  const char* extension;  ///< with its dot
  Result<std::unique_ptr<FileWriter>> (*create)(const std::filesystem::path& file, const BagOptions& options);
  Result<std::unique_ptr<FileReader>> (*open)(const std::filesystem::path& file, const OpenOptions& options);
};

const Storage& mcap_storage();
const Storage& sqlite_storage();
const Storage& storage_of(BagOptions::Storage storage);
/// Returns the storage that a file's ending says; null for other endings.
const Storage* storage_of(const std::filesystem::path& file);

}  // namespace jostle::bags
