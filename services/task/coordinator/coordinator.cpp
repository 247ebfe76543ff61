#include "services/task/coordinator/coordinator.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "services/common/charts/statistics.hpp"
#include "services/common/process/program.hpp"
#include "services/common/process/trouble.hpp"
#include "services/common/results/results.hpp"
#include "services/task/coordinator/goal_texts.hpp"
#include "services/task/coordinator/markers.hpp"
#include "services/task/session/phases.hpp"
#include "services/wire/limits.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::task {

namespace limits = wire::limits;

namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kFeedbackPeriod{100};
constexpr std::size_t kGoalQueue = 8;
constexpr std::chrono::milliseconds kLastWords{300};  // for readers to receive what was written
constexpr std::chrono::seconds kAnswerPatience{2};    // for the middleware to take a result
constexpr std::chrono::milliseconds kAnswerPause{50};

// What one worker did.
struct Share {
  std::string label;  // as a report shows it
  std::uint64_t rollouts = 0;
};
using Shares = std::map<std::uint64_t, Share>;  // by worker

// Names may be given twice; then host and process tell the workers apart.
Shares shares_of(const physics_pool::PoolStatus& pool) {
  std::map<std::string, int> names;
  for (const physics_pool::WorkerStatus& worker : pool.workers) ++names[worker.name];
  Shares shares;
  for (const physics_pool::WorkerStatus& worker : pool.workers) {
    const bool unique = names[worker.name] == 1;
    shares[worker.id] = {unique ? worker.name : fmt::format("{} ({}:{})", worker.name, worker.host, worker.pid),
                         worker.rollouts};
  }
  return shares;
}

std::uint8_t on_the_wire(planners::Ending ending) { return static_cast<std::uint8_t>(ending); }

namespace endings = jostle_msgs::msg::GoalResult_Constants;
using planners::Ending;
static_assert(endings::UNKNOWN == static_cast<int>(Ending::kUnknown) &&
              endings::SUCCEEDED == static_cast<int>(Ending::kSucceeded) &&
              endings::FAILED == static_cast<int>(Ending::kFailed) &&
              endings::TIMED_OUT == static_cast<int>(Ending::kTimedOut) &&
              endings::CANCELLED == static_cast<int>(Ending::kCancelled) &&
              endings::BROKEN == static_cast<int>(Ending::kBroken) &&
              endings::REFUSED == static_cast<int>(Ending::kRefused) &&
              endings::INVALID == static_cast<int>(Ending::kInvalid));

// What they did meanwhile; without those that did nothing.
Shares since(const Shares& before, Shares now) {
  for (auto& [id, share] : now) {
    const auto found = before.find(id);
    if (found != before.end()) share.rollouts -= std::min(share.rollouts, found->second.rollouts);
  }
  std::erase_if(now, [](const auto& entry) { return entry.second.rollouts == 0; });
  return now;
}

// Which of so many rollouts each of them did, in proportion: workers count what they are given, slices of rollouts too,
// and also what nobody waited for in the end. Largest remainders go first, so that the sum is right.
std::map<std::string, std::uint64_t> apportion(const Shares& shares, std::uint64_t rollouts) {
  std::uint64_t sum = 0, given = 0;
  for (const auto& [id, share] : shares) sum += share.rollouts;
  std::map<std::string, std::uint64_t> result;
  if (sum == 0) return result;
  std::vector<std::pair<std::uint64_t, std::string>> remainders;
  for (const auto& [id, share] : shares) {
    const std::uint64_t product = rollouts * share.rollouts;
    result[share.label] += product / sum;
    given += product / sum;
    remainders.emplace_back(product % sum, share.label);
  }
  std::ranges::sort(remainders, std::greater());
  for (const auto& [remainder, label] : remainders) {
    if (given++ >= rollouts) break;
    ++result[label];
  }
  return result;
}

std::string shown(const std::string& text) { return common::shown(text, limits::kShown); }

// For what a bag of the run cannot do without. The task itself goes on: a robot does not stop because
// a recording has a gap.
template <class T>
void tell(wire::Writer<T>& writer, const T& message, const std::string& what) {
  if (!writer.write(message)) {
    spdlog::warn("{} is lost: the middleware did not take it; a recording of this run cannot be replayed", what);
  }
}

// What the robot stood still, s: before each action, and over all but the first, which waits for the first plan.
nlohmann::json idle_of(const planners::Outcome& outcome) {
  const std::vector<double> between = planners::idle_between(outcome);
  return {{"seconds", outcome.idle},
          {"median", common::number_or_null(common::median(between))},
          {"p90", common::number_or_null(common::quantile(between, 0.9))}};
}

nlohmann::json rows(const ControlSequence& controls) {
  nlohmann::json rows = nlohmann::json::array();
  for (int t = 0; t < controls.steps(); ++t) rows.push_back(controls.step(t));
  return rows;
}

// What the asker puts into result.json and draws; docs/results.md says what each key is. `seen`: as told to the
// journal, entry i being what outcome.observed[i] was made of. `world`: Link::scene().
std::string report_of(const planners::Outcome& outcome, const Task& task, std::uint64_t seed, const Shares& used,
                      const std::vector<jostle_msgs::msg::Observation>& seen, const std::string& world) {
  const planners::Plan& plan = outcome.first_plan;
  const bool has_plan = plan.controls.steps() > 0;
  nlohmann::json report{{"success", outcome.success},
                        {"ending", to_string(outcome.ending)},
                        {"reason", outcome.reason},
                        {"scene_hash", to_string(physics_pool::scene_hash(task.execution_scene()))},
                        {"world_scene_hash", world.empty() ? nlohmann::json() : nlohmann::json(world)},
                        {"seed", seed},
                        {"plan_hash", has_plan ? nlohmann::json(to_string(hash_of(plan.controls.values))) : nullptr},
                        {"cost", has_plan ? nlohmann::json(plan.cost) : nullptr},
                        {"iterations", plan.iterations},
                        {"replans", outcome.replans},
                        {"actions", outcome.actions},
                        {"plan_seconds", has_plan ? nlohmann::json(outcome.plan_time.count()) : nullptr},
                        {"planning_seconds", outcome.planning_time.count()},
                        {"total_seconds", outcome.total_time.count()},
                        {"rollouts", outcome.rollouts},
                        {"abandoned_rollouts", outcome.abandoned_rollouts},
                        {"plans_while_acting", outcome.plans_ahead},
                        {"taken_while_acting", outcome.taken_ahead},
                        {"idle", idle_of(outcome)},
                        {"used_workers", apportion(used, outcome.rollouts)},
                        {"dropped_objects", outcome.dropped},
                        {"step_duration", task.parameters().planner.step_duration},
                        {"plan_controls", rows(plan.controls)}};
  for (const char* key : {"plan_states", "observed_states", "observed_velocities", "observed_times", "controls"}) {
    report[key] = nlohmann::json::array();
  }
  for (const State& x : plan.states) report["plan_states"].push_back(x.q);
  for (const State& x : outcome.observed) {
    report["observed_states"].push_back(x.q);
    report["observed_velocities"].push_back(x.v);
  }
  for (const jostle_msgs::msg::Observation& observation : seen) {
    report["observed_times"].push_back(world::seconds(observation.header()));
    if (!observation.command().empty()) report["controls"].push_back(observation.command());
  }
  return report.dump();
}

}  // namespace

Coordinator::Coordinator(const wire::Participant& participant, physics_pool::AsyncPool& pool, TroubleBoard& troubles)
    : participant_(participant),
      pool_(pool),
      troubles_(troubles),
      feedback_writer_(participant, wire::topics::kTaskFeedback),
      result_writer_(participant, wire::topics::kTaskResult),
      run_writer_(participant, wire::topics::kTaskRun),
      observation_writer_(participant, wire::topics::kTaskObservation),
      plan_writer_(participant, wire::topics::kTaskPlan),
      scene_marker_writer_(participant, wire::topics::kSceneMarkers),
      plan_marker_writer_(participant, wire::topics::kPlanMarkers),
      goal_writer_(participant, wire::topics::kTaskGoal),
      goals_(participant, wire::topics::kTaskGoal, kGoalQueue),
      cancels_(participant, wire::topics::kTaskCancel,
               [this](const jostle_msgs::msg::Cancel& told) { cancel(told.goal_id()); }),
      actions_(participant, work()) {
  feedback_.phase("idle");
}

ActionServer::Work Coordinator::work() {
  return {.is_free =
              [this] {
                const std::lock_guard lock(mutex_);
                return goal_id_.empty();
              },
          // As anybody's: it comes back to goals_, and recorders have it.
          .begin = [this](const Goal& goal) { return goal_writer_.write(goal); },
          .cancel = [this](const std::string& goal_id) { cancel(goal_id); }};
}

void Coordinator::cancel(const std::string& goal_id) {
  const std::lock_guard lock(mutex_);
  if (!goal_id_.empty() && goal_id == goal_id_) cancel_.request_stop();
}

void Coordinator::run(std::stop_token stop) {
  const std::jthread ticker([this](std::stop_token own) { publish_feedback(own); });
  while (!stop.stop_requested()) {
    const auto letter = goals_.take_letter(steady_clock::now() + std::chrono::seconds(1), stop);
    if (letter && !stop.stop_requested()) serve(letter->sample, letter->writer == participant_.id(), stop);
  }
  // What a reader has not yet received would be lost with this process: a recorder's bag would have no end.
  const auto deadline = steady_clock::now() + kLastWords;
  observation_writer_.wait_until_received(deadline);
  plan_writer_.wait_until_received(deadline);
  result_writer_.wait_until_received(deadline);
}

void Coordinator::serve(const Goal& goal, bool is_action, std::stop_token stop) {
  std::stop_token cancelled;
  {
    const std::lock_guard lock(mutex_);
    goal_id_ = goal.goal_id();
    cancel_ = {};
    cancelled = cancel_.get_token();
    started_ = steady_clock::now();
    rollouts_before_ = 0;
    feedback_ = {};
    feedback_.goal_id(goal_id_);
    feedback_.phase("preparing");
    // Parareal gives workers slices of rollouts.
    feedback_.unit(goal.predictor().starts_with("parareal") ? "slices" : "rollouts");
  }
  troubles_.post("");
  const std::string id = shown(goal.goal_id());
  spdlog::info("goal {}: controller {}, predictor {}, seed {}", id, shown(goal.controller()), shown(goal.predictor()),
               goal.seed());
  // A stop of the process cancels the task.
  const std::stop_callback forward(stop, [this] {
    const std::lock_guard lock(mutex_);
    cancel_.request_stop();
  });
  jostle_msgs::msg::GoalResult result;
  result.goal_id(goal.goal_id());
  const Shares before = shares_of(pool_.status());
  std::jthread refuser([this](std::stop_token own) { refuse_goals_meanwhile(own); });
  auto ok = check_sizes(goal);
  auto task_result = ok ? Task::prepare(goal, pool_, [](const std::string& why) { spdlog::info("split: {}", why); })
                        : Result<Task>(ok.error());
  // These and the task end after the answer: taking endpoints and worlds down takes its time, and somebody waits.
  std::optional<Link> link;
  Performance done;
  if (task_result) {
    const Hash scene = scene_hash(task_result->execution_scene());
    done.ended = is_action ? check_world(link.emplace(participant_), scene, cancelled) : Result<void>();
    if (done.ended) done = perform(goal, *task_result, link ? *link : link.emplace(participant_), cancelled);
  } else {
    done.ended = task_result.error();
  }
  if (done.outcome) {
    result.ending(on_the_wire(done.outcome->ending));
    result.success(done.outcome->success);
    result.reason(done.outcome->reason);
    result.report(report_of(*done.outcome, *task_result, goal.seed(), since(before, shares_of(pool_.status())),
                            done.seen, link->scene()));
  }
  if (!done.ended) {
    const Error& error = done.ended.error();
    const bool is_bad = task_result ? done.seen.empty() && error.code == Code::kUnknownWorld
                                    : common::exit_code_of(error) == common::kExitUsage;
    const Ending ending = error.code == Code::kCancelled ? Ending::kCancelled
                          : is_bad                       ? Ending::kInvalid
                                                         : Ending::kBroken;
    result.ending(on_the_wire(ending));
    result.reason(ending == Ending::kBroken ? "the system failed" : to_string(ending));
    result.error(common::shown(error.message, limits::kShownError));
  }
  refuser = {};  // whoever asks once he has heard the result is served
  spdlog::info("goal {}: {} {}", id, result.reason(), result.error());
  answer(result, stop);
  {
    const std::lock_guard lock(mutex_);
    goal_id_.clear();
    feedback_.goal_id("");
    feedback_.phase("idle");
  }
  actions_.on_result(result);  // now: whoever hears it may send the next goal at once
}

// The asker waits for nothing else, so this is tried more than once.
void Coordinator::answer(const jostle_msgs::msg::GoalResult& result, std::stop_token stop) {
  const auto deadline = steady_clock::now() + kAnswerPatience;
  while (!result_writer_.write(result)) {
    if (steady_clock::now() < deadline && common::pause_until(steady_clock::now() + kAnswerPause, stop)) continue;
    spdlog::error("goal {}: its result is lost: the middleware did not take it within {} s; it was: {} {}",
                  shown(result.goal_id()), kAnswerPatience.count(), result.reason(), result.error());
    return;
  }
}

// Whoever sends an action cannot hear what the world says of itself.
Result<void> Coordinator::check_world(Link& link, const Hash& scene, std::stop_token stop) {
  if (auto reading_result = link.robot.read(std::move(stop)); !reading_result) return reading_result.error();
  return world::check_scene(link.scene(), scene);
}

Coordinator::Performance Coordinator::perform(const Goal& goal, Task& task, Link& link, std::stop_token stop) {
  const physics_pool::TaskGeometry& geometry = task.geometry();
  const std::string goal_text = fmt::format("goal {}: ", shown(goal.goal_id()));
  tell(run_writer_, describe_run(goal), goal_text + "its beginning");
  // Whoever misses markers sees less, and nothing is decided by them.
  (void)scene_marker_writer_.write(scene_markers(task.execution_scene()));
  (void)plan_marker_writer_.write(no_markers());
  Performance performance;
  const Task::Watch watch{
      .on_event =
          [&](const planners::ControlEvent& event) {
            note(event, geometry);
            if (event.phase == planners::Phase::kDone) performance.outcome = event.outcome;
          },
      .on_progress = [&](const planners::Progress& progress) { note(progress, geometry); },
      .journal = {.on_observation =
                      [&](const jostle_msgs::msg::Observation& news) {
                        tell(observation_writer_, news, fmt::format("{}observation {}", goal_text, news.number()));
                        {
                          const std::lock_guard lock(mutex_);
                          world_time_ = world::seconds(news.header());
                        }
                        performance.seen.push_back(news);
                        if (news.number() > 0) return;
                        if (auto ok = world::check_scene(link.scene(), scene_hash(task.execution_scene())); !ok)
                          spdlog::warn("{}{}", goal_text, ok.error().message);
                      },
                  .on_plan =
                      [&](const jostle_msgs::msg::Plan& plan) {
                        tell(plan_writer_, plan, fmt::format("{}plan {}", goal_text, plan.number()));
                        (void)plan_marker_writer_.write(plan_markers(geometry, plan));
                      }},
      .time = [&] { return link.robot.time(); }};
  if (auto ended = task.perform(link.robot, link.objects, watch, std::move(stop)); !ended)
    performance.ended = ended.error();
  return performance;
}

void Coordinator::refuse_goals_meanwhile(std::stop_token stop) {
  while (!stop.stop_requested()) {
    auto goal = goals_.take(steady_clock::now() + std::chrono::seconds(1), stop);
    if (!goal) continue;
    jostle_msgs::msg::GoalResult refusal;
    refusal.goal_id(goal->goal_id());
    refusal.ending(on_the_wire(planners::Ending::kRefused));
    refusal.reason("refused");
    {
      const std::lock_guard lock(mutex_);
      refusal.error(fmt::format("coordinator: busy with goal {}; cancel it or wait", shown(goal_id_)));
    }
    answer(refusal, stop);
    actions_.on_result(refusal);
  }
}

void Coordinator::note(const planners::ControlEvent& event, const physics_pool::TaskGeometry& geometry) {
  const std::lock_guard lock(mutex_);
  feedback_.phase(word(event.phase));
  feedback_.actions(event.outcome.actions);
  feedback_.replans(event.outcome.replans);
  if (event.plan && event.plan->chosen >= 0) {
    feedback_.speed(event.plan->choices[static_cast<std::size_t>(event.plan->chosen)].speed);
  }
  feedback_.segments(planners::to_text(event.outcome.segments, event.outcome.segment));
  rollouts_before_ = event.outcome.rollouts + event.outcome.abandoned_rollouts;
  if (!event.outcome.idle.empty()) feedback_.idle(event.outcome.idle.back());
  if (event.observed && !event.observed->q.empty()) {
    feedback_.target_distance(geometry.kind->distance(geometry, *event.observed));
  }
}

void Coordinator::note(const planners::Progress& progress, const physics_pool::TaskGeometry& geometry) {
  const std::lock_guard lock(mutex_);
  feedback_.iteration(progress.iteration);
  feedback_.cost(progress.cost);
  feedback_.rollouts(rollouts_before_ + progress.rollouts);
  if (progress.final_state) {
    feedback_.target_distance(geometry.kind->distance(geometry, *progress.final_state));
  }
}

void Coordinator::publish_feedback(std::stop_token stop) {
  do {
    const physics_pool::PoolStatus pool = pool_.status();
    jostle_msgs::msg::Feedback feedback;
    {
      const std::lock_guard lock(mutex_);
      feedback = feedback_;
      feedback.header(world::make_header(world_time_, ""));
      if (!goal_id_.empty()) {
        feedback.elapsed(std::chrono::duration<double>(steady_clock::now() - started_).count());
      }
    }
    feedback.trouble(troubles_.text());
    for (const physics_pool::WorkerStatus& worker : pool.workers) {
      jostle_msgs::msg::WorkerReport report;
      report.name(worker.name);
      report.alive(worker.alive);
      report.capacity(worker.capacity);
      report.rollouts(worker.rollouts);
      report.engine_steps(worker.engine_steps);
      report.id(worker.id);
      report.host(worker.host);
      report.pid(worker.pid);
      feedback.workers().push_back(std::move(report));
    }
    (void)feedback_writer_.write(feedback);  // the next one comes in 100 ms
    if (!feedback.goal_id().empty()) actions_.on_feedback(feedback);
  } while (common::pause_until(steady_clock::now() + kFeedbackPeriod, stop));
}

}  // namespace jostle::task
