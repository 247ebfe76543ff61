#pragma once
/// \file
/// Scheduler: which worker runs which sample, decided without middleware,
/// threads or clocks of its own.

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "services/pool/protocol.hpp"

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

/// How long a sample took, as its worker says; 0: not known.
struct SampleTimes {
  std::chrono::duration<double> ran{};    ///< on its thread
  std::chrono::duration<double> there{};  ///< from the assignment's arrival to the sample's end
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
  /// The newest of our assignments that it had taken in was sent then; the default: it had none.
  TimePoint received;
  bool all_answers_here = true;                         ///< every result that it had sent is here, or lost for good
  std::chrono::milliseconds period = kHeartbeatPeriod;  ///< until its next heartbeat
};

struct SchedulerOptions {
  /// A worker silent for so long is taken for dead: five missed heartbeats, more where it says that
  /// they come less often.
  std::chrono::milliseconds silence{500};
  /// Silence grows up to this where heartbeats come late, and where the dead turn out to live.
  std::chrono::milliseconds longest_silence{5000};
  /// Time between two turns of the caller counts as time that it listened up to so much. The
  /// rest it was late itself, and no silence of others.
  std::chrono::milliseconds turn{150};
  /// A sample that has reached its worker, which does not have it this long after it was sent, is lost.
  std::chrono::milliseconds lost_after{300};
  /// So is one of which nobody knows that it reached its worker, or whose result may be on its way.
  std::chrono::milliseconds lost_on_the_way{3000};
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
///   samples go back to the front of the queue when their worker took leave, or does not have
///   them any more
///   samples of workers that are taken for dead are in doubt: they are handed out again when
///   there is nothing else, and stay where they are if the worker is heard before
///   silence is time in which the caller listened; it has to last longer the later heartbeats
///   come, and the more results come from workers that were taken for dead
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
  /// How often workers should be heard: less often the more there are. Nothing if all of them know, or
  /// were told within the last second.
  std::optional<std::chrono::milliseconds> period_to_ask(TimePoint now);
  /// Returns when a worker last said that it has samples of ours.
  TimePoint last_held() const { return last_held_; }

  /// Takes in a batch of `samples` samples, numbered from `first_sample` on.
  void start(Epoch epoch, std::uint32_t first_sample, std::uint32_t samples,
             physics_pool::Priority priority = physics_pool::Priority::kNormal);
  /// Forgets a batch. True if workers still hold samples of it.
  bool finish(Epoch epoch);
  std::uint32_t missing(Epoch epoch) const;

  /// Takes in a sample that came back. True if it is the first result of that sample;
  /// otherwise it is late or a duplicate, and counted.
  bool accept(WorkerId worker, Epoch epoch, std::uint32_t sample, std::uint64_t engine_steps, TimePoint now,
              const SampleTimes& times = {});
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
    std::chrono::nanoseconds listened_then{0};  // listened_ when it was heard
    std::chrono::milliseconds period{0};        // between its heartbeats, as it says
    TimePoint benched_until;
    int empty_heartbeats = 0;              // in a row, though samples are outstanding
    std::vector<Outstanding> outstanding;  // oldest first
    std::vector<Outstanding> doubted;      // what it had when it was taken for dead
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
    std::set<std::uint32_t> doubted;   // indices handed out and perhaps lost
    std::uint32_t missing = 0;

    bool has_some() const { return next < samples.size() || !returned.empty() || !doubted.empty(); }  // to hand out
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

  void listen(TimePoint now);
  std::chrono::nanoseconds patience(const Worker& worker) const;
  double caution() const;
  void heard_again(Worker& worker, const WorkerNews& news);
  void look_for_lost(Worker& worker, const WorkerNews& news, TimePoint now);
  bool usable(const Worker& worker, TimePoint now) const;
  bool idle(const Worker& worker, TimePoint now) const;
  int room(const Worker& worker) const;
  enum class Fate { kLost, kDoubtful };
  void take_back(Worker& worker, TimePoint sent_before, Fate fate);
  void release(const Outstanding& outstanding);
  /// A worker with room for another sample.
  struct Seat {
    double load = 0.0;  // samples it holds, by capacity
    WorkerId id = 0;
    Worker* worker = nullptr;
    int room = 0;
  };
  std::vector<Seat> seats(TimePoint now);
  bool next_sample(Choice& choice);
  bool next_sample_of(physics_pool::Priority priority, Choice& choice);
  std::vector<Copyable> copyable(TimePoint now) const;
  void assign_new(TimePoint now, std::vector<Assignment>& assignments);
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
  std::chrono::duration<double> typical_way_{0.0};  // there and back without the time at the worker
  TimePoint last_turn_;
  std::chrono::nanoseconds listened_{0};  // so far
  double lateness_ = 1.0;                 // of heartbeats lately: time between two by the one that was promised
  double wrongly_dead_ = 0.0;             // share of results lately whose workers were taken for dead
  TimePoint last_asked_;                  // for another period, or whether one is needed
  std::uint64_t reissued_ = 0;
  std::uint64_t duplicates_ = 0;
};

}  // namespace jostle::pool
