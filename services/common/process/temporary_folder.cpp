#include "services/common/process/temporary_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "services/common/process/program.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kRandom = "XXXXXX";
constexpr int kMostAttempts = 100;  // others may sweep a folder between its making and its locking

// Locks a folder that is there for as long as this process lives: the kernel lets go of it when the process ends,
// however that happens. Returns -1 if somebody else has it (`how` has LOCK_NB), or it is gone.
int lock(const fs::path& folder, int how) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  struct stat found {};
  if (descriptor >= 0 && ::flock(descriptor, how) == 0 && ::fstat(descriptor, &found) == 0 && found.st_nlink > 0 &&
      found.st_uid == ::geteuid()) {
    return descriptor;
  }
  if (descriptor >= 0) ::close(descriptor);
  return -1;
}

void sweep(const fs::path& parent, const std::string& stem) {
  std::error_code ignored;
  std::vector<fs::path> left;
  for (const auto& entry : fs::directory_iterator(parent, ignored)) {
    const std::string name = entry.path().filename();
    if (name.size() == stem.size() + kRandom.size() && name.starts_with(stem)) left.push_back(entry.path());
  }
  for (const fs::path& folder : left) {
    const int descriptor = lock(folder, LOCK_EX | LOCK_NB);
    if (descriptor < 0) continue;
    fs::remove_all(folder, ignored);
    ::close(descriptor);
  }
}

Result<fs::path> folder_for_temporary_ones() {
  std::error_code problem;
  const fs::path folder = fs::temp_directory_path(problem);
  if (!problem) return folder;
  for (const char* variable : {"TMPDIR", "TMP", "TEMP", "TEMPDIR"}) {  // the order of temp_directory_path
    if (const char* value = std::getenv(variable)) {
      return Error{Code::kIo, fmt::format("{}: got '{}', wanted a folder that is there; make it, or unset {}", variable,
                                          value, variable)};
    }
  }
  return Error{Code::kIo, "/tmp: it is no folder, wanted one for temporary files; set TMPDIR to another"};
}

}  // namespace

Result<fs::path> make_temporary_folder(const std::string& purpose) {
  const auto parent_result = folder_for_temporary_ones();
  if (!parent_result) return parent_result.error();
  const std::string stem = fmt::format("jostle-{}-", purpose);
  sweep(*parent_result, stem);
  const std::string pattern = (*parent_result / (stem + std::string(kRandom))).string();
  for (int i = 0; i < kMostAttempts; ++i) {
    std::string name = pattern;
    if (!mkdtemp(name.data())) break;
    if (lock(name, LOCK_EX) < 0) continue;
    remove_at_abrupt_end(name);
    return fs::path(name);  // the descriptor stays open
  }
  return Error{Code::kIo,
               fmt::format("{}: cannot be made: {}; TMPDIR names another place", pattern, std::strerror(errno))};
}

}  // namespace jostle::common
