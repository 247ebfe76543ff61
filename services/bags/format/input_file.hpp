#pragma once
/// \file
/// InputFile: a file that is read here and there.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::bags {

class InputFile {
 public:
  /// Errors   kNotFound  nothing there
  ///          kIo        it cannot be opened
  static Result<InputFile> open(const std::filesystem::path& path);
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;
  ~InputFile();

  /// Reads `count` bytes from `offset` on.
  /// Errors   kInvalidArgument  the file ends before
  ///          kIo               it cannot be read
  Result<std::vector<std::byte>> read(std::uint64_t offset, std::uint64_t count) const;

  std::uint64_t size() const { return size_; }
  const std::filesystem::path& path() const { return path_; }

  /// Makes the Error that says what is wrong where. `offset`: from the file's beginning.
  Error damaged(std::uint64_t offset, const std::string& what) const;

 private:
  InputFile(std::filesystem::path path, int descriptor, std::uint64_t size)
      : path_(std::move(path)), descriptor_(descriptor), size_(size) {}

  std::filesystem::path path_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

}  // namespace jostle::bags
