#include "services/studies/experiment/study_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <thread>

#include "idl/types/hash.hpp"
#include "services/common/results/results.hpp"

namespace jostle::studies {
namespace {

using nlohmann::json;

// Runs the cases that have no record yet.
class Runner {
 public:
  Runner(Study& study, const std::vector<std::string>& names, std::vector<json>& records,
         const StudyRunOptions& options)
      : study_(study), names_(names), records_(records), options_(options) {}

  void run() {
    std::vector<std::jthread> threads;
    for (int i = 0; i < std::max(study_.at_a_time(), 1); ++i) threads.emplace_back([this] { work(); });
  }

 private:
  void work() {
    for (std::size_t mine = next_++; mine < names_.size() && !options_.stop.stop_requested(); mine = next_++) {
      if (records_[mine].is_null()) run_case(mine);
    }
  }

  void run_case(std::size_t index) {
    auto record_result = study_.run_case(index, options_.stop);
    if (!record_result && options_.stop.stop_requested()) return;
    const std::lock_guard lock(mutex_);
    if (!record_result) {
      records_[index] = {{"error", record_result.error().message}};
      options_.on_trouble(fmt::format("{}: {}", names_[index], record_result.error().message));
      options_.on_case("");
      return;
    }
    records_[index] = std::move(record_result).value();
    if (options_.journal && !journal_failed_) {
      const auto kept = options_.journal->append(names_[index], records_[index]);
      journal_failed_ = !kept;
      if (!kept) options_.on_trouble(kept.error().message + "; from now on nothing is kept before the end");
    }
    options_.on_case(fmt::format("{}: {}", names_[index], study_.news_of(records_[index])));
  }

  Study& study_;
  const std::vector<std::string>& names_;
  std::vector<json>& records_;
  const StudyRunOptions& options_;
  std::atomic<std::size_t> next_ = 0;
  std::mutex mutex_;  // one report at a time
  bool journal_failed_ = false;
};

}  // namespace

Result<StudyEnd> run_study(Study& study, const StudyRunOptions& options) {
  auto names_result = study.prepare();
  if (!names_result) return names_result.error();
  const std::vector<std::string>& names = *names_result;
  StudyEnd end{.total = names.size()};
  std::vector<json> records(names.size());
  for (std::size_t i = 0; options.journal && i < names.size(); ++i) {
    const auto found = options.journal->found().find(names[i]);
    if (found == options.journal->found().end()) continue;
    records[i] = found->second;
    ++end.found;
  }
  options.on_begin(end.total, end.found);
  Runner(study, names, records, options).run();
  for (const json& record : records) {
    end.done += record.is_null() ? 0 : 1;
    end.broken += record.contains("error") ? 1 : 0;
  }
  end.report = study.report(records);
  if (!end.complete()) end.report.json["partial"] = {{"done", end.done}, {"of", end.total}};
  return end;
}

Result<json> origin_of(const std::string& name, const Study& study) {
  auto files_result = study_files(name);
  if (!files_result) return files_result.error();
  json files = json::object();
  for (const auto& [file, text] : *files_result) files[file] = to_string(hash_of(text));
  const json here = common::provenance();
  return json{{"study", name},
              {"settings", study.settings()},
              {"files", files},
              {"version", here["version"]},
              {"commit", here["commit"]},
              {"machine", here["machine"]}};
}

}  // namespace jostle::studies
