#pragma once
/// \file
/// WorkerService: the worker half of the pool over DDS.

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "idl/types/time.hpp"
#include "physics_pool/local/executor.hpp"
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
///          physics is still heard.
/// Failure  a bad assignment is answered with an error that names the field; an assignment
///          whose world does not arrive in 5 s likewise. A client that is gone
///          has its samples dropped. A result that the middleware does not take is lost
///          and counted; its client sends the sample again, or to another worker. Assignments
///          are lost and counted, too, once 1024 others were not looked at or wait for their
///          worlds; the heartbeat says how many.
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

  void serve(std::stop_token stop);
  void examine(const Arrival& arrival);
  void accept(const Arrival& arrival, physics_pool::RolloutBatch batch, physics_pool::WorldPtr world);
  void refuse(const Assignment& assignment, const Error& error);
  void feed();
  void finish(const BatchId& batch, const physics_pool::RolloutOutcome& outcome, const physics_pool::Shift& shift);
  Held release(const BatchId& batch, std::uint32_t sample);
  void obey(const jostle_msgs::msg::BatchControl& control);
  void cancel(const BatchId& batch);
  void beat(std::stop_token stop);
  void say_losses();
  void drop_lost_clients(const std::vector<std::uint64_t>& clients);
  jostle_msgs::msg::WorkerHeartbeat heartbeat(const std::vector<std::uint64_t>& clients) const;

  const std::uint64_t id_;
  const std::string name_;
  const std::string host_;
  const int threads_;
  WorldStore worlds_;

  mutable std::mutex mutex_;          // guards everything down to kicked_
  std::condition_variable_any wake_;  // wakes the serving thread
  std::deque<Arrival> arrivals_;
  Turns turns_;
  std::map<BatchId, Running> running_;
  std::map<std::uint64_t, std::uint32_t> loads_;  // samples per client: arrived, waiting, running
  std::deque<BatchId> cancelled_;                 // lately; an assignment may come after its cancellation
  int dealt_ = 0;                                 // samples with the executor: one per busy thread
  std::uint64_t rollouts_ = 0;
  std::uint64_t engine_steps_ = 0;
  std::uint64_t refused_ = 0;       // assignments that came when too many were unread
  std::uint64_t lost_results_ = 0;  // results that the middleware did not take
  bool kicked_ = false;

  // Only the heart uses these.
  std::uint64_t said_lost_results_ = 0, said_refused_ = 0;
  TimePoint next_complaint_;

  wire::Writer<jostle_msgs::msg::AssignmentResult> result_writer_;
  wire::Writer<jostle_msgs::msg::WorkerHeartbeat> heartbeat_writer_;
  physics_pool::Executor executor_;
  // Readers and threads use all of the above: last made, first gone.
  wire::Reader<jostle_msgs::msg::WorldDescription> world_reader_;
  wire::Reader<jostle_msgs::msg::BatchControl> control_reader_;
  wire::Reader<Assignment> assignment_reader_;
  std::jthread server_;
  std::jthread heart_;
};

}  // namespace jostle::pool
