#pragma once
/// \file
/// Scheduler: which worker runs which sample, decided without middleware,
/// threads or clocks of its own.

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "physics_pool/api/pool.hpp"

namespace jostle::pool {

using physics_pool::TimePoint;

using WorkerId = std::uint64_t;  ///< random, new with every process
using Epoch = std::uint64_t;     ///< one batch of this client

/// Samples of one batch for one worker, to be sent as one message.
struct Assignment {
  WorkerId worker = 0;
  Epoch epoch = 0;
  std::uint32_t attempt = 0;  ///< copies of the first sample handed out before
  std::vector<std::uint32_t> samples;
};

/// What a heartbeat says, as far as scheduling goes.
struct WorkerNews {
  WorkerId worker = 0;
  std::string name, host;
  std::uint32_t pid = 0;
  int capacity = 1;           ///< rollouts at a time; 0: it takes its leave
  bool ready = false;         ///< it hears us, and we hear it
  std::uint32_t samples = 0;  ///< our samples that are queued or running there
  std::uint64_t others = 0;   ///< other clients' samples there
};

struct SchedulerOptions {
  /// A worker silent for so long is dead: five missed heartbeats.
  std::chrono::milliseconds silence{500};
  /// A sample that its worker does not have, this long after it was sent, is lost.
  std::chrono::milliseconds lost_after{300};
  /// Near the end of a batch, an idle worker gets a copy of a sample that has waited behind
  /// another for so long. It gets a copy of a running sample only if that has also taken twice
  /// as long as samples lately did. A shorter time copies samples that are about to return
  /// anyway, and copies are in the way of what comes next.
  std::chrono::milliseconds copy_after{20};
  /// A worker that could not do its work gets none for so long.
  std::chrono::seconds bench{5};
  /// A dead worker is remembered, and reported, for so long.
  std::chrono::seconds remember{60};
};

/// A Scheduler hands samples to workers by these rules:
///
///   lowest sample first; batches of equal priority take turns, urgent ones go
///   first, and while there are both every eighth sample is of a normal batch
///   a worker holds at most capacity + 1 samples: one more than it can run, so
///   that no thread waits for the network between two of them
///   where other clients use the worker too, and samples are shorter than messages may
///   take, it holds as many as last that long: a client without a sample there when a
///   thread becomes free loses its turn
///   samples of dead workers go back to the queue
///   when the queue is empty, idle workers get a second copy of samples that
///   wait behind others first, then of those outstanding longest; a worker that
///   has enough to do for other clients is not idle
///
/// Threads  one at a time.
class Scheduler {
 public:
  explicit Scheduler(const SchedulerOptions& options) : options_(options) {}

  /// Takes in a worker's heartbeat.
  void heard(const WorkerNews& news, TimePoint now);
  void bench(WorkerId worker, TimePoint now);
  /// Declares silent workers dead; returns those forgotten for good.
  std::vector<WorkerId> check_silence(TimePoint now);
  int usable_workers(TimePoint now) const;
  /// Returns when a worker last said that it has samples of ours.
  TimePoint last_held() const { return last_held_; }

  /// Takes in a batch of `samples` samples, numbered from `first_sample` on.
  void start(Epoch epoch, std::uint32_t first_sample, std::uint32_t samples,
             physics_pool::Priority priority = physics_pool::Priority::kNormal);
  /// Forgets a batch. True if workers still hold samples of it.
  bool finish(Epoch epoch);
  std::uint32_t missing(Epoch epoch) const;

  /// Takes in a sample that came back. True if it is the first result of that sample;
  /// otherwise it is late or a duplicate, and counted. `ran`: how long it ran, if known.
  bool accept(WorkerId worker, Epoch epoch, std::uint32_t sample, std::uint64_t engine_steps, TimePoint now,
              std::chrono::duration<double> ran = {});
  /// Drops the samples above this one: they are no longer wanted.
  void drop_above(Epoch epoch, std::uint32_t sample);

  /// Hands out whatever may be handed out now.
  std::vector<Assignment> assign(TimePoint now);

  physics_pool::PoolStatus status() const;
  std::string name_of(WorkerId worker) const;  ///< empty if it is not known

 private:
  struct Outstanding {
    Epoch epoch = 0;
    std::uint32_t sample = 0;
    TimePoint since;
  };
  struct Worker {
    physics_pool::WorkerStatus status;
    bool ready = false;
    std::uint64_t others = 0;  // other clients' samples, at the last heartbeat
    TimePoint last_heard;
    TimePoint benched_until;
    int empty_heartbeats = 0;              // in a row, though samples are outstanding
    std::vector<Outstanding> outstanding;  // oldest first
  };
  struct Sample {
    bool done = false;
    std::uint8_t copies = 0;     // outstanding now
    std::uint32_t attempts = 0;  // handed out ever
  };
  struct Batch {
    physics_pool::Priority priority = physics_pool::Priority::kNormal;
    std::uint32_t first_sample = 0;
    std::vector<Sample> samples;
    std::uint32_t next = 0;            // index of the lowest never handed out
    std::set<std::uint32_t> returned;  // indices handed out and lost
    std::uint32_t missing = 0;
  };
  /// One sample on its way to one worker.
  struct Choice {
    Epoch epoch = 0;
    std::uint32_t sample = 0;
  };

  /// An outstanding sample that an idle worker may run as well.
  struct Copyable {
    bool runs = false;  // else it waits behind another
    TimePoint since;
    Choice choice;
    WorkerId holder = 0;
  };

  bool usable(const Worker& worker, TimePoint now) const;
  bool idle(const Worker& worker, TimePoint now) const;
  int room(const Worker& worker) const;
  void take_back(Worker& worker, TimePoint sent_before);
  void release(const Outstanding& outstanding);
  std::pair<const WorkerId, Worker>* least_loaded(TimePoint now);
  bool next_sample(Choice& choice);
  bool next_sample_of(physics_pool::Priority priority, Choice& choice);
  std::vector<Copyable> copyable(TimePoint now) const;
  void assign_copies(TimePoint now, std::vector<Assignment>& assignments);
  void give(WorkerId id, Worker& worker, const Choice& choice, TimePoint now, std::vector<Assignment>& assignments);

  SchedulerOptions options_;
  std::map<WorkerId, Worker> workers_;
  std::map<Epoch, Batch> batches_;
  Epoch last_served_ = 0;
  TimePoint last_held_;
  std::uint64_t urgent_in_a_row_ = 0;               // samples handed out
  std::chrono::duration<double> typical_{0.0};      // from handing out to coming back, lately
  std::chrono::duration<double> typical_run_{0.0};  // how long samples lately ran; 0: not known
  std::uint64_t reissued_ = 0;
  std::uint64_t duplicates_ = 0;
};

}  // namespace jostle::pool
