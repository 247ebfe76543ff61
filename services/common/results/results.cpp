#include "services/common/results/results.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "services/common/process/files.hpp"

namespace jostle::common {

namespace fs = std::filesystem;

extern const char* const kCommit;  // deploy/cmake/Commit.cmake writes it

namespace {

double load_average() {
  double load = 0.0;
  return getloadavg(&load, 1) == 1 ? load : -1.0;
}

struct Beginning {
  std::chrono::system_clock::time_point time = std::chrono::system_clock::now();
  double load = load_average();
};
const Beginning kBeginning;

std::vector<std::string> command() {
  std::vector<std::string> words;
  std::ifstream in("/proc/self/cmdline");
  for (std::string word; std::getline(in, word, '\0');) words.push_back(word);
  if (!words.empty()) words[0] = std::filesystem::path(words[0]).filename();  // not where it lies
  return words;
}

}  // namespace

std::string processor() {
  utsname system{};
  uname(&system);
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    const auto colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) {
      return fmt::format("{}, {}", system.machine, line.substr(colon + 2));
    }
  }
  return system.machine;
}

std::string build() {
  return fmt::format("Jostle {}, GCC {}, {}, {}", JOSTLE_VERSION, __VERSION__, JOSTLE_BUILD_TYPE, kCommit);
}

nlohmann::json provenance() {
  const std::chrono::duration<double> duration = std::chrono::system_clock::now() - kBeginning.time;
  const std::time_t began = std::chrono::system_clock::to_time_t(kBeginning.time);
  return {{"version", JOSTLE_VERSION},
          {"commit", kCommit},
          {"build", build()},
          {"command", command()},
          {"machine", processor()},
          {"cores", std::thread::hardware_concurrency()},
          {"load", {{"at_first", kBeginning.load}, {"at_last", load_average()}}},
          {"began", fmt::format("{:%FT%TZ}", fmt::gmtime(began))},
          {"seconds", duration.count()}};
}

nlohmann::json number_or_null(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

Result<void> check_output(const fs::path& file) {
  const auto problem = [&](const std::string& what) {
    return Error{Code::kIo, fmt::format("{}: cannot be written: {}", file.string(), what)};
  };
  if (file == "-") return {};  // standard output
  std::error_code ignored;
  const fs::file_status status = fs::status(file, ignored);
  if (fs::is_directory(status)) return problem("it is a folder; wanted a file");
  if (fs::exists(status) && access(file.c_str(), W_OK) != 0) return problem(std::strerror(errno));
  if (fs::exists(status) && !fs::is_regular_file(status)) return {};  // a device or a pipe
  const fs::path folder = file.has_parent_path() ? file.parent_path() : ".";
  if (!fs::is_directory(folder, ignored))
    return problem(fmt::format("there is no folder {}; make it", folder.string()));
  std::string draft = file.string() + ".XXXXXX";  // only an attempt tells: root may write where nothing can be made
  const int made = mkostemp(draft.data(), O_CLOEXEC);
  if (made < 0) return problem(std::strerror(errno));
  close(made);
  unlink(draft.c_str());
  return {};
}

Result<void> write_results(const std::filesystem::path& file, nlohmann::json results) {
  if (!results.is_object()) results = {{"results", std::move(results)}};
  results["provenance"] = provenance();
  // Names of files may be no UTF-8; hours of work must not be lost for that.
  return write_text(file, results.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace jostle::common
