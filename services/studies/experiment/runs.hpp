#pragma once
/// \file
/// What studies of whole runs read of their records, and say of many.

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "planners/execution/execution.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/results/results.hpp"

namespace jostle::studies {

inline bool ended_as(const nlohmann::json& run, planners::Ending ending) {
  return run.value("ending", "") == planners::to_string(ending);
}
/// Returns a number of a record; kNone where it has none.
inline double number(const nlohmann::json& run, const char* key) {
  const auto found = run.find(key);
  return found == run.end() || found->is_null() ? common::kNone : found->get<double>();
}
inline double actions(const nlohmann::json& run) { return run["actions"]; }
inline double planning(const nlohmann::json& run) { return run["planning_seconds"]; }  ///< s

/// Returns what followed the first plan, s: other plans by the clock, and each action by the world's (Fig. 3.5d, 4.4c).
inline double execution_seconds(const planners::Outcome& outcome, double step_duration) {
  const bool has_plan = !outcome.first_plan.controls.values.empty();
  const std::chrono::duration<double> replanning =
      outcome.planning_time - (has_plan ? outcome.plan_time : outcome.planning_time);
  return replanning.count() + outcome.actions * step_duration;
}

/// Returns the records of all cases that were run, in their order; for one in which a part of the system failed, what
/// broken(index, error) makes of it.
template <class Broken>
std::vector<nlohmann::json> runs_of(const std::vector<nlohmann::json>& records, Broken broken) {
  std::vector<nlohmann::json> runs;
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (records[i].is_null()) continue;
    runs.push_back(records[i].contains("error") ? broken(i, records[i]["error"].get<std::string>()) : records[i]);
  }
  return runs;
}

/// Runs that are alike but for their seeds: a cell of a table.
struct RunGroup {
  std::vector<const nlohmann::json*> runs;  ///< that came to an end, whatever it was; broken ones did not
  int successes = 0, broken = 0;

  void add(const nlohmann::json& run) {
    if (ended_as(run, planners::Ending::kBroken)) {
      ++broken;
      return;
    }
    runs.push_back(&run);
    successes += run["success"] ? 1 : 0;
  }

  common::Share share() const { return common::wilson_interval(successes, static_cast<int>(runs.size())); }
};

/// Returns the mean of `value` of each run that has one.
template <class Value>
common::Mean mean_over(const std::vector<const nlohmann::json*>& runs, Value value) {
  std::vector<double> values;
  for (const nlohmann::json* run : runs) {
    if (const double one = value(*run); std::isfinite(one)) values.push_back(one);
  }
  return common::mean_of(values);
}
inline common::Mean mean_over(const std::vector<const nlohmann::json*>& runs, const char* key) {
  return mean_over(runs, [key](const nlohmann::json& run) { return number(run, key); });
}

/// Puts how many runs there are and how many succeeded into a row of results.
inline void put_share(nlohmann::json& row, const RunGroup& group) {
  const common::Share share = group.share();
  row["successes"] = share.successes;
  row["runs"] = share.runs;
  row["broken"] = group.broken;
  row["interval"] = {common::number_or_null(share.low), common::number_or_null(share.high)};
}

/// Puts a mean into a row of results, and half its 95 % interval as `key`_half_width.
inline void put_mean(nlohmann::json& row, const std::string& key, const common::Mean& mean) {
  row[key] = common::number_or_null(mean.value);
  row[key + "_half_width"] = common::number_or_null(mean.half_width);
}

}  // namespace jostle::studies
