#include "services/task/coordinator/action_server.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <tuple>
#include <utility>

#include "services/common/process/trouble.hpp"
#include "services/task/coordinator/goal_texts.hpp"
#include "services/wire/limits.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::task {

namespace status = action_msgs::msg::GoalStatus_Constants;
namespace cancels = action_msgs::srv::CancelGoal_Response_Constants;
namespace endings = jostle_msgs::msg::GoalResult_Constants;

namespace {

constexpr std::size_t kEventsPerParticipant = 16;
constexpr std::size_t kEvents = 8 * kEventsPerParticipant;
constexpr std::size_t kAskersPerGoal = 16;

// The coordinator knows goals by a text.
std::string goal_id_of(const std::array<std::uint8_t, 16>& uuid) {
  return fmt::format("action-{:02x}", fmt::join(uuid, ""));
}

builtin_interfaces::msg::Time now() {
  const std::chrono::duration<double> since = std::chrono::system_clock::now().time_since_epoch();
  return world::make_header(since.count(), "").stamp();
}

bool is_over(std::int8_t code) { return code >= status::STATUS_SUCCEEDED; }

std::int8_t status_of(std::uint8_t ending) {
  if (ending == endings::SUCCEEDED) return status::STATUS_SUCCEEDED;
  return ending == endings::CANCELLED ? status::STATUS_CANCELED : status::STATUS_ABORTED;
}

// An answer that did not go out leaves its asker waiting, as one that is lost on the way does.
template <class Service, class Response>
void answer(Service& service, const wire::Asker& asker, const Response& response, const std::string& what) {
  if (service.answer(asker, response)) return;
  spdlog::warn("{}: an answer is lost: its asker was not reached within {} ms", what, wire::kAskerPatience.count());
}

}  // namespace

struct ActionServer::Action {
  Action(const wire::Participant& participant, ActionServer& server, std::string_view kind_name)
      : kind(kind_name),
        name("/" + kind),
        status_writer(participant, wire::action_status(name)),
        feedback_writer(participant, wire::action_feedback(name)),
        goals(participant, name + "/_action/send_goal",
              [this, &server](auto& request, const wire::Asker& asker) {
                server.post(asker.participant, [this, &server, request = std::move(request), asker]() mutable {
                  server.send_goal(*this, request, asker);
                });
              }),
        results(participant, name + "/_action/get_result",
                [this, &server](auto& request, const wire::Asker& asker) {
                  server.post(asker.participant, [this, &server, uuid = request.goal_id().uuid(), asker] {
                    server.get_result(*this, uuid, asker);
                  });
                }),
        cancelling(participant, name + "/_action/cancel_goal",
                   [this, &server](auto& request, const wire::Asker& asker) {
                     server.post(asker.participant, [this, &server, which = request.goal_info(), asker] {
                       server.cancel_goals(*this, which, asker);
                     });
                   }) {}

  const std::string kind;
  const std::string name;
  wire::Writer<action_msgs::msg::GoalStatusArray> status_writer;
  wire::Writer<jostle_msgs::action::Manipulate_FeedbackMessage> feedback_writer;
  wire::SendGoalService goals;
  wire::GetResultService results;
  wire::CancelGoalService cancelling;
};

ActionServer::ActionServer(const wire::Participant& participant, Work work)
    : participant_(participant), work_(std::move(work)) {
  for (const physics_pool::TaskKind* kind : physics_pool::task_kinds())
    actions_.push_back(std::make_unique<Action>(participant, *this, kind->name));
  thread_ = std::jthread([this](std::stop_token stop) { work_off(std::move(stop)); });
}

ActionServer::~ActionServer() {
  thread_ = {};  // stops before what it uses is gone
}

void ActionServer::post(std::uint64_t participant, std::function<void()> run) {
  {
    const std::lock_guard lock(mutex_);
    const auto of_same = std::ranges::count(events_, participant, &Event::participant);
    if (participant != participant_.id() &&
        (static_cast<std::size_t>(of_same) >= kEventsPerParticipant || events_.size() >= kEvents)) {
      return;  // a flood: who floods has to ask again
    }
    events_.push_back({participant, std::move(run)});
  }
  news_.notify_one();
}

void ActionServer::work_off(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  while (news_.wait(lock, stop, [&] { return !events_.empty(); })) {
    const auto run = std::move(events_.front().run);
    events_.pop_front();
    lock.unlock();
    run();
    lock.lock();
  }
}

void ActionServer::send_goal(Action& action, jostle_msgs::action::Manipulate_SendGoal_Request& request,
                             const wire::Asker& asker) {
  const Uuid& uuid = request.goal_id().uuid();
  const std::string goal_id = goal_id_of(uuid);
  const std::string refusal = find(action, uuid) ? "there was a goal of this id"
                              : unfinished()     ? "busy with " + goal_id_of(unfinished()->uuid)
                              : !work_.is_free() ? "busy with another goal"
                                                 : "";
  jostle_msgs::action::Manipulate_SendGoal_Response response;
  response.accepted(refusal.empty());
  response.stamp(now());
  answer(action.goals, asker, response, action.name);
  if (!refusal.empty()) {
    spdlog::warn("{}: {} is rejected: {}", action.name, goal_id, refusal);
    return;
  }
  const auto finished = std::ranges::count_if(goals_, [](const Held& goal) { return is_over(goal.status); });
  if (static_cast<std::size_t>(finished) >= kFinishedKept) goals_.pop_front();
  Held& goal = goals_.emplace_back(Held{.action = &action, .uuid = uuid, .accepted = response.stamp()});
  set_status(goal, status::STATUS_ACCEPTED);
  auto complete_result = complete(std::move(request.goal().goal()), action.kind);
  if (complete_result) complete_result->goal_id(goal_id);
  if (complete_result && work_.begin(*complete_result)) return;
  jostle_msgs::msg::GoalResult result;
  result.goal_id(goal_id);
  result.ending(endings::REFUSED);
  result.reason("refused");
  result.error(complete_result ? "the middleware did not take the goal; send it again"
                               : common::shown(complete_result.error().message, wire::limits::kShownError));
  finish(goal, result);
}

void ActionServer::get_result(Action& action, const Uuid& uuid, const wire::Asker& asker) {
  Held* goal = find(action, uuid);
  if (goal && !is_over(goal->status)) {
    if (goal->askers.size() >= kAskersPerGoal) goal->askers.pop_front();
    goal->askers.push_back(asker);
    return;
  }
  jostle_msgs::action::Manipulate_GetResult_Response response;
  response.status(goal ? goal->status : std::int8_t{status::STATUS_UNKNOWN});
  if (goal) response.result().result(goal->result);
  answer(action.results, asker, response, action.name);
}

// As rcl does it: an id names one goal; a stamp those that were accepted until then; neither of them, all goals.
void ActionServer::cancel_goals(Action& action, const action_msgs::msg::GoalInfo& which, const wire::Asker& asker) {
  const auto time_of = [](const builtin_interfaces::msg::Time& time) { return std::tuple(time.sec(), time.nanosec()); };
  const Uuid& uuid = which.goal_id().uuid();
  const bool names_one = uuid != Uuid{};
  const bool has_time = time_of(which.stamp()) != std::tuple(0, 0u);
  action_msgs::srv::CancelGoal_Response response;
  response.return_code(cancels::ERROR_NONE);
  std::vector<std::string> cancelled;
  for (Held& goal : goals_) {
    if (goal.action != &action || is_over(goal.status)) continue;
    const bool is_meant = goal.uuid == uuid || (has_time && time_of(goal.accepted) <= time_of(which.stamp())) ||
                          (!names_one && !has_time);
    if (!is_meant) continue;
    set_status(goal, status::STATUS_CANCELING);
    action_msgs::msg::GoalInfo info;
    info.goal_id().uuid(goal.uuid);
    info.stamp(goal.accepted);
    response.goals_canceling().push_back(std::move(info));
    cancelled.push_back(goal_id_of(goal.uuid));
  }
  if (cancelled.empty() && names_one) {
    response.return_code(find(action, uuid) ? cancels::ERROR_GOAL_TERMINATED : cancels::ERROR_UNKNOWN_GOAL_ID);
  }
  answer(action.cancelling, asker, response, action.name);
  for (const std::string& goal_id : cancelled) work_.cancel(goal_id);
}

void ActionServer::on_feedback(const jostle_msgs::msg::Feedback& feedback) {
  post(participant_.id(), [this, feedback] {
    Held* goal = unfinished();
    if (!goal || goal_id_of(goal->uuid) != feedback.goal_id()) return;
    if (goal->status == status::STATUS_ACCEPTED) set_status(*goal, status::STATUS_EXECUTING);
    // A cancel may have come before the goal was taken up.
    if (goal->status == status::STATUS_CANCELING) work_.cancel(feedback.goal_id());
    jostle_msgs::action::Manipulate_FeedbackMessage message;
    message.goal_id().uuid(goal->uuid);
    message.feedback().feedback(feedback);
    (void)goal->action->feedback_writer.write(message);  // the next one comes in 100 ms
  });
}

void ActionServer::on_result(const jostle_msgs::msg::GoalResult& result) {
  post(participant_.id(), [this, result] {
    Held* goal = unfinished();
    if (goal && goal_id_of(goal->uuid) == result.goal_id()) finish(*goal, result);
  });
}

void ActionServer::finish(Held& goal, const jostle_msgs::msg::GoalResult& result) {
  goal.result = result;
  set_status(goal, status_of(result.ending()));
  for (const wire::Asker& asker : std::exchange(goal.askers, {})) get_result(*goal.action, goal.uuid, asker);
}

void ActionServer::set_status(Held& goal, std::int8_t code) {
  goal.status = code;
  action_msgs::msg::GoalStatusArray array;
  for (const Held& held : goals_) {
    if (held.action != goal.action) continue;
    action_msgs::msg::GoalStatus entry;
    entry.goal_info().goal_id().uuid(held.uuid);
    entry.goal_info().stamp(held.accepted);
    entry.status(held.status);
    array.status_list().push_back(std::move(entry));
  }
  // Whoever misses it hears the next one, or gets the result.
  (void)goal.action->status_writer.write(array);
}

ActionServer::Held* ActionServer::find(const Action& action, const Uuid& uuid) {
  const auto goal =
      std::ranges::find_if(goals_, [&](const Held& held) { return held.action == &action && held.uuid == uuid; });
  return goal == goals_.end() ? nullptr : &*goal;
}

ActionServer::Held* ActionServer::unfinished() {
  const auto goal = std::ranges::find_if(goals_, [](const Held& held) { return !is_over(held.status); });
  return goal == goals_.end() ? nullptr : &*goal;
}

}  // namespace jostle::task
