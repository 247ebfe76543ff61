#include "idl/files/files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <optional>
#include <set>
#include <thread>
#include <utility>

namespace jostle::files {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kReaderPatience{10};    // of a pipe
constexpr std::chrono::milliseconds kReaderPause{10};  // between two looks for it
constexpr int kMostLinks = 40;                         // one after the other, as Linux has it
constexpr std::size_t kPiece = std::size_t{1} << 16;   // bytes read at a time

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&&) = delete;
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }

  explicit operator bool() const { return number_ >= 0; }
  int number() const { return number_; }
  bool close() { return ::close(std::exchange(number_, -1)) == 0; }

 private:
  int number_;
};

std::string reason() { return std::strerror(errno); }

Error unwritable(const fs::path& file, const std::string& why) {
  return {Code::kIo, fmt::format("{}: cannot be written: {}", file.string(), why)};
}

// With errno.
Error unreadable(const fs::path& file) {
  if (errno == ENOENT || errno == ENOTDIR) return {Code::kNotFound, fmt::format("{}: missing", file.string())};
  return {Code::kNotFound, fmt::format("{}: cannot be read: {}", file.string(), reason())};
}

fs::path folder_of(const fs::path& file) { return file.has_parent_path() ? file.parent_path() : fs::path("."); }

// What a path leads to, links followed; nothing if there is no such thing.
std::optional<struct stat> look_at(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return {};
  return found;
}

// The file that is meant, where the path is a link; it need not be there.
fs::path without_links(fs::path file) {
  std::error_code problem;
  for (int i = 0; i < kMostLinks && fs::is_symlink(file, problem); ++i) {
    const fs::path next = fs::read_symlink(file, problem);
    if (problem) break;
    file = next.is_absolute() ? next : folder_of(file) / next;
  }
  return file;
}

// False with errno.
bool write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(descriptor, bytes.data(), bytes.size());
    if (count < 0 && errno != EINTR) return false;
    if (count > 0) bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

// A pipe can be opened once somebody reads from it.
Descriptor open_special(const fs::path& file) {
  const auto deadline = std::chrono::steady_clock::now() + kReaderPatience;
  for (;;) {
    Descriptor descriptor(::open(file.c_str(), O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
    if (descriptor) {
      ::fcntl(descriptor.number(), F_SETFL, O_WRONLY);  // from now on it may wait
      return descriptor;
    }
    if (errno != ENXIO || std::chrono::steady_clock::now() >= deadline) return descriptor;
    std::this_thread::sleep_for(kReaderPause);
  }
}

Result<void> write_special(const fs::path& file, std::string_view bytes) {
  Descriptor descriptor = open_special(file);
  if (!descriptor) return unwritable(file, errno == ENXIO ? "nobody reads from this pipe" : reason());
  if (!write_all(descriptor.number(), bytes) || !descriptor.close()) return unwritable(file, reason());
  return {};
}

Result<void> write_in_place(const fs::path& file, std::string_view bytes) {
  Descriptor descriptor(::open(file.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC));
  if (!descriptor || !write_all(descriptor.number(), bytes) || ::fsync(descriptor.number()) != 0 || !descriptor.close())
    return unwritable(file, reason());
  return {};
}

// Whether a path leads to where standard output goes: what is written to /dev/stdout comes behind what is there.
bool leads_to_standard_output(const struct stat& found) {
  struct stat output {};
  return ::fstat(STDOUT_FILENO, &output) == 0 && output.st_dev == found.st_dev && output.st_ino == found.st_ino;
}

// A name that nobody else has, in the same folder and therefore on the same disk.
fs::path draft_name(const fs::path& file) {
  static std::atomic<unsigned> count = 0;
  return folder_of(file) / fmt::format(".jostle-{}-{}.tmp", ::getpid(), count++);
}

bool fill(Descriptor& draft, const std::optional<struct stat>& before, std::string_view bytes) {
  if (before) {
    if (::fchown(draft.number(), before->st_uid, before->st_gid) != 0) errno = 0;  // only root may give files away
    if (::fchmod(draft.number(), before->st_mode & 07777) != 0) return false;
  }
  return write_all(draft.number(), bytes) && ::fsync(draft.number()) == 0 && draft.close();
}

Result<void> replace(const fs::path& file, const std::optional<struct stat>& before, std::string_view bytes) {
  if (before && ::access(file.c_str(), W_OK) != 0) return unwritable(file, reason());
  const fs::path name = draft_name(file);
  ::unlink(name.c_str());  // of a process of our number that was killed
  Descriptor draft(::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (!draft) {
    const bool in_place = before && (errno == EACCES || errno == EPERM || errno == EROFS);
    return in_place ? write_in_place(file, bytes) : unwritable(file, reason());
  }
  const bool is_full = fill(draft, before, bytes);
  if (is_full && ::rename(name.c_str(), file.c_str()) == 0) {
    const Descriptor folder(::open(folder_of(file).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder) ::fsync(folder.number());  // not every file system can
    return {};
  }
  const int why = errno;
  ::unlink(name.c_str());
  if (is_full && before && why == EBUSY) return write_in_place(file, bytes);  // a mount of its own, as in containers
  errno = why;
  return unwritable(file, reason());
}

Result<void> write_standard_output(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), stdout) == bytes.size() && std::fflush(stdout) == 0) return {};
  return Error{Code::kIo, fmt::format("standard output: cannot be written: {}", reason())};
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

Error refused(const Output& output, Code code, const std::string& got, const std::string& wanted) {
  return {code, fmt::format("{}: got '{}'{}, wanted {}", output.option, output.path.string(), got, wanted)};
}

// Why a folder cannot take new files; empty if it can.
std::string folder_trouble(const fs::path& folder) {
  const auto found = look_at(folder);
  if (!found && errno != ENOENT && errno != ENOTDIR) return fmt::format("folder {}: {}", folder.string(), reason());
  if (!found) return fmt::format("folder {} is not there", folder.string());
  if (!S_ISDIR(found->st_mode)) return fmt::format("{} is not a folder", folder.string());
  if (::access(folder.c_str(), W_OK | X_OK) != 0) return fmt::format("folder {}: {}", folder.string(), reason());
  return "";
}

// Folders of the kernel that root may "write" to, and in which nobody can make a file: /proc, /sys. The only way to
// know is to try.
std::string making_trouble(const fs::path& file) {
  const fs::path name = draft_name(file);
  const Descriptor draft(::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!draft) return fmt::format("in folder {} none can be made: {}", folder_of(file).string(), reason());
  ::unlink(name.c_str());
  return "";
}

Result<void> check_file(const Output& output) {
  if (is_standard(output.path)) return {};
  const std::string ending = lower(output.path.extension().string());
  const auto found = look_at(output.path);
  if (found && S_ISDIR(found->st_mode)) return refused(output, Code::kIo, ", a folder", "a file");
  if (!output.path.has_filename()) return refused(output, Code::kIo, ", a folder", "a file");
  const bool is_regular = !found || (S_ISREG(found->st_mode) && !leads_to_standard_output(*found));
  // What is not a file has the name that somebody gave it, such as /dev/stdout.
  if (is_regular && !output.endings.empty() && std::ranges::find(output.endings, ending) == output.endings.end()) {
    return refused(output, Code::kInvalidArgument, "",
                   fmt::format("a name that ends in {}", fmt::join(output.endings, ", ")));
  }
  if (found && ::access(output.path.c_str(), W_OK) != 0) {
    return refused(output, Code::kIo, "", fmt::format("a file that can be written: {}", reason()));
  }
  if (found) return {};  // if not replaced, it is written in place
  const fs::path file = without_links(output.path);
  std::string trouble = folder_trouble(folder_of(file));
  if (trouble.empty()) trouble = making_trouble(file);
  if (trouble.empty()) return {};
  return refused(output, Code::kIo, "", fmt::format("a file in a folder that can be written to: {}", trouble));
}

Result<void> check_folder(const Output& output) {
  const fs::path folder = output.path.has_filename() ? output.path : output.path.parent_path();
  std::error_code problem;
  if (const auto found = look_at(folder)) {
    if (!S_ISDIR(found->st_mode))
      return refused(output, Code::kInvalidArgument, ", a file", "a folder that is new or empty");
    if (!fs::is_empty(folder, problem) && !problem)
      return refused(output, Code::kInvalidArgument, ", in which there is something", "a folder that is new or empty");
    const std::string trouble = folder_trouble(folder);
    if (trouble.empty()) return {};
    return refused(output, Code::kIo, "", fmt::format("a folder that can be written to: {}", trouble));
  }
  std::string trouble = folder_trouble(folder_of(folder));
  if (trouble.empty()) trouble = making_trouble(folder);
  if (trouble.empty()) return {};
  return refused(output, Code::kIo, "", fmt::format("a new folder where one can be made: {}", trouble));
}

Error joined(const std::vector<Error>& errors) {
  Error all{Code::kIo, ""};
  for (const Error& error : errors) {
    if (error.code == Code::kInvalidArgument) all.code = error.code;
    all.message += (all.message.empty() ? "" : "\n") + error.message;
  }
  return all;
}

}  // namespace

bool is_standard(const fs::path& file) { return file == "-"; }

Result<std::string> read(const fs::path& file, std::size_t most) {
  const bool is_input = is_standard(file);
  const fs::path name = is_input ? fs::path("standard input") : file;
  // A pipe without a writer is waited for, as everywhere.
  const Descriptor descriptor(is_input ? ::dup(STDIN_FILENO) : ::open(file.c_str(), O_RDONLY | O_NOCTTY | O_CLOEXEC));
  if (!descriptor) return unreadable(name);
  struct stat found {};
  if (::fstat(descriptor.number(), &found) != 0) return unreadable(name);
  if (S_ISDIR(found.st_mode))
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: cannot be read: it is a folder, wanted a file", name.string())};
  const auto too_large = [&](const std::string& size) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got {} bytes, wanted at most {}", name.string(), size, most)};
  };
  if (S_ISREG(found.st_mode) && static_cast<std::size_t>(found.st_size) > most)
    return too_large(std::to_string(found.st_size));
  std::string bytes;
  for (;;) {  // what a file of /proc or a pipe holds, nobody knows before
    const std::size_t had = bytes.size();
    bytes.resize(had + kPiece);
    const ssize_t count = ::read(descriptor.number(), bytes.data() + had, kPiece);
    bytes.resize(had + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return unreadable(name);
    if (bytes.size() > most) return too_large(fmt::format("more than {}", most));
    if (count == 0) return bytes;
  }
}

Result<void> write(const fs::path& file, std::string_view bytes) {
  if (is_standard(file)) return write_standard_output(bytes);
  const auto before = look_at(file);
  if (before && leads_to_standard_output(*before)) return write_standard_output(bytes);
  if (before && S_ISDIR(before->st_mode)) return unwritable(file, "it is a folder, wanted a file");
  if (before && !S_ISREG(before->st_mode)) return write_special(file, bytes);
  const fs::path meant = without_links(file);
  std::error_code ignored;
  if (fs::is_symlink(meant, ignored)) return unwritable(file, std::strerror(ELOOP));
  if (!look_at(folder_of(meant)))
    return unwritable(file, fmt::format("folder {} is not there", folder_of(meant).string()));
  return replace(meant, before, bytes);
}

Result<void> check_outputs(std::span<const Output> outputs) {
  std::vector<Error> errors;
  std::set<fs::path> names;
  for (const Output& output : outputs) {
    if (output.path.empty()) continue;
    if (auto ok = output.is_folder ? check_folder(output) : check_file(output); !ok) errors.push_back(ok.error());
    const auto found = look_at(output.path);
    const bool may_repeat = found && !S_ISREG(found->st_mode);  // such as /dev/null
    if (!may_repeat && !names.insert(output.path.lexically_normal()).second)
      errors.push_back(refused(output, Code::kInvalidArgument, " twice", "a file for each"));
  }
  if (errors.empty()) return {};
  return joined(errors);
}

Result<void> check_output(const Output& output) { return check_outputs({&output, 1}); }

}  // namespace jostle::files
