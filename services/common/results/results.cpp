#include "services/common/results/results.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/utsname.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "services/common/process/files.hpp"
#include "services/common/results/json_text.hpp"

namespace jostle::common {

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

Result<void> write_results(const std::filesystem::path& file, nlohmann::json results) {
  if (!results.is_object()) results = {{"results", std::move(results)}};
  results["provenance"] = provenance();
  return write_text(file, json_text(results) + "\n");
}

}  // namespace jostle::common
