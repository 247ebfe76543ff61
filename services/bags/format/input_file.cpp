#include "services/bags/format/input_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace jostle::bags {

Result<InputFile> InputFile::open(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const int problem = errno;
  InputFile file(path, descriptor, 0);
  if (descriptor < 0) {
    return Error{problem == ENOENT ? Code::kNotFound : Code::kIo,
                 fmt::format("{}: cannot be opened: {}", path.string(), std::strerror(problem))};
  }
  struct stat status {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    return Error{Code::kIo, fmt::format("{}: got something else, wanted a file", path.string())};
  }
  file.size_ = static_cast<std::uint64_t>(status.st_size);
  return file;
}

InputFile::InputFile(InputFile&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)), size_(other.size_) {}

InputFile::~InputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<std::vector<std::byte>> InputFile::read(std::uint64_t offset, std::uint64_t count) const {
  if (offset > size_ || count > size_ - offset) {
    return damaged(size_, fmt::format("the file ends, wanted {} bytes from byte {} on", count, offset));
  }
  std::vector<std::byte> bytes(static_cast<std::size_t>(count));
  std::size_t filled = 0;
  while (filled < bytes.size()) {
    const ssize_t got =
        ::pread(descriptor_, bytes.data() + filled, bytes.size() - filled, static_cast<off_t>(offset + filled));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      return Error{Code::kIo, fmt::format("{}: cannot be read at byte {}: {}", path_.string(), offset + filled,
                                          std::strerror(errno))};
    }
    if (got == 0) return damaged(offset + filled, "the file has become shorter while it was read");
    filled += static_cast<std::size_t>(got);
  }
  return bytes;
}

Error InputFile::damaged(std::uint64_t offset, const std::string& what) const {
  return {Code::kInvalidArgument, fmt::format("{}: byte {}: {}; remedy: jostle bag recover saves what is readable",
                                              path_.string(), offset, what)};
}

}  // namespace jostle::bags
