#pragma once
/// \file
/// What studies of whole runs read of their records, and say of many.

#include <chrono>
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

/// Returns the mean of `value` of each run.
template <class Value>
common::Mean mean_over(const std::vector<const nlohmann::json*>& runs, Value value) {
  std::vector<double> values;
  for (const nlohmann::json* run : runs) values.push_back(value(*run));
  return common::mean_of(values);
}

/// Puts a mean into a row of results, and half its 95 % interval as `key`_half_width.
inline void put_mean(nlohmann::json& row, const std::string& key, const common::Mean& mean) {
  row[key] = common::number_or_null(mean.value);
  row[key + "_half_width"] = common::number_or_null(mean.half_width);
}

}  // namespace jostle::studies
