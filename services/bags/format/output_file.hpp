#pragma once
/// \file
/// A file that only grows, by whole pieces.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>

#include "idl/types/result.hpp"

namespace jostle::bags {

/// Threads  one.
class OutputFile {
 public:
  /// Error kIo if it exists or cannot be made.
  static Result<OutputFile> create(const std::filesystem::path& path);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile();

  /// Appends all pieces or none, in one system call unless a signal or a full disk is in the way.
  /// `room`: bytes that must still fit after them, for the last piece of all.
  /// Error kIo naming the file; its size is what it was.
  Result<void> append(std::initializer_list<std::span<const std::byte>> pieces, std::uint64_t room);

  /// Gives back the room that was kept. Error kIo.
  Result<void> close();

  std::uint64_t size() const { return size_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  OutputFile(std::filesystem::path path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}
  Result<void> reserve(std::uint64_t bytes);
  Error failure(const char* what, int number) const;

  std::filesystem::path path_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
  bool can_reserve_ = true;
};

}  // namespace jostle::bags
