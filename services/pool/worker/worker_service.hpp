#pragma once
/// \file
/// WorkerService: the worker half of the pool over DDS.

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "idl/types/time.hpp"
#include "physics_pool/local/executor.hpp"
#include "services/common/process/trouble.hpp"
#include "services/pool/outbox.hpp"
#include "services/pool/protocol.hpp"
#include "services/pool/worker/turns.hpp"
#include "services/pool/worker/world_store.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::pool {

struct WorkerOptions {
  std::string name;        ///< as clients report it; empty: host and process id
  int threads = 1;         ///< rollouts at a time; one per core is enough
  std::vector<int> cores;  ///< one for each simulating thread; empty: the system chooses
  /// Bytes for worlds and simulators that are kept for the next batch, a quarter of them for worlds. A client that
  /// plans in many worlds at once needs room for all of them in every thread.
  std::size_t memory = kMemory;

  static constexpr std::size_t kMemory = std::size_t{512} << 20;
};

/// Takes assignments, runs their samples, answers each. Clients and priorities share the
/// threads as turns.hpp says; whose sample runs is decided when a thread is free, not before.
///
/// Threads  `threads` that simulate; one that checks assignments, compiles worlds and
///          deals samples out; one for heartbeats, so that a worker deep in
///          physics is still heard; one for results that waited for others, as outbox.hpp says.
/// Failure  a bad assignment is answered with an error that names the field; an assignment
///          whose world does not arrive in 5 s likewise. A client that is gone
///          has its samples dropped. A result that the middleware does not take is lost
///          and counted; its client sends the sample again, or to another worker. Assignments
///          are lost and counted, too, where their client has more here than limits.hpp
///          allows; the heartbeat says how many.
/// Trust    what a message says of its client is compared with who wrote it: nobody gives work
///          or cancels it in another's name.
class WorkerService {
 public:
  WorkerService(const wire::Participant& participant, const WorkerOptions& options);
  /// Cancels what runs and takes leave of the clients; takes milliseconds.
  ~WorkerService();

  std::uint64_t id() const { return id_; }
  const std::string& name() const { return name_; }

 private:
  using Assignment = jostle_msgs::msg::Assignment;

  /// Names a batch: client and epoch.
  using BatchId = std::pair<std::uint64_t, std::uint64_t>;
  /// An assignment that was not looked at yet, or waits for its world.
  struct Arrival {
    Assignment assignment;
    TimePoint arrived;
    std::size_t bytes = 0;                            // about
    std::optional<physics_pool::RolloutBatch> batch;  // once it was looked at; it is no longer in the assignment then
  };
  /// What one client has here.
  struct Account {
    std::string name;           // as a log shows it
    std::uint32_t samples = 0;  // arrived, waiting, running, or with results that were not sent
    std::int64_t received = 0;  // `sent` of its newest assignment, ns
    std::chrono::milliseconds period = kHeartbeatPeriod;  // that it wants
    std::size_t arrivals = 0;                             // not looked at yet, or waiting for their worlds
    std::size_t arrival_bytes = 0;
    std::size_t batches = 0;     // of which samples wait or run
    std::uint64_t rollouts = 0;  // done
    TimePoint began;
  };
  /// A sample that waits or runs, and what its answer repeats of its assignment.
  struct Held {
    Job job;
    std::uint32_t attempt = 0;
    std::int64_t sent = 0;  // ns, the client's clock
    TimePoint arrived;
  };
  /// A batch of which samples wait or run here.
  struct Running {
    physics_pool::BatchRunPtr run;
    std::map<std::uint32_t, Held> samples;  // by index
  };

  void take_in(Assignment&& assignment, std::uint64_t writer);
  const char* why_too_much(const Account& account, const Assignment& assignment, std::size_t bytes) const;
  void serve(std::stop_token stop);
  void examine(Arrival arrival);
  Result<void> judge(Arrival& arrival) const;
  void accept(Arrival& arrival, physics_pool::WorldPtr world);
  void refuse(const Arrival& arrival, const Error& error);
  void looked_at(const Arrival& arrival);
  void note_lost_result();
  void feed();
  void finish(const BatchId& batch, const physics_pool::RolloutOutcome& outcome, const physics_pool::Shift& shift);
  Held release(const BatchId& batch, std::uint32_t sample);
  void post(std::unique_lock<std::mutex>& lock);
  void send(std::vector<Outbox::Group> groups);
  void send_results(std::stop_token stop);
  std::chrono::milliseconds period() const;
  void obey(const jostle_msgs::msg::BatchControl& control, std::uint64_t writer);
  void cancel(const BatchId& batch);
  void beat(std::stop_token stop);
  void say_troubles();
  void say_who_is_served(const std::vector<std::uint64_t>& clients);
  void drop_lost_clients(const std::vector<std::uint64_t>& clients);
  jostle_msgs::msg::WorkerHeartbeat heartbeat(const std::vector<std::uint64_t>& clients) const;

  const wire::Participant participant_;
  const std::uint64_t id_;
  const std::string name_;
  const std::string host_;
  const int threads_;
  WorldStore worlds_;

  mutable std::mutex mutex_;           // guards everything down to kicked_
  std::condition_variable_any wake_;   // wakes the serving thread
  std::condition_variable_any post_;   // wakes the thread that sends results
  std::deque<Arrival> arrivals_;       // not looked at yet
  std::deque<Arrival> without_world_;  // looked at, and waiting for their worlds
  std::size_t arrival_bytes_ = 0;      // of both
  Turns turns_;
  Outbox outbox_;
  std::map<BatchId, Running> running_;
  std::map<std::uint64_t, Account> accounts_;  // by client
  std::deque<BatchId> cancelled_;              // lately; an assignment may come after its cancellation
  int dealt_ = 0;                              // samples with the executor: one per busy thread
  std::uint64_t rollouts_ = 0;
  std::uint64_t engine_steps_ = 0;
  std::uint64_t answers_ = 0;  // messages with results that were sent
  std::uint64_t refused_ = 0;  // assignments that came when their client had too much here
  bool kicked_ = false;

  // Noted where it happens, said by the heart: a log may block.
  common::Trouble lost_results_{"results"};
  common::Trouble too_many_{"assignments were dropped"};
  common::Trouble foreign_{"messages were dropped"};

  wire::Writer<jostle_msgs::msg::AssignmentResults> result_writer_;
  wire::Writer<jostle_msgs::msg::WorkerHeartbeat> heartbeat_writer_;
  physics_pool::Executor executor_;
  // Readers and threads use all of the above: last made, first gone.
  wire::Reader<jostle_msgs::msg::WorldDescription> world_reader_;
  wire::Reader<jostle_msgs::msg::BatchControl> control_reader_;
  wire::Reader<Assignment> assignment_reader_;
  std::jthread server_;
  std::jthread poster_;
  std::jthread heart_;
};

}  // namespace jostle::pool
