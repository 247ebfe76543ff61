#include "services/bags/recorded/recorded_motion.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "planners/execution/execution.hpp"
#include "services/wire/dds/cdr.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::bags {
namespace {

using jostle_msgs::msg::ObjectStates;
using jostle_msgs::msg::RobotStatus;

// A measurement with the two times it has.
struct Moment {
  double world = 0.0;  // s
  Time wall = 0;
  State state;
};

std::vector<int> topics_of_type(const BagInfo& info, const std::string& type) {
  std::vector<int> topics;
  for (std::size_t i = 0; i < info.topics.size(); ++i) {
    if (info.topics[i].topic.type == type) topics.push_back(static_cast<int>(i));
  }
  return topics;
}

// What was appended since there are bags, with what aligns it.
constexpr std::size_t kSceneBytes = 7;                     // its length
constexpr std::size_t kStatusBytes = 7 + 4 + kSceneBytes;  // limits, error_code, scene

// `unreadable`: counts states that are no longer, or not yet, what their type says.
Result<std::vector<Moment>> follow_states(BagReader& reader, const RecordedRun& run, const StateLayout& layout,
                                          std::uint64_t& unreadable) {
  const auto objects_topics = topics_of_type(reader.info(), "jostle_msgs/msg/ObjectStates");
  auto topics = topics_of_type(reader.info(), "jostle_msgs/msg/RobotStatus");
  std::vector<Moment> moments;
  if (topics.empty() || objects_topics.empty()) return moments;
  topics.insert(topics.end(), objects_topics.begin(), objects_topics.end());
  reader.seek(run.begin, topics);
  std::optional<std::vector<perception::ObjectReading>> objects;
  for (;;) {
    auto message_result = reader.next();
    if (!message_result) return message_result.error();
    if (!*message_result || (*message_result)->log_time > run.end) return moments;
    const Message& message = **message_result;
    if (std::ranges::find(objects_topics, message.topic) != objects_topics.end()) {
      auto states_result = wire::from_cdr_or_earlier<ObjectStates>(message.data, kSceneBytes, [](ObjectStates&) {});
      if (!states_result) {
        ++unreadable;
        continue;
      }
      auto readings_result = world::from_message(*states_result);
      if (!readings_result) return readings_result.error();
      objects = std::move(readings_result).value();
      continue;
    }
    auto status_result = wire::from_cdr_or_earlier<RobotStatus>(message.data, kStatusBytes, [](RobotStatus&) {});
    if (!status_result) {
      ++unreadable;
      continue;
    }
    auto reading_result = world::from_message(*status_result);
    if (!reading_result) return reading_result.error();
    if (!objects) continue;  // a world sends its objects before its robot's status
    auto state_result = planners::assemble_state(layout, *reading_result, *objects);
    if (!state_result) return state_result.error();
    moments.push_back({world::seconds(status_result->header()), message.log_time, std::move(state_result).value()});
  }
}

Result<std::vector<Moment>> follow_observations(const RecordedRun& run, const StateLayout& layout) {
  std::vector<Moment> moments;
  for (std::size_t i = 0; i < run.observations.size(); ++i) {
    auto seen_result = world::from_message(run.observations[i]);
    if (!seen_result) return seen_result.error();
    auto state_result = planners::assemble_state(layout, seen_result->robot, seen_result->objects);
    if (!state_result) return state_result.error();
    moments.push_back({world::seconds(run.observations[i].header()), run.observed[i], std::move(state_result).value()});
  }
  return moments;
}

// The last action and plan that a world time has seen.
void count_decisions(const RecordedRun& run, double world, RecordedMotion::Sample& sample) {
  for (const auto& seen : run.observations) {
    if (seen.number() > 0 && world::seconds(seen.header()) - seen.duration() < world)
      sample.action = static_cast<int>(seen.number());
  }
  for (const auto& plan : run.plans) {
    if (world::seconds(plan.header()) <= world) sample.plan = static_cast<int>(plan.number());
  }
}

State between(const StateLayout& layout, const State& a, const State& b, double share) {
  State x{.q = a.q};
  for (std::size_t i = 0; i < x.q.size(); ++i) x.q[i] += share * (b.q[i] - a.q[i]);
  for (const ObjectSlot& object : layout.objects) {
    const auto w = static_cast<std::size_t>(object.q) + 3;
    const Eigen::Quaterniond from(a.q[w], a.q[w + 1], a.q[w + 2], a.q[w + 3]),
        to(b.q[w], b.q[w + 1], b.q[w + 2], b.q[w + 3]);
    const Eigen::Quaterniond turned = from.slerp(share, to);
    x.q[w] = turned.w(), x.q[w + 1] = turned.x(), x.q[w + 2] = turned.y(), x.q[w + 3] = turned.z();
  }
  return x;
}

}  // namespace

Result<RecordedMotion> RecordedMotion::read(BagReader& reader, const RecordedRun& run, const StateLayout& layout,
                                            RunClock clock) {
  std::uint64_t unreadable = 0;
  auto moments_result = follow_states(reader, run, layout, unreadable);
  if (moments_result && moments_result->empty()) moments_result = follow_observations(run, layout);
  if (!moments_result) {
    return Error{moments_result.error().code,
                 fmt::format("{}: {}", reader.info().path.string(), moments_result.error().message)};
  }
  const Moment first = moments_result->front();
  std::vector<Sample> samples;
  for (Moment& moment : *moments_result) {
    const double time =
        clock == RunClock::kWorld ? moment.world - first.world : 1e-9 * static_cast<double>(moment.wall - first.wall);
    if (!samples.empty() && time < samples.back().time) continue;  // of a world before
    Sample sample{.time = time, .state = {.q = std::move(moment.state.q)}};
    count_decisions(run, moment.world, sample);
    if (!samples.empty() && time == samples.back().time)
      samples.back() = std::move(sample);
    else
      samples.push_back(std::move(sample));
  }
  return RecordedMotion(std::move(samples), layout, first.world, unreadable);
}

RecordedMotion::Sample RecordedMotion::at(double time) const {
  const auto after = std::ranges::upper_bound(samples_, time, {}, &Sample::time);
  if (after == samples_.begin()) return samples_.front();
  const Sample& before = *(after - 1);
  if (after == samples_.end()) return before;
  Sample sample{.time = time, .action = before.action, .plan = before.plan};
  sample.state = between(layout_, before.state, after->state, (time - before.time) / (after->time - before.time));
  return sample;
}

}  // namespace jostle::bags
