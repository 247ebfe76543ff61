#include "services/bags/replay/replay.hpp"

#include <fmt/format.h>

#include "services/bags/replay/recorded_world.hpp"
#include "services/task/session/task.hpp"

namespace jostle::bags {

std::vector<std::string> ReplayReport::reasons() const {
  std::vector<std::string> reasons;
  for (const Change& change : changes) {
    reasons.push_back(fmt::format("{}: recorded {}, replayed {}", change.key, change.recorded, change.replayed));
  }
  const auto differs = [&](const char* what, const std::string& then, const std::string& now) {
    if (then != now) reasons.push_back(fmt::format("another {}: recorded {}, here {}", what, then, now));
  };
  differs("build", recorded.build(), here.build());
  differs("physics engine", recorded.engine(), here.engine());
  differs("machine", recorded.machine(), here.machine());
  if (reasons.empty()) {
    reasons.push_back(
        "options, versions and machine type are equal: sources that changed without a new version, or a bug");
  }
  return reasons;
}

Result<ReplayReport> replay(const RecordedRun& recorded, const ReplayOptions& options, physics_pool::AsyncPool& pool,
                            std::stop_token stop) {
  jostle_msgs::msg::Goal goal = recorded.run.goal();
  auto changes_result = apply_changes(options.settings, goal);
  if (!changes_result) return changes_result.error();
  auto task_result = task::Task::prepare(goal, pool);
  if (!task_result) return task_result.error();
  task::Task& task = *task_result;
  // The recording says how long it goes on; this machine may be slower.
  constexpr std::chrono::hours kForever{24 * 365};
  task.parameters().limits.timeout = kForever;

  ReplayReport report{
      .recorded = recorded.run, .here = task::describe_run(goal), .changes = std::move(changes_result).value()};
  RecordedWorld world(recorded, physics_pool::axis_limits(task.geometry().robot), options.rate);
  RecordedWorld::Robot robot(world);
  RecordedWorld::Objects objects(world);
  const StateLayout& layout = task.geometry().layout;
  const task::Task::Watch watch{
      .journal = {.on_observation = [&](const auto& seen) { report.decisions.observations.push_back(seen); },
                  .on_plan =
                      [&](const auto& plan) {
                        const std::size_t place = report.decisions.plans.size();
                        report.decisions.plans.push_back(plan);
                        if (!options.on_plan) return;
                        options.on_plan(plan, place < recorded.plans.size() ? &recorded.plans[place] : nullptr, layout);
                      }},
      .time = [&] { return world.time(); }};
  auto outcome_result = task.perform(robot, objects, watch, stop);
  if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
  report.decisions.asked_for_more = world.asked_for_more();
  if (!outcome_result && !world.asked_for_more()) return outcome_result.error();
  report.ended = outcome_result ? outcome_result->reason : outcome_result.error().message;
  report.comparison = compare(layout, recorded, report.decisions);
  return report;
}

}  // namespace jostle::bags
