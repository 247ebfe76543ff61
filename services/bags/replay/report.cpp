#include "services/bags/replay/report.hpp"

#include <fmt/format.h>

namespace jostle::bags {
namespace {

std::string end_of(const RecordedRun& recorded) {
  if (!recorded.result) return "recording ends before the run";
  return recorded.result->error().empty() ? recorded.result->reason() : recorded.result->error();
}

}  // namespace

std::string headline(const RecordedRun& recorded) {
  const auto& goal = recorded.run.goal();
  std::string text;
  for (const std::string& message : recorded.unreadable) text += fmt::format("cannot be read: {}\n", message);
  return text + fmt::format("{}: {}, predictor {}, seed {}; {} plans, {} commands; {}\n  recorded by {}; {}; {}\n",
                            goal.goal_id(), goal.controller(), goal.predictor(), goal.seed(), recorded.plans.size(),
                            recorded.observations.size() - 1, end_of(recorded), recorded.run.build(),
                            recorded.run.engine(), recorded.run.machine());
}

std::string plan_line(const jostle_msgs::msg::Plan& replayed, const jostle_msgs::msg::Plan* recorded,
                      const StateLayout& layout) {
  const char* judgement = "was not made in the recorded run";
  if (recorded) judgement = compare(layout, *recorded, replayed) ? "DIFFERS" : "equal";
  return fmt::format("  plan {:>3}  after action {:>2}  {:>3} iterations  {} steps  cost {:>10.4f}  {}\n",
                     replayed.number(), replayed.observation(), replayed.iterations(),
                     replayed.nu() > 0 ? replayed.controls().size() / static_cast<std::size_t>(replayed.nu()) : 0,
                     replayed.cost(), judgement);
}

std::string verdict(const RecordedRun& recorded, const ReplayReport& report) {
  const Comparison& comparison = report.comparison;
  const std::string counts = fmt::format("{} of {} plans, {} of {} commands", comparison.equal_plans, comparison.plans,
                                         comparison.equal_actions, comparison.actions);
  if (comparison.bit_equal() && comparison.plans == 0) {
    return kNothingToCompare;
  }
  if (comparison.bit_equal()) {
    std::string text = fmt::format("BIT-EQUAL: {}\n", counts);
    for (const Change& change : report.changes) {
      text += fmt::format("  although   {}: recorded {}, replayed {}\n", change.key, change.recorded, change.replayed);
    }
    return text;
  }
  const Difference& first = *comparison.first;
  std::string text = fmt::format("DIFFERS at {}: {}\n  recorded   {}\n  replayed   {}\n", first.decision, first.field,
                                 first.recorded, first.replayed);
  if (!first.given.empty()) text += fmt::format("  given      {}\n", first.given);
  if (!first.effect.empty()) text += fmt::format("  effect     {}\n", first.effect);
  for (const std::string& reason : report.reasons()) text += fmt::format("  why        {}\n", reason);
  text += fmt::format("  altogether {} are equal; each was decided on what was observed in the recorded run\n", counts);
  text += fmt::format("  end        recorded: {}; replayed: {} ({} plans, {} commands)\n", end_of(recorded),
                      report.ended, report.decisions.plans.size(), report.decisions.observations.size() - 1);
  return text;
}

nlohmann::json to_json(const RecordedRun& recorded, const ReplayReport& report) {
  const auto made_by = [](const jostle_msgs::msg::TaskRun& run) {
    return nlohmann::json{
        {"build", run.build()}, {"engine", run.engine()}, {"middleware", run.middleware()}, {"machine", run.machine()}};
  };
  const Comparison& comparison = report.comparison;
  nlohmann::json json{{"goal", recorded.run.goal().goal_id()},
                      {"bit_equal", comparison.bit_equal()},
                      {"plans", comparison.plans},
                      {"equal_plans", comparison.equal_plans},
                      {"replayed_plans", report.decisions.plans.size()},
                      {"actions", comparison.actions},
                      {"equal_actions", comparison.equal_actions},
                      {"recorded_by", made_by(report.recorded)},
                      {"replayed_by", made_by(report.here)},
                      {"recorded_end", end_of(recorded)},
                      {"replayed_end", report.ended},
                      {"changes", nlohmann::json::array()}};
  for (const Change& change : report.changes) {
    json["changes"].push_back({{"key", change.key}, {"recorded", change.recorded}, {"replayed", change.replayed}});
  }
  if (comparison.bit_equal()) return json;
  const Difference& first = *comparison.first;
  json["first_difference"] = {{"decision", first.decision}, {"field", first.field}, {"recorded", first.recorded},
                              {"replayed", first.replayed}, {"given", first.given}, {"effect", first.effect},
                              {"why", report.reasons()}};
  return json;
}

}  // namespace jostle::bags
