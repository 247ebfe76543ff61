#pragma once
/// \file
/// Turns: whose sample runs next where several clients share a worker.

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "physics_pool/api/rollout.hpp"

namespace jostle::pool {

/// A checked sample that waits for a thread.
struct Job {
  std::uint64_t client = 0;
  std::uint64_t epoch = 0;  ///< batch, within the client
  std::uint32_t sample = 0;
  physics_pool::Priority priority = physics_pool::Priority::kNormal;
  std::chrono::duration<double> charged{0.0};  ///< set by next(): how long it is expected to take
};

/// Shares the threads by work time, not by samples, in two layers: between
/// priorities 1 : 7 (the lower one gets at least an eighth of the time while both
/// wait, so that nobody starves), within a priority 1 : 1 between clients. A client's
/// own samples run in the order they came.
///
///   S_i      time served, per weight; the least S_i among those who wait is next
///   dealt    V = S_i;  S_i += e_i / w_i      e_i: what its samples lately took
///   done     S_i += (a - e_i) / w_i          a: what this one took
///   back     S_i = max(S_i, V)               whoever was away saved nothing up
///
/// Source   start-time fair queueing, Goyal, Vin, Cheng, SIGCOMM 1996; lengths are
///          not known beforehand, hence the correction.
/// Threads  one at a time.
class Turns {
 public:
  using Duration = std::chrono::duration<double>;

  void wait(const Job& job);

  /// Takes out the sample that runs next, if any waits.
  std::optional<Job> next();

  /// Notes how long a sample that next() gave out has run. One that was skipped, at once
  /// or on its way, says nothing about those to come.
  void done(const Job& job, Duration took, bool skipped = false);

  /// Takes out the waiting samples of a batch.
  std::vector<Job> withdraw(std::uint64_t client, std::uint64_t epoch);

 private:
  struct Account {
    double served = 0.0;     // S_i, s
    std::uint64_t last = 0;  // turn; breaks ties
  };
  struct Client {
    Account account;
    std::optional<Duration> typical;  // e_i; none before the first has run
    std::deque<Job> jobs;
  };
  /// The clients of one priority.
  struct Class {
    Account account;
    double virtual_time = 0.0;  // V, among its clients
    std::size_t waiting = 0;    // samples
    std::map<std::uint64_t, Client> clients;
  };
  static void forget_idle(Class& group);

  std::map<physics_pool::Priority, Class> classes_;
  double virtual_time_ = 0.0;  // V, among classes
  std::uint64_t turn_ = 0;
};

}  // namespace jostle::pool
