#include "services/task/run/goal_client.hpp"

#include <algorithm>
#include <iterator>

namespace jostle::task {

GoalClient::GoalClient(const wire::Participant& participant, std::string goal_id, OnFeedback on_feedback)
    : goal_id_(std::move(goal_id)),
      on_feedback_(std::move(on_feedback)),
      goal_(participant, wire::topics::kTaskGoal),
      cancel_(participant, wire::topics::kTaskCancel),
      feedback_(participant, wire::topics::kTaskFeedback, 64),
      world_(participant, wire::topics::kRobotStatus, 64),
      results_(participant, wire::topics::kTaskResult, 8) {}

void GoalClient::listen() {
  for (const auto& feedback : feedback_.take_all()) {
    coordinator_heard_ = Clock::now();
    // Ours is idle until it gets our goal; it may be the last one we hear of.
    if (!sent_ && !feedback.goal_id().empty()) others_heard_ = true;
    if (sent_ && feedback.goal_id() == goal_id_ && on_feedback_) on_feedback_(feedback);
  }
  if (!world_.take_all().empty()) world_heard_ = Clock::now();
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

bool GoalClient::send(jostle_msgs::msg::Goal goal) {
  goal.goal_id(goal_id_);
  sent_ = goal_.write(goal);
  return sent_;
}

std::optional<jostle_msgs::msg::GoalResult> GoalClient::wait(Clock::time_point deadline, std::stop_token stop) {
  auto result = results_.take(deadline, std::move(stop));
  if (result && result->goal_id() == goal_id_) return result;
  return {};
}

void GoalClient::cancel() {
  jostle_msgs::msg::Cancel cancel;
  cancel.goal_id(goal_id_);
  (void)cancel_.write(cancel);
}

}  // namespace jostle::task
