#include "services/bags/recorded/recorded_run.hpp"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "services/wire/dds/cdr.hpp"

namespace jostle::bags {
namespace {

using jostle_msgs::msg::GoalResult;
using jostle_msgs::msg::Observation;
using jostle_msgs::msg::Plan;
using jostle_msgs::msg::TaskRun;

Result<Observation> observation_from_cdr(std::span<const std::byte> data) {
  return wire::from_cdr_or_earlier<Observation>(data, 15, [](Observation& seen) { seen.idle(0.0); });
}

// Before there were plans that were made while acting.
Result<Plan> plan_from_cdr(std::span<const std::byte> data) {
  return wire::from_cdr_or_earlier<Plan>(data, 16, [](Plan& plan) {
    plan.deviation(-1.0);
    plan.while_acting(false);
  });
}

std::vector<int> topics_of(const BagInfo& info) {
  std::vector<int> topics;
  for (std::size_t i = 0; i < info.topics.size(); ++i) {
    const std::string& type = info.topics[i].topic.type;
    if (type == "jostle_msgs/msg/TaskRun" || type == "jostle_msgs/msg/Observation" || type == "jostle_msgs/msg/Plan" ||
        type == "jostle_msgs/msg/GoalResult") {
      topics.push_back(static_cast<int>(i));
    }
  }
  return topics;
}

std::string names(const BagInfo& info) {
  std::string text;
  for (const TopicInfo& topic : info.topics) text += (text.empty() ? "" : ", ") + topic.topic.name;
  return text.empty() ? "no topics" : text;
}

// The parts of one run as they come, in any order and some of them twice.
struct Parts {
  std::optional<TaskRun> run;
  std::map<std::uint32_t, std::pair<Observation, Time>> observations;
  std::map<std::uint32_t, Plan> plans;
  std::optional<GoalResult> result;
  Time begin = 0, end = 0;
};

class Collector {
 public:
  // One message that cannot be read costs the run only if the run needs it.
  void skip(const std::string& why) { unreadable_.push_back(why); }

  Result<void> take(const std::string& type, const Message& message) {
    if (type == "jostle_msgs/msg/TaskRun") {
      return with(wire::from_cdr<TaskRun>(message.data), [&](TaskRun run) {
        const std::string id = run.goal().goal_id();
        if (parts_[id].run) return;
        order_.push_back(id);
        parts_[id].run = std::move(run);
        parts_[id].begin = message.log_time;
      });
    }
    if (type == "jostle_msgs/msg/Observation") {
      return with(observation_from_cdr(message.data), [&](Observation seen) {
        parts_[seen.goal_id()].observations.try_emplace(seen.number(), std::move(seen), message.log_time);
      });
    }
    if (type == "jostle_msgs/msg/Plan") {
      return with(plan_from_cdr(message.data),
                  [&](Plan plan) { parts_[plan.goal_id()].plans.try_emplace(plan.number(), std::move(plan)); });
    }
    auto result = result_from_cdr(message.data);
    if (!result) return result.error();
    Parts& parts = parts_[result->goal_id()];
    parts.end = message.log_time;
    parts.result = std::move(result).value();
    return {};
  }

  Result<std::vector<RecordedRun>> runs(const BagInfo& info) const {
    if (order_.empty() && !unreadable_.empty()) {
      return Error{Code::kInvalidArgument, fmt::format("{}: {}", info.path.string(), unreadable_.front())};
    }
    if (order_.empty()) {
      return Error{
          Code::kNotFound,
          fmt::format("{}: got {}, wanted a run with its observations and plans (/task/run, /task/observation, "
                      "/task/plan); `jostle run --record` and `jostle record` record them",
                      info.path.string(), names(info))};
    }
    std::vector<RecordedRun> runs;
    for (const std::string& id : order_) {
      auto run_result = complete(parts_.at(id), info, id);
      if (!run_result) return run_result.error();
      if (!run_result->result) run_result->end = info.end;
      run_result->unreadable = unreadable_;
      runs.push_back(std::move(run_result).value());
    }
    return runs;
  }

 private:
  template <class T, class Use>
  static Result<void> with(Result<T> result, const Use& use) {
    if (!result) return result.error();
    use(std::move(result).value());
    return {};
  }

  Result<RecordedRun> complete(const Parts& parts, const BagInfo& info, const std::string& id) const {
    const auto missing = [&](const char* what, std::size_t number) {
      return Error{Code::kInvalidArgument, fmt::format("{}: run {}: {} {} is missing, wanted all; {}",
                                                       info.path.string(), id, what, number, why_missing(info))};
    };
    RecordedRun run{.run = *parts.run, .begin = parts.begin, .end = parts.end, .result = parts.result};
    for (const auto& [number, entry] : parts.observations) {
      if (number != run.observations.size()) return missing("observation", run.observations.size());
      run.observations.push_back(entry.first);
      run.observed.push_back(entry.second);
    }
    for (const auto& [number, plan] : parts.plans) {
      if (number != run.plans.size()) return missing("plan", run.plans.size());
      if (plan.observation() >= run.observations.size()) return missing("observation", plan.observation());
      run.plans.push_back(plan);
    }
    if (run.observations.empty()) return missing("observation", 0);
    return run;
  }

  // What the bag knows of it, likeliest first.
  std::string why_missing(const BagInfo& info) const {
    if (!unreadable_.empty()) return fmt::format("{} cannot be read: {}", unreadable_.size(), unreadable_.front());
    if (info.notes.contains("recovered")) {
      return "the bag was recovered from a damaged one, which did not have it any more; the note `recovered` of "
             "`jostle bag info` says what was damaged";
    }
    if (const auto lost = info.notes.find(kLostNote); lost != info.notes.end()) {
      for (const auto& [topic, count] : lost->second) {
        const bool is_of_task = topic.ends_with("/task/observation") || topic.ends_with("/task/plan");
        if (is_of_task && count != "0") return fmt::format("its recorder lost {} of {}", count, topic);
      }
      return "its recorder lost none: it was there too late, or the bag is a part of a whole one";
    }
    return "the bag does not say why: it was not recorded here, or its end is missing";
  }

  std::map<std::string, Parts> parts_;  // by goal
  std::vector<std::string> order_;      // of the runs' beginnings
  std::vector<std::string> unreadable_;
};

}  // namespace

Result<GoalResult> result_from_cdr(std::span<const std::byte> data) {
  return wire::from_cdr_or_earlier<GoalResult>(data, 1, [](GoalResult&) {});
}

planners::Ending ending_of(const GoalResult& result) {
  using planners::Ending;
  const auto ending = static_cast<Ending>(result.ending());
  if (ending > Ending::kUnknown && ending <= Ending::kInvalid) return ending;
  if (result.reason() == "cancelled") return Ending::kCancelled;
  if (result.reason() == "refused") return Ending::kRefused;
  if (!result.error().empty()) return Ending::kBroken;
  if (result.success()) return Ending::kSucceeded;
  return result.reason().starts_with("timeout") ? Ending::kTimedOut : Ending::kFailed;
}

bool RecordedRun::concluded() const {
  if (!result) return false;
  const planners::Ending ending = ending_of(*result);
  return ending == planners::Ending::kSucceeded || ending == planners::Ending::kFailed;
}

Result<std::vector<RecordedRun>> select_runs(std::vector<RecordedRun> runs, const std::string& goal_id) {
  if (goal_id.empty()) return runs;
  std::string ids;
  for (const RecordedRun& run : runs) ids += (ids.empty() ? "" : ", ") + run.run.goal().goal_id();
  std::erase_if(runs, [&](const RecordedRun& run) { return run.run.goal().goal_id() != goal_id; });
  if (!runs.empty()) return runs;
  return Error{Code::kNotFound, fmt::format("--goal: got '{}', wanted one of this bag: {}", goal_id, ids)};
}

Result<std::vector<RecordedRun>> read_runs(BagReader& reader) {
  Collector collector;
  const std::vector<int> topics = topics_of(reader.info());
  if (!topics.empty()) reader.seek(reader.info().start, topics);  // no topics would mean all
  while (!topics.empty()) {
    auto message_result = reader.next();
    if (!message_result) return message_result.error();
    if (!*message_result) break;
    const Message& message = **message_result;
    const Topic& topic = reader.info().topics[static_cast<std::size_t>(message.topic)].topic;
    if (auto ok = collector.take(topic.type, message); !ok) {
      collector.skip(fmt::format("{}: {}", topic.name, ok.error().message));
    }
  }
  return collector.runs(reader.info());
}

}  // namespace jostle::bags
