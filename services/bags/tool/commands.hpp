#pragma once
/// \file
/// What `jostle bag` does. Every command prints what it has to say and returns an exit code.

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::bags {

struct InfoArguments {
  std::filesystem::path bag;
  bool as_json = false;
};
/// Shows what a bag holds, without reading its messages.
int show_info(const InfoArguments& arguments);

/// Reads everything, and compares what was met with what was taken and with what the bag says of itself. kExitFailed
/// if anything is not as it should be.
int verify_bag(const std::filesystem::path& bag, std::stop_token stop);

struct RecoverArguments {
  std::filesystem::path bag;
  std::filesystem::path output;  ///< a folder that is not there yet; empty: the bag's name and "-recovered"
};
/// Writes what is readable as a new bag, attachments and all notes included, and says what of each kind was lost.
/// kExitFailed if anything was. Leaves nothing behind when it is interrupted, cannot write, or nothing is readable.
int recover_bag(const RecoverArguments& arguments, std::stop_token stop);

struct ExportArguments {
  std::filesystem::path bag;
  bool as_csv = false;                ///< else JSON, an object per line
  std::vector<std::string> topics;    ///< patterns of the shell; all if empty
  std::vector<std::string> messages;  ///< folders with definitions that the bag does not bring
  std::optional<double> from, to;     ///< s since the bag's start
  std::string output;                 ///< CSV: a folder; JSON: a file; "-": standard output
};
/// Writes decoded messages. kExitFailed if some could not be decoded; the others are written. Leaves nothing behind
/// when it is interrupted or cannot write.
int export_bag(const ExportArguments& arguments, std::stop_token stop);

/// Prints "jostle bag: …" on standard error.
void tell(const std::string& text);

/// Does the same with an error and returns the exit code: kExitInterrupted after kCancelled,
/// kExitUsage for what the user named wrongly, else `otherwise`.
int fail(const Error& error, int otherwise);

}  // namespace jostle::bags
