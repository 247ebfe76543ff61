#include "services/task/run/session.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"

namespace jostle::task {
namespace {

constexpr std::chrono::milliseconds kSilence{1500};  // of a process that speaks ten times a second: worth a word
constexpr std::chrono::seconds kLongSilence{10};     // it does not come back
constexpr std::chrono::seconds kStart{15};           // for processes to start and find each other
constexpr std::chrono::milliseconds kTick{50};
constexpr std::chrono::seconds kCancelPatience{2};
constexpr std::chrono::milliseconds kLately{500};  // a coordinator speaks ten times a second
constexpr std::chrono::seconds kLeaving{2};        // for one whose run was killed just now
constexpr std::chrono::seconds kLastWords{2};      // for the recorder to hear of the result, and end
constexpr int kMostRestarts = 5;                   // within kRestartWindow: something is wrong
constexpr std::chrono::seconds kRestartWindow{10};

std::filesystem::path program(const char* name) { return common::program_folder() / (std::string("jostle_") + name); }

}  // namespace

Result<std::unique_ptr<Session>> Session::start(const RunOptions& options, Watcher watcher) {
  auto participant_result =
      wire::Participant::open({.name = "jostle_run", .domain = options.domain, .role = wire::Role::kRobot});
  if (!participant_result) return participant_result.error();
  // Two that start at once would each hear the other's processes and take them for their own.
  auto claim_result = common::DomainClaim::take("run", participant_result->domain(), std::chrono::seconds(1),
                                                participant_result->space());
  if (!claim_result) return claim_result.error();
  auto folder_result = common::make_temporary_folder("run");
  if (!folder_result) return folder_result.error();
  std::unique_ptr<Session> session(
      new Session(options, std::move(watcher), *participant_result, std::move(claim_result).value(), *folder_result));
  if (auto ok = session->start_recorder(); !ok) return ok.error();
  if (auto ok = session->start_viewer(); !ok) return ok.error();
  if (auto ok = session->start_processes(); !ok) return ok.error();
  return session;
}

Session::Session(const RunOptions& options, Watcher watcher, wire::Participant participant, common::DomainClaim claim,
                 std::filesystem::path folder)
    : options_(options),
      watcher_(std::move(watcher)),
      participant_(std::move(participant)),
      claim_(std::move(claim)),
      folder_(std::move(folder)),
      client_(participant_, folder_.filename().string(),
              {.on_feedback = watcher_.on_feedback, .on_notice = watcher_.on_notice}),
      witness_(participant_, !options.record.empty()) {}

Session::~Session() {
  // All at once, then one after the other: shutting down takes as long as the slowest.
  for (common::ChildProcess& worker : workers_) worker.terminate();
  for (WorldProcess& one : world_) one.process.terminate();
  if (coordinator_process_) coordinator_process_->terminate();
  if (recorder_process_) recorder_process_->terminate();
  if (viewer_process_) viewer_process_->terminate();
  workers_.clear();
  world_.clear();
  coordinator_process_.reset();
  (void)finish_recording();  // a run that failed has said worse
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

// Before everything else, so that it hears everything else.
Result<void> Session::start_recorder() {
  if (options_.record.empty()) return {};
  auto process_result = start_ready(
      "record", {"--output", options_.record.string(), "--until-result", "--json", (folder_ / "record.json").string()},
      "the recorder");
  if (!process_result) return process_result.error();
  recorder_process_ = std::move(process_result).value();
  return {};
}

Result<void> Session::start_viewer() {
  if (!options_.view) return {};
  auto process_result = start_ready("view", {"--port", std::to_string(*options_.view)}, "the viewers' server");
  if (!process_result) return process_result.error();
  viewer_process_ = std::move(process_result).value();
  const std::string line = viewer_process_->last_line();
  notice("shown at " + line.substr(std::min(line.size(), line.find("http:"))));
  return {};
}

Result<common::ChildProcess> Session::start_ready(const std::string& program_name, std::vector<std::string> arguments,
                                                  const std::string& title) {
  arguments.insert(arguments.end(),
                   {"--domain", std::to_string(participant_.domain()), "--die-with-parent", std::to_string(getpid())});
  auto process_result =
      common::ChildProcess::start(program(program_name.c_str()), arguments, folder_ / (program_name + ".log"));
  if (!process_result) return process_result.error();
  const auto deadline = Clock::now() + kStart;
  while (!process_result->has_said("ready")) {
    const auto ended = process_result->wait_for(kTick);
    if (!ended && Clock::now() < deadline) continue;
    const bool refused = ended && ended->code == common::kExitUsage;
    return Error{
        refused ? Code::kInvalidArgument : Code::kUnavailable,
        fmt::format("{} {}:\n{}", title, ended ? "did not start" : "is not ready", process_result->last_words())};
  }
  return process_result;
}

Result<void> Session::finish_recording() {
  if (!recorder_process_) return {};
  if (!recorder_process_->wait_for(kLastWords)) recorder_process_->terminate();
  recorder_process_->wait_for(kStart);
  auto ok = check_recording();
  look_after_recorder();
  return ok;
}

// What we heard ourselves must be in the bag: a recorder that did not run for a while does not know what it missed.
Result<void> Session::check_recording() const {
  const auto text_result = common::read_text(folder_ / "record.json");
  const auto report = nlohmann::json::parse(text_result ? *text_result : "", nullptr, false);
  if (report.is_discarded()) {
    const std::string bag = options_.record.string();
    return Error{
        Code::kIo,
        fmt::format("the recording {} is not complete: its recorder did not end in an orderly way; `jostle bag "
                    "recover {}` keeps what it has",
                    bag, bag)};
  }
  std::vector<std::string> gaps;
  for (const auto& [topic, heard] : witness_.counts()) {
    const std::uint64_t recorded = report["messages"].value(topic, std::uint64_t{0});
    const std::uint64_t lost = report["lost"].value(topic, std::uint64_t{0});
    if (recorded < heard) gaps.push_back(fmt::format("{} of {} messages of {}", heard - recorded, heard, topic));
    if (recorded >= heard && lost > 0) gaps.push_back(fmt::format("{} messages of {}", lost, topic));
  }
  if (gaps.empty()) return {};
  return Error{Code::kIo,
               fmt::format("the recording {} is not complete: {} {} missing, for the recorder did not run or was cut "
                           "off for a while; it cannot be replayed as a whole",
                           options_.record.string(), fmt::join(gaps, ", "), gaps.size() == 1 ? "is" : "are")};
}

void Session::notice(const std::string& text) const {
  if (watcher_.on_notice) watcher_.on_notice(text);
}

void Session::look_after_recorder() {
  if (!recorder_process_) return;
  const auto ended = recorder_process_->ended();
  if (!ended || recorder_missed_) return;
  recorder_missed_ = true;
  if (!ended->ok()) {
    notice(fmt::format("the recorder ended: {}\n{}", ended->text(), recorder_process_->last_words()));
  }
}

Result<void> Session::start_processes() {
  const std::string domain = std::to_string(participant_.domain());
  const auto scene_file = folder_ / "scene.yaml";
  if (auto ok = common::write_text(scene_file, physics_pool::to_yaml(options_.scene)); !ok) return ok;

  const auto belief_file = folder_ / "belief.yaml";
  if (auto ok = common::write_text(belief_file, physics_pool::to_yaml(options_.planning)); !ok) return ok;

  for (Part& part : parts_of_world(options_, scene_file, belief_file, participant_.domain())) {
    auto process_result =
        common::ChildProcess::start(program(part.program.c_str()), part.arguments, folder_ / (part.program + ".log"));
    if (!process_result) return process_result.error();
    world_.push_back({std::move(part.title), std::move(process_result).value()});
  }
  robot_.name = world_.back().title;

  std::vector<std::string> arguments{"--pool", options_.pool,       "--domain",
                                     domain,   "--die-with-parent", std::to_string(getpid())};
  if (options_.pool == "threads") {
    arguments.insert(arguments.end(), {"--threads", std::to_string(options_.workers)});
  }
  auto coordinator_result = common::ChildProcess::start(program("coordinator"), arguments, folder_ / "coordinator.log");
  if (!coordinator_result) return coordinator_result.error();
  coordinator_process_ = std::move(coordinator_result).value();

  for (int i = 0; options_.pool == "dds" && i < options_.workers; ++i) {
    auto worker_result = start_worker(static_cast<std::size_t>(i));
    if (!worker_result) return worker_result.error();
    workers_.push_back(std::move(worker_result).value());
  }
  goal_patience_ = patience(options_.arm);
  goal_deadline_ = Clock::now() + goal_patience_;
  return {};
}

Result<common::ChildProcess> Session::start_worker(std::size_t place) {
  const std::string name = fmt::format("worker-{}", workers_started_++);  // of its log; it calls itself by host and pid
  std::vector<std::string> arguments{"--domain", std::to_string(participant_.domain()), "--die-with-parent",
                                     std::to_string(getpid())};
  if (const auto& cores = options_.cores; !cores.empty()) {
    arguments.insert(arguments.end(), {"--pin", std::to_string(cores[place % cores.size()])});
  }
  return common::ChildProcess::start(program("worker"), arguments, folder_ / (name + ".log"));
}

Result<jostle_msgs::msg::GoalResult> Session::perform(std::stop_token stop) {
  for (;;) {
    if (auto result = client_.wait(Clock::now() + kTick, stop)) return *std::move(result);
    if (stop.stop_requested()) return give_up({Code::kCancelled, "interrupted"});
    client_.listen();
    if (auto ok = look_after(); !ok) return give_up(ok.error());
    if (client_.is_sent()) continue;
    if (auto ok = send_goal(); !ok) return ok.error();
  }
}

// The coordinator knows what has come of the run so far.
Result<jostle_msgs::msg::GoalResult> Session::give_up(const Error& why) {
  if (!client_.is_sent() || coordinator_process_->ended()) return why;
  client_.cancel();  // if it is lost, the coordinator is ended after kCancelPatience
  const auto deadline = Clock::now() + kCancelPatience;
  while (Clock::now() < deadline) {
    auto result = client_.wait(Clock::now() + kTick, {});
    if (!result) continue;
    if (why.code == Code::kCancelled) return *std::move(result);
    result->success(false);
    result->ending(jostle_msgs::msg::GoalResult_Constants::BROKEN);
    result->reason("the system failed");
    result->error(why.message);
    return *std::move(result);
  }
  return why;
}

// The goal goes out once everybody who has a part in it was heard and hears us.
Result<void> Session::send_goal() {
  const std::vector<std::uint64_t> found = client_.coordinators();
  const auto now = Clock::now();
  if (found.size() > 1 || now - client_.others_heard().value_or(Clock::time_point{}) < kLately) {
    crowded_since_ = crowded_since_.value_or(now);
    if (now - *crowded_since_ < kLeaving) return {};
    return Error{Code::kUnavailable,
                 fmt::format("domain {}: got another coordinator beside ours, wanted none; another run or a `jostle "
                             "play` uses this domain: set ROS_DOMAIN_ID to a free one, or --namespace to one of its "
                             "own; `jostle goal` gives a goal to a coordinator that runs",
                             participant_.domain())};
  }
  crowded_since_.reset();
  // Another one may be found before ours is there: it says its number when it starts.
  const bool ours = found.size() == 1 && coordinator_process_->has_said(common::participant_name(found.front()));
  const bool answers = ours && client_.reaches(found.front());
  if (!answers || !client_.world_heard()) {
    tell_of_waiting();
    if (Clock::now() < goal_deadline_) return {};
    return Error{Code::kUnavailable,
                 fmt::format("{} not heard within {} s of its start on domain {}; `jostle doctor` checks "
                             "shared memory and multicast{}",
                             answers ? world_.back().title + " was" : "the coordinator was", goal_patience_.count(),
                             participant_.domain(), participant_.possible_cause())};
  }
  if (client_.send(make_goal(options_), found.front()) || Clock::now() < goal_deadline_)
    return {};  // else the next tick
  return Error{Code::kUnavailable,
               fmt::format("the goal could not be sent within {} s: the middleware did not take it; profiles that "
                           "limit {} may be the reason",
                           goal_patience_.count(), wire::topics::kTaskGoal.name)};
}

// An arm that is not there, or not ready, keeps everybody waiting, and its bridge knows why.
void Session::tell_of_waiting() {
  const std::string line = world_.back().process.last_line();
  if (line.find("waiting:") == std::string::npos || line == waiting_) return;
  waiting_ = line;
  notice(line);
}

Result<void> Session::look_after() {
  look_after_recorder();
  for (WorldProcess& one : world_) {
    if (auto ok = check_alive(one.title, one.process); !ok) return ok;
  }
  if (auto ok = check_alive("the coordinator", *coordinator_process_); !ok) return ok;
  look_for(robot_, client_.world_heard());
  look_for(coordinator_, client_.coordinator_heard());
  if (const auto heard = client_.coordinator_heard(); heard && Clock::now() - *heard >= kLongSilence) {
    return Error{
        Code::kUnavailable,
        fmt::format("the coordinator runs but was not heard for {} s: stalled or cut off; `jostle doctor` checks "
                    "the network, and fewer --workers leave it more of a busy machine",
                    kLongSilence.count())};
  }
  if (auto ok = client_.check_at_work(); !ok) {
    return Error{ok.error().code, fmt::format("{}\n{}", ok.error().message, coordinator_process_->last_words())};
  }
  for (common::ChildProcess& worker : workers_) {
    const auto ended = worker.ended();
    if (!ended) continue;
    const auto now = Clock::now();
    std::erase_if(restarts_, [&](Clock::time_point then) { return now - then > kRestartWindow; });
    restarts_.push_back(now);
    if (restarts_.size() > kMostRestarts) {
      return Error{Code::kUnavailable,
                   fmt::format("workers keep ending: {} within {} s, the last one: {}\n{}", restarts_.size(),
                               kRestartWindow.count(), ended->text(), worker.last_words())};
    }
    auto worker_result = start_worker(static_cast<std::size_t>(&worker - workers_.data()));
    if (!worker_result) return worker_result.error();
    if (watcher_.on_notice) {
      watcher_.on_notice(fmt::format("worker {} ended ({}); started another", worker.pid(), ended->text()));
    }
    worker = std::move(worker_result).value();
  }
  return {};
}

Result<void> Session::check_alive(const std::string& name, common::ChildProcess& child) const {
  const auto ended = child.ended();
  if (!ended) return {};
  return Error{Code::kUnavailable, fmt::format("{} ended: {}\n{}", name, ended->text(), child.last_words())};
}

void Session::look_for(Voice& voice, std::optional<Clock::time_point> heard) {
  if (!heard) return;
  const std::chrono::duration<double> silence = Clock::now() - *heard;
  const bool missed = silence >= kSilence;
  if (missed == std::exchange(voice.missed, missed)) return;
  notice(missed ? fmt::format(
                      "{} runs but was not heard for {:.1f} s; the machine may be busy, or it is stalled or cut off",
                      voice.name, silence.count())
                : fmt::format("{} is heard again", voice.name));
}

Witness::Witness(const wire::Participant& participant, bool listens) {
  if (!listens) return;
  follow(runs_, participant, wire::topics::kTaskRun);
  follow(observations_, participant, wire::topics::kTaskObservation);
  follow(plans_, participant, wire::topics::kTaskPlan);
  follow(results_, participant, wire::topics::kTaskResult);
}

template <class T>
void Witness::follow(std::optional<wire::Reader<T>>& reader, const wire::Participant& participant,
                     const wire::Topic<T>& topic) {
  const std::string name = *wire::ros_topic(participant.wire_name(topic.name, topic.scope));
  reader.emplace(participant, topic, [this, name](const T&) {
    const std::lock_guard lock(mutex_);
    ++counts_[name];
  });
}

std::map<std::string, std::uint64_t> Witness::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace jostle::task
