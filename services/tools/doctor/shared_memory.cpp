#include "services/tools/doctor/shared_memory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <map>
#include <numeric>
#include <set>
#include <string_view>

namespace jostle::tools {
namespace {

namespace fs = std::filesystem;

const fs::path kFolder = "/dev/shm";
constexpr double kMiB = 1024.0 * 1024.0;
// A participant takes 0.6 MiB with default segments (measured); 64 MiB is what
// containers get, and enough for a machine full of workers.
constexpr double kEnoughMiB = 60;

// The segment or port a file belongs to, "" if it is not Fast DDS's:
// sem.fastrtps_port7400_mutex and fastrtps_port7400_el go with fastrtps_port7400.
std::string owner_of(std::string file) {
  constexpr std::string_view kSemaphore = "sem.";
  if (file.starts_with(kSemaphore)) file.erase(0, kSemaphore.size());
  if (!file.starts_with("fastrtps_") && !file.starts_with("fast_datasharing_")) return "";
  for (const std::string_view suffix : {"_mutex", "_el", "_sl"}) {
    if (file.ends_with(suffix)) file.erase(file.size() - suffix.size());
  }
  return file;
}

// Last word of a line of /proc/PID/maps, if that is a file of the folder.
void note_mapped(const fs::path& process, const fs::path& folder, std::set<std::string>& used) {
  std::ifstream maps(process / "maps");
  for (std::string line; std::getline(maps, line);) {
    const std::size_t at = line.find(folder.string() + "/");
    if (at != std::string::npos) used.insert(fs::path(line.substr(at)).filename().string());
  }
}

void note_open(const fs::path& process, const fs::path& folder, std::set<std::string>& used) {
  std::error_code ignored;  // processes end while we look, and others' are closed to us
  for (const auto& entry : fs::directory_iterator(process / "fd", ignored)) {
    const fs::path file = fs::read_symlink(entry.path(), ignored);
    if (file.parent_path() == folder) used.insert(file.filename().string());
  }
}

// Names of files in the folder that a living process maps or has open.
std::set<std::string> files_in_use(const fs::path& folder) {
  std::set<std::string> used;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/proc", ignored)) {
    const std::string name = entry.path().filename().string();
    if (!std::ranges::all_of(name, [](unsigned char c) { return std::isdigit(c) != 0; })) continue;
    note_mapped(entry.path(), folder, used);
    note_open(entry.path(), folder, used);
  }
  return used;
}

// Whether someone holds Fast DDS's lock (flock) on a file.
bool is_locked(const fs::path& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool taken = flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  close(descriptor);  // releases our own lock
  return taken;
}

// Ours to judge: our own or, as root, anyone's; and not just being made.
bool is_judged(const fs::path& file, std::chrono::seconds settled) {
  struct stat status {};
  if (stat(file.c_str(), &status) != 0) return false;
  // Not time(): it lags behind the clock of files by up to a tick, and a file would come from the future.
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return (geteuid() == 0 || status.st_uid == geteuid()) && now - status.st_ctime >= settled.count();
}

bool is_abandoned(const Leftover& candidate, const std::set<std::string>& used, std::chrono::seconds settled) {
  return std::ranges::all_of(candidate.files, [&](const fs::path& file) {
    return is_judged(file, settled) && !used.contains(file.filename().string()) && !is_locked(file);
  });
}

double mebibytes(const std::vector<Leftover>& leftovers) {
  return std::accumulate(leftovers.begin(), leftovers.end(), 0.0,
                         [](double sum, const Leftover& one) { return sum + static_cast<double>(one.bytes); }) /
         kMiB;
}

}  // namespace

std::vector<Leftover> find_leftovers(const LeftoverSearch& search) {
  std::map<std::string, Leftover> candidates;
  std::error_code ignored;  // without the folder there are no leftovers
  for (const auto& entry : fs::directory_iterator(search.folder, ignored)) {
    const std::string name = owner_of(entry.path().filename().string());
    if (name.empty()) continue;
    Leftover& candidate = candidates[name];
    candidate.name = name;
    candidate.files.push_back(entry.path());
    const std::uintmax_t size = entry.file_size(ignored);
    if (!ignored) candidate.bytes += size;
  }
  std::vector<Leftover> leftovers;
  const std::set<std::string> used = files_in_use(search.folder);
  for (auto& [name, candidate] : candidates) {
    if (is_abandoned(candidate, used, search.settled)) leftovers.push_back(std::move(candidate));
  }
  return leftovers;
}

std::vector<std::string> find_closed_ports(const fs::path& folder) {
  std::vector<std::string> closed;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename();
    if (name.find("fastrtps_port") == std::string::npos) continue;
    if (access(entry.path().c_str(), R_OK | W_OK) != 0 && errno == EACCES) closed.push_back(name);
  }
  std::ranges::sort(closed);
  return closed;
}

void remove_leftovers(const std::vector<Leftover>& leftovers) {
  std::error_code ignored;  // what stays is found again
  for (const Leftover& leftover : leftovers) {
    for (const fs::path& file : leftover.files) fs::remove(file, ignored);
  }
}

Check check_shared_memory() {
  Check check{.name = "shared memory"};
  struct statvfs status {};
  if (statvfs(kFolder.c_str(), &status) != 0) {
    return {check.name, Verdict::kWarn, kFolder.string() + " is missing: UDP is used instead",
            "mount a tmpfs there: mount -t tmpfs tmpfs /dev/shm"};
  }
  if (access(kFolder.c_str(), W_OK) != 0) {
    return {check.name, Verdict::kWarn, kFolder.string() + " is not writable: UDP is used instead",
            "mount -o remount,rw /dev/shm; chmod 1777 /dev/shm"};
  }
  const double free = static_cast<double>(status.f_bavail) * static_cast<double>(status.f_frsize) / kMiB;
  check.finding = fmt::format("{}: {:.0f} MiB free", kFolder.string(), free);
  if (free < kEnoughMiB) {
    check.verdict = Verdict::kWarn;
    check.remedy =
        "remount it larger (mount -o remount,size=512M /dev/shm); in a container use "
        "--shm-size=512m or --ipc=host";
  }
  return check;
}

Check check_leftovers() {
  const std::vector<Leftover> leftovers = find_leftovers();
  if (const auto closed = find_closed_ports(); !closed.empty()) {
    return {"leftovers", Verdict::kWarn,
            fmt::format("ports of another user: {}; in their domains this user's programs use UDP instead",
                        fmt::join(closed, ", ")),
            "if that user's programs have ended: sudo jostle doctor --clean"};
  }
  if (leftovers.empty()) return {"leftovers", Verdict::kOk, "no shared memory of killed processes", ""};
  return {"leftovers", Verdict::kWarn,
          fmt::format("segments and ports of killed processes: {}, {:.1f} MiB", leftovers.size(), mebibytes(leftovers)),
          "jostle doctor --clean"};
}

}  // namespace jostle::tools
