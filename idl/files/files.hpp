#pragma once
/// \file
/// Files, read and written in one safe way by every room. `-` is standard input where a file is read and standard
/// output where one is written; a file of that name is ./-.

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::files {

/// Bytes of a text that people write, such as a scene or parameters, at most.
inline constexpr std::size_t kMostText = std::size_t{1} << 20;
/// Bytes of any other file that is held in memory whole, at most.
inline constexpr std::size_t kMostBytes = std::size_t{256} << 20;

/// Whether a path stands for standard input, or standard output.
bool is_standard(const std::filesystem::path& file);

/// Reads all of a file, pipe or device. One of no bytes is an empty text.
/// Errors   kNotFound         it is missing, or cannot be read; says which
///          kInvalidArgument  it is a folder, or has more than `most` bytes
Result<std::string> read(const std::filesystem::path& file, std::size_t most = kMostBytes);

/// Writes all of a file:
///
///   a regular file, or none yet   replaced in one step once the new one is on the disk, so that a reader never sees
///                                 half of it; permissions and owner stay. Where the folder cannot be written to or
///                                 the file is a mount of its own, it is written in place
///   a symbolic link               stays, and what it leads to is written
///   a pipe, a device              is written to, never replaced; for a pipe's reader it waits up to 10 s
///
/// Folders are not made.
/// Error kIo naming the file and the reason; what was there before is there still, unless it was written in place.
Result<void> write(const std::filesystem::path& file, std::string_view bytes);

/// Something that a program was asked to write.
struct Output {
  std::string option;                ///< as users know it, such as "--json"
  std::filesystem::path path;        ///< empty: it was not asked for
  std::vector<std::string> endings;  ///< of its name, such as {".png"}; empty: any
  bool is_folder = false;            ///< a folder for files: new, or there and empty, so that all in it are ours
};

/// Checks before any work that all outputs can be written when it is done. Nothing is left behind.
/// Error with one line for each that cannot: kInvalidArgument if a name is at fault (its ending, the same file twice, a
/// folder in which there is something), else kIo.
Result<void> check_outputs(std::span<const Output> outputs);
Result<void> check_output(const Output& output);

}  // namespace jostle::files
