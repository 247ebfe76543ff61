#include "services/studies/bench/run_process.hpp"

#include <sys/resource.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"

namespace jostle::studies {

double children_cpu_seconds() {
  rusage used{};
  getrusage(RUSAGE_CHILDREN, &used);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

Result<Sample> run_once(const RunProcess& run, const Meanwhile& meanwhile) {
  const std::filesystem::path result = run.folder / "result.json";
  std::vector<std::string> arguments = run.arguments;
  arguments.insert(arguments.end(), {"--headless", "--json", result.string(), "--domain", std::to_string(run.domain)});
  auto run_result =
      common::ChildProcess::start(common::program_folder() / "jostle_run", arguments, run.folder / "run.log");
  if (!run_result) return run_result.error();
  while (!run_result->ended()) {
    if (run.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    if (auto ok = meanwhile(*run_result); !ok) return ok.error();
  }
  const common::ExitStatus ended = *run_result->ended();
  if (!ended.ok() && ended.code != common::kExitFailed) {  // failed: no plan is good enough, perhaps by intent
    return Error{Code::kUnavailable, "the run: " + ended.text() + "\n" + run_result->last_words()};
  }
  auto text_result = common::read_text(result);
  if (!text_result) return text_result.error();
  const auto report = nlohmann::json::parse(*text_result, nullptr, false);
  if (!report.is_object() || !report.value(run.seconds, nlohmann::json()).is_number() ||
      !report.value("plan_hash", nlohmann::json()).is_string()) {
    return Error{Code::kUnavailable, "the run made no plan: " + run_result->last_words()};
  }
  return Sample{.value = report[run.seconds], .hash = hash_of(report["plan_hash"].get<std::string>())};
}

}  // namespace jostle::studies
