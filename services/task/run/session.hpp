#pragma once
/// \file
/// One run: the processes it starts, the goal it sends, what comes back.

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "services/common/process/child_process.hpp"
#include "services/common/process/domain_claim.hpp"
#include "services/task/run/goal_client.hpp"
#include "services/task/run/options.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::task {

/// Counts what a bag of the run must have, by ROS 2's name of the topic. Threads: any.
class Witness {
 public:
  /// Listens only where `listens`.
  Witness(const wire::Participant& participant, bool listens);
  std::map<std::string, std::uint64_t> counts() const;

 private:
  template <class T>
  void follow(std::optional<wire::Reader<T>>& reader, const wire::Participant& participant,
              const wire::Topic<T>& topic);

  mutable std::mutex mutex_;  // guards counts_
  std::map<std::string, std::uint64_t> counts_;
  std::optional<wire::Reader<jostle_msgs::msg::TaskRun>> runs_;
  std::optional<wire::Reader<jostle_msgs::msg::Observation>> observations_;
  std::optional<wire::Reader<jostle_msgs::msg::Plan>> plans_;
  std::optional<wire::Reader<jostle_msgs::msg::GoalResult>> results_;
};

/// Starts workers, simulated world and coordinator, and looks after them:
///
///   a worker that ends is replaced; its work goes to the others meanwhile
///   a world or coordinator that ends, ends the run with an error that says which, how, and
///   what it printed last
///   one that is silent is news: it may be slow. The coordinator's silence ends the run when it lasts,
///   for its result is waited for; the world's when the coordinator waits for it
///   a recorder that ends early is news, and the run goes on
///   a viewer that ends early is no news to it
///
/// Destroying it ends every process it started and removes its files.
class Session {
 public:
  /// What a watcher hears.
  struct Watcher {
    std::function<void(const jostle_msgs::msg::Feedback&)> on_feedback;
    std::function<void(const std::string&)> on_notice;  ///< e.g. a worker was replaced
  };

  /// Starts everything. After an error (kInvalidArgument, kNotFound, kUnavailable) nothing was started; kUnavailable
  /// also means that another run of this machine has the domain.
  static Result<std::unique_ptr<Session>> start(const RunOptions& options, Watcher watcher);
  ~Session();

  /// Sends the goal and waits for its result. A stop cancels the task, whose result then says so.
  /// Errors   kCancelled    a stop was requested, and no result came of it
  ///          kUnavailable  a part of the system is gone; the message says which
  Result<jostle_msgs::msg::GoalResult> perform(std::stop_token stop);

  /// Waits until the bag, if one was asked for, has the result and is complete. Error kIo: it is not; says what is
  /// missing. For after perform().
  Result<void> finish_recording();

 private:
  using Clock = GoalClient::Clock;

  Session(const RunOptions& options, Watcher watcher, wire::Participant participant, common::DomainClaim claim,
          std::filesystem::path folder);

  Result<void> start_recorder();
  Result<void> start_viewer();
  // One that others wait for: returns once it has said "ready".
  Result<common::ChildProcess> start_ready(const std::string& program_name, std::vector<std::string> arguments,
                                           const std::string& title);
  Result<void> start_processes();
  Result<common::ChildProcess> start_worker(std::size_t place);  // index among the workers
  Result<void> look_after();
  Result<jostle_msgs::msg::GoalResult> give_up(const Error& why);
  void look_after_recorder();
  Result<void> check_recording() const;
  Result<void> check_alive(const std::string& name, common::ChildProcess& child) const;
  // Somebody who is heard, and whether he is missed.
  struct Voice {
    std::string name;
    bool missed = false;  // and said so
  };

  // Says when a voice, heard last at `heard`, falls silent, and when it is heard again.
  void tell_of_waiting();
  void look_for(Voice& voice, std::optional<Clock::time_point> heard);
  void notice(const std::string& text) const;
  Result<void> send_goal();

  const RunOptions& options_;
  Watcher watcher_;
  wire::Participant participant_;
  common::DomainClaim claim_;
  std::filesystem::path folder_;  // for logs and the scene; removed at the end
  int workers_started_ = 0;
  Clock::time_point goal_deadline_;
  std::optional<Clock::time_point> crowded_since_;  // another coordinator is there, too
  std::string waiting_;                             // what the world said last of why it is not ready
  std::chrono::seconds goal_patience_{};
  Voice coordinator_{"the coordinator"}, robot_{"the robot"};
  GoalClient client_;
  Witness witness_;

  std::vector<common::ChildProcess> workers_;
  std::vector<Clock::time_point> restarts_;
  bool recorder_missed_ = false;  // it ended, and that was said
  struct WorldProcess {
    std::string title;
    common::ChildProcess process;
  };
  std::vector<WorldProcess> world_;
  std::optional<common::ChildProcess> coordinator_process_, recorder_process_, viewer_process_;
};

}  // namespace jostle::task
