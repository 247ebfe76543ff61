#include "services/task/run/goal_client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "services/task/session/phases.hpp"

namespace jostle::task {
GoalClient::GoalClient(const wire::Participant& participant, std::string goal_id, Listener listener)
    : goal_id_(std::move(goal_id)),
      listener_(std::move(listener)),
      goal_(participant, wire::topics::kTaskGoal),
      cancel_(participant, wire::topics::kTaskCancel),
      feedback_(participant, wire::topics::kTaskFeedback, 64),
      world_(participant, wire::topics::kRobotStatus, 64),
      results_(participant, wire::topics::kTaskResult, 8) {}

void GoalClient::listen() {
  for (const auto& [feedback, writer] : feedback_.take_letters()) {
    if (sent_ && writer != coordinator_) continue;
    coordinator_heard_ = Clock::now();
    // Ours is idle until it gets our goal; it may be the last one we hear of.
    if (!sent_ && !feedback.goal_id().empty()) others_heard_ = Clock::now();
    if (!sent_) continue;
    note_work(feedback);
    if (feedback.goal_id() != goal_id_) continue;
    if (listener_.on_feedback) listener_.on_feedback(feedback);
    if (std::exchange(trouble_, feedback.trouble()) == feedback.trouble() || trouble_.empty()) continue;
    if (listener_.on_notice) listener_.on_notice(trouble_);
  }
  const auto statuses = world_.take_all();
  if (statuses.empty()) return;
  world_heard_ = Clock::now();
  world_scene_ = statuses.back().scene();
}

void GoalClient::note_work(const jostle_msgs::msg::Feedback& feedback) {
  const bool is_ours = feedback.goal_id() == goal_id_;
  taken_up_ = taken_up_ || is_ours;
  if (is_ours && feedback.phase() != word(planners::Phase::kDone)) {
    idle_since_.reset();
  } else if (!idle_since_) {
    idle_since_ = Clock::now();
  }
}

Result<void> GoalClient::check_at_work() const {
  if (!idle_since_ || Clock::now() - *idle_since_ < kIdlePatience) return {};
  return Error{
      Code::kUnavailable,
      fmt::format("the coordinator {} {} s ago, and {}; its log may say why, and fewer --workers leave it more "
                  "of a busy machine",
                  taken_up_ ? "was done with the goal" : "was sent the goal", kIdlePatience.count(),
                  taken_up_ ? "its result did not arrive" : "it has not begun with it")};
}

std::vector<std::uint64_t> GoalClient::coordinators() const {
  std::vector<std::uint64_t> both;
  std::ranges::set_intersection(goal_.matched_participants(), feedback_.matched_participants(),
                                std::back_inserter(both));
  return both;
}

bool GoalClient::reaches(std::uint64_t coordinator) const {
  return feedback_.last_writer() == coordinator && results_.hears(coordinator);
}

bool GoalClient::send(jostle_msgs::msg::Goal goal, std::uint64_t coordinator) {
  goal.goal_id(goal_id_);
  coordinator_ = coordinator;
  sent_ = goal_.write(goal);
  return sent_;
}

std::optional<jostle_msgs::msg::GoalResult> GoalClient::wait(Clock::time_point deadline, std::stop_token stop) {
  auto letter = results_.take_letter(deadline, std::move(stop));
  if (!letter || letter->sample.goal_id() != goal_id_ || letter->writer != coordinator_) return {};
  return std::move(letter->sample);
}

void GoalClient::cancel() {
  jostle_msgs::msg::Cancel cancel;
  cancel.goal_id(goal_id_);
  (void)cancel_.write(cancel);
}

}  // namespace jostle::task
