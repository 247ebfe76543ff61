#include "services/bags/format/output_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace jostle::bags {

Result<OutputFile> OutputFile::create(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  OutputFile file(path, descriptor);
  if (descriptor < 0) return file.failure("cannot be made", errno);
  return file;
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_),
      can_reserve_(other.can_reserve_) {}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Error OutputFile::failure(const char* what, int number) const {
  return {Code::kIo, fmt::format("{}: {} at byte {}: {}", path_.string(), what, size_, std::strerror(number))};
}

// The file system sets blocks aside behind the end of the file; a crash leaves them there,
// a file's size does not show them.
Result<void> OutputFile::reserve(std::uint64_t bytes) {
  if (!can_reserve_) return {};
  while (::fallocate(descriptor_, FALLOC_FL_KEEP_SIZE, static_cast<off_t>(size_), static_cast<off_t>(bytes)) != 0) {
    if (errno == EINTR) continue;
    if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG) return failure("cannot grow", errno);
    can_reserve_ = false;  // a file system that knows no such thing
    break;
  }
  return {};
}

Result<void> OutputFile::append(std::initializer_list<std::span<const std::byte>> pieces, std::uint64_t room) {
  std::array<iovec, 8> parts;
  std::size_t count = 0;
  std::uint64_t total = 0;
  for (const std::span<const std::byte> piece : pieces) {
    if (piece.empty()) continue;
    parts.at(count++) = {const_cast<std::byte*>(piece.data()), piece.size()};
    total += piece.size();
  }
  if (room > 0) {
    if (auto ok = reserve(total + room); !ok) return ok;
  }
  iovec* part = parts.data();
  for (std::uint64_t left = total; left > 0;) {
    const ssize_t written = ::writev(descriptor_, part, static_cast<int>(count));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const Error error = failure("cannot be written", written < 0 ? errno : ENOSPC);
      // What is there of these pieces goes again, or the next ones would follow half a record.
      if (::ftruncate(descriptor_, static_cast<off_t>(size_)) != 0 ||
          ::lseek(descriptor_, static_cast<off_t>(size_), SEEK_SET) < 0) {
        return failure("cannot be cut back", errno);
      }
      return error;
    }
    left -= static_cast<std::uint64_t>(written);
    auto taken = static_cast<std::size_t>(written);
    while (count > 0 && taken >= part->iov_len) {
      taken -= part->iov_len;
      ++part;
      --count;
    }
    if (count > 0) {
      part->iov_base = static_cast<std::byte*>(part->iov_base) + taken;
      part->iov_len -= taken;
    }
  }
  size_ += total;
  return {};
}

Result<void> OutputFile::close() {
  if (descriptor_ < 0) return {};
  const bool is_cut = ::ftruncate(descriptor_, static_cast<off_t>(size_)) == 0;
  const int cut_problem = errno;
  const bool is_closed = ::close(std::exchange(descriptor_, -1)) == 0;
  if (!is_cut) return failure("cannot be cut back", cut_problem);
  if (!is_closed) return failure("cannot be closed", errno);
  return {};
}

}  // namespace jostle::bags
