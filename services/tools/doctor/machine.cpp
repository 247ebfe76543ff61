#include "services/tools/doctor/machine.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <thread>

#include "physics_pool/local/handles.hpp"
#include "services/common/process/files.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::tools {

Check check_cores() {
  const unsigned cores = std::thread::hardware_concurrency();
  double load = 0;
  if (getloadavg(&load, 1) != 1) {
    return {"cores", Verdict::kWarn, fmt::format("{} cores, load unknown", cores), "mount /proc"};
  }
  Check check{.name = "cores", .finding = fmt::format("{} cores, load {:.1f} over the last minute", cores, load)};
  if (load > cores) {
    check.verdict = Verdict::kWarn;
    check.remedy = "end what else runs (top), or measured times will mean little";
  }
  return check;
}

std::vector<Check> check_versions() {
  return {{"MuJoCo", Verdict::kOk, physics_pool::engine_version(), ""},
          {"Fast DDS", Verdict::kOk, wire::middleware_version(), ""}};
}

Check check_worker() {
  const std::filesystem::path worker = common::program_folder() / "jostle_worker";
  if (access(worker.c_str(), X_OK) == 0) return {"worker", Verdict::kOk, worker.string(), ""};
  return {"worker", Verdict::kFail, worker.string() + " is missing or not executable",
          "build the target jostle_worker, or install the whole package"};
}

}  // namespace jostle::tools
