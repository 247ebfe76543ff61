#pragma once
/// \file
/// Journal: finished parts of long work, kept at once.

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::common {

/// A Journal is a file of JSON lines. The first says where the others come from; each of the others holds one finished
/// part of some work, and is on the disk when append() returns. So whatever ends the work costs the parts under way,
/// and the next one goes on where it stopped. One process at a time writes to a journal.
///
/// Threads  append() is safe from any.
class Journal {
 public:
  /// Opens a journal, or begins one. `origin`: everything the parts depend on. A line that was not finished is cut off.
  /// Errors   kInvalidArgument  the file has parts of another origin, or is no journal; says the first difference
  ///          kUnavailable      another process writes to it
  ///          kIo               it cannot be read or written
  static Result<std::unique_ptr<Journal>> open(const std::filesystem::path& file, const nlohmann::json& origin);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  const std::filesystem::path& file() const { return file_; }

  /// Parts that were there when it was opened, by key.
  const std::map<std::string, nlohmann::json>& found() const { return found_; }

  /// Adds a finished part. Error kIo naming the file.
  Result<void> append(const std::string& key, const nlohmann::json& part);

  /// Removes the file: all is done, and kept elsewhere.
  void remove();

 private:
  Journal(std::filesystem::path file, int descriptor) : file_(std::move(file)), descriptor_(descriptor) {}
  Result<void> read(const nlohmann::json& origin);
  Result<void> write(const nlohmann::json& line);

  const std::filesystem::path file_;
  const int descriptor_;
  std::map<std::string, nlohmann::json> found_;
  std::mutex mutex_;  // one line after the other
};

/// Returns where two values first differ, such as `settings.timeout: got 1000, wanted 2000`; empty if they are equal.
std::string first_difference(const nlohmann::json& got, const nlohmann::json& wanted, const std::string& where = "");

}  // namespace jostle::common
