#pragma once
/// \file
/// MessageFiles: definitions of message types that users have as .msg files.

#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::bags {

/// Finds definitions of message types, in this order:
///
///   folders of the user's   FOLDER/pkg/msg/Name.msg, FOLDER/share/pkg/msg/Name.msg, or, where FOLDER is the package
///                           pkg itself, FOLDER/msg/Name.msg
///   those of every program  definition_of()
///   AMENT_PREFIX_PATH       the same files below each of its folders
///
/// Files are read when they are asked for, at most files::kMostText bytes each.
///
/// Threads  safe from any thread.
class MessageFiles {
 public:
  /// `folders`: of the user's. AMENT_PREFIX_PATH is read here.
  explicit MessageFiles(std::vector<std::filesystem::path> folders = {});

  /// Returns the definition of a type ("pkg/msg/Name") as definition_of() does: its file, and those of the types that
  /// it is made of. Errors   kNotFound         no such type, or one that it is made of; says where it was looked for
  ///          kInvalidArgument  a file that is malformed, or definitions that contain one another without end
  Result<std::string> definition(const std::string& type) const;

 private:
  Result<std::string> text_of(const std::string& package, const std::string& name) const;
  Result<void> collect(const std::string& package, const std::string& text, std::vector<std::string>& parts,
                       std::string& definition) const;

  std::vector<std::filesystem::path> own_, installed_;
};

/// Makes one of what a user gave as --messages. Error kNotFound: a folder that is not there.
Result<MessageFiles> message_files(const std::vector<std::string>& folders);

}  // namespace jostle::bags
