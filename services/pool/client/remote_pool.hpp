#pragma once
/// \file
/// RemotePool: the client half of the pool over DDS.

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "services/common/process/trouble.hpp"
#include "services/pool/client/scheduler.hpp"
#include "services/pool/client/timeline.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::pool {

struct RemotePoolOptions {
  /// A batch fails when no worker can be used for so long.
  std::chrono::milliseconds no_worker_timeout{10'000};
  SchedulerOptions scheduler;
  /// Called for every sample that comes back, from the pool's own thread; must be quick
  /// and must not call the pool. Samples that are cancelled do not come back.
  std::function<void(const SampleTrace&)> on_sample;
  /// Called when a batch has made no progress for some seconds, with why as far as it is known, and with an empty text
  /// when it goes on; likewise.
  std::function<void(const std::string&)> on_trouble;
};

/// Messages that a RemotePool exchanged with its workers so far, and the samples in them.
struct Traffic {
  std::uint64_t assignments = 0, samples_out = 0;
  std::uint64_t answers = 0, samples_back = 0;
  std::uint64_t heartbeats = 0;
};

/// A RemotePool uses worker processes in one DDS domain. It simulates nothing itself; the
/// README of this room describes the exchange.
///
/// Threads  safe from any thread. One thread of its own sends everything.
/// Errors   besides those of Pool: kUnavailable when no worker could be used
///          for `no_worker_timeout`, or when workers could and nothing came back (limits.hpp). A
///          worker's refusal of an assignment is the batch's error; it names the worker.
/// Failure  a worker that dies, stalls or cannot do its work loses nothing:
///          its samples go to others.
/// Trust    a worker is whoever said so first: what others say in its name is dropped and
///          counted, and nobody is more workers than limits.hpp allows.
class RemotePool final : public physics_pool::AsyncPool {
 public:
  RemotePool(const wire::Participant& participant, const RemotePoolOptions& options = {});
  /// To be called after every `run` has returned and every ticket is gone.
  ~RemotePool() override;

  Result<Hash> load(const physics_pool::Scene& scene) override;
  Result<std::unique_ptr<Ticket>> submit(const physics_pool::RolloutBatch& batch, OnReply on_reply) override;
  physics_pool::PoolStatus status() const override;
  Traffic traffic() const;

  /// Whether `count` workers could be used by the deadline.
  bool wait_for_workers(int count, physics_pool::TimePoint deadline) const;

 private:
  struct Active;
  class Underway;
  using Control = jostle_msgs::msg::BatchControl;
  using AssignmentMessage = jostle_msgs::msg::Assignment;
  struct Received {
    WorkerId worker = 0;
    jostle_msgs::msg::AssignmentResult result;
    physics_pool::TimePoint at;
  };
  /// What a worker's newest heartbeat says to us.
  struct Heartbeat {
    std::string name, host;
    std::uint32_t pid = 0;
    std::uint32_t capacity = 0;
    bool hears_us = false;
    std::uint32_t samples = 0;  // ours
    std::uint64_t others = 0;
    physics_pool::TimePoint received;  // the newest of our assignments that came there was sent then
    std::chrono::milliseconds period{0};
    std::uint64_t answers = 0;  // messages with results that it had sent to anybody
  };
  /// What leaves in one turn of the dispatcher.
  struct Outgoing {
    std::vector<Control> controls;
    std::vector<std::pair<WorkerId, AssignmentMessage>> assignments;
  };

  Error no_worker() const;
  void give_up_without_workers(physics_pool::TimePoint now);
  void watch_progress(physics_pool::TimePoint now);
  std::string last_trouble() const;
  bool admit(WorkerId worker, std::uint64_t writer);
  void take_in(const jostle_msgs::msg::WorkerHeartbeat& heartbeat, std::uint64_t writer);
  void take_in(jostle_msgs::msg::AssignmentResults&& results, const wire::Origin& origin);
  void miss(Active& active, WorkerId worker, const std::string& why, physics_pool::TimePoint now);

  void dispatch(std::stop_token stop);
  void connect(const std::vector<WorkerId>& workers);
  void send(const Outgoing& outgoing);
  void absorb_results(physics_pool::TimePoint now);
  void absorb_heartbeats(physics_pool::TimePoint now, std::vector<WorkerId>& strangers);
  void absorb(Received received, physics_pool::TimePoint now);
  void trace(const Received& received, bool first) const;
  void adopt(Active& active, physics_pool::RolloutOutcome outcome);
  void prepare_assignments(physics_pool::TimePoint now);
  void finish(Active& active, Result<physics_pool::BatchReply> reply);
  void forget(Active& active);
  void kick();

  const wire::Participant participant_;
  const RemotePoolOptions options_;
  const std::uint64_t client_;

  mutable std::mutex mutex_;                     // guards everything down to kicked_
  mutable std::condition_variable_any changed_;  // workers came or went
  std::condition_variable_any wake_;             // wakes the dispatcher
  Scheduler scheduler_;
  Epoch last_epoch_;
  std::unordered_map<Hash, std::pair<StateLayout, double>> worlds_;  // layouts and time steps, s
  std::map<Epoch, std::shared_ptr<Active>> active_;                  // shared with its ticket
  std::vector<Received> results_;
  std::map<WorkerId, std::uint64_t> answers_;        // the newest message with results that came from each
  std::map<WorkerId, Heartbeat> heartbeats_;         // not looked at yet
  std::map<WorkerId, std::uint64_t> participants_;   // that workers are of
  std::map<std::uint64_t, std::size_t> workers_of_;  // by participant
  Outgoing outgoing_;
  Traffic traffic_;
  physics_pool::TimePoint last_usable_;
  std::string last_refusal_;
  bool ever_heard_ = false;
  physics_pool::TimePoint last_turn_;  // of the dispatcher
  bool kicked_ = false;

  common::Trouble foreign_{"messages were dropped"};
  common::Trouble too_many_{"workers were ignored"};
  common::Trouble unread_{"results were dropped"};

  wire::Writer<jostle_msgs::msg::WorldDescription> world_writer_;
  wire::Writer<Control> control_writer_;
  std::map<WorkerId, wire::Writer<AssignmentMessage>> assignment_writers_;  // used by the dispatcher alone
  // Readers and the dispatcher use all of the above: last made, first gone.
  wire::Reader<jostle_msgs::msg::AssignmentResults> result_reader_;
  wire::Reader<jostle_msgs::msg::WorkerHeartbeat> heartbeat_reader_;
  std::jthread dispatcher_;
};

}  // namespace jostle::pool
