#pragma once
/// \file
/// Everything that can be measured. docs/benchmarks.md says why.

#include <chrono>
#include <stop_token>
#include <utility>
#include <vector>

#include "services/studies/bench/measurement.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

using Measurements = std::vector<Measurement>;

/// How to measure, as the command line says it, and whom to tell.
struct Settings {
  int repeats = 1;           ///< >= 1
  std::vector<int> workers;  ///< for `scheduling`: numbers of processes, one measurement each
  std::vector<int> hosts;    ///< for `lanes`: numbers of hosts, one measurement each
  int lanes = 64;            ///< for `lanes`: threads of the worker on each host
  int steps = 3;             ///< for `lanes`: control steps of a plan, which assignments carry
  int domain = 0;            ///< DDS domain; nobody else uses it, or the next one
  std::stop_token stop;
  WorkLine* line = nullptr;      ///< where it is shown how far the work has come; never null
  Measurements* done = nullptr;  ///< where a finished measurement is kept at once; never null

  /// Says how many measurements there will be.
  void announce(int measurements) const { line->expect(static_cast<std::size_t>(measurements * turns().runs())); }
  Turns turns() const {
    return {.repeats = repeats, .stop = stop, .on_run = [this] { line->step(); }};
  }
  /// Keeps a measurement, and says what came of it.
  void keep(Measurement measurement) const {
    line->news(one_line(measurement));
    done->push_back(std::move(measurement));
  }
};

/// The longest that one run of one side may take: a pool that is slower hangs.
inline constexpr std::chrono::minutes kPatience{5};

// Each of the following keeps its measurements one by one, so that those that are finished are not lost with one that
// fails. Their errors are those of what is measured, and kCancelled after a stop request.

/// Measures ThreadPool against as many bare loops of engine steps, steps/s.
Result<void> measure_pool_threads(const Settings& settings);

/// Measures RemotePool with two worker processes against two bare loops, steps/s.
Result<void> measure_pool_dds(const Settings& settings);

/// Measures a batch of one empty sample through RemotePool and one worker against an
/// echo over bare Fast DDS, microseconds.
Result<void> measure_round_trip(const Settings& settings);

/// Measures a batch with stop_losers against the same batch without, rollouts/s.
Result<void> measure_early_stop(const Settings& settings);

/// Measures an iteration of RobustSTO (Alg. 5), all of whose rollouts are under way at once on threads that wait
/// instead of simulating, against one such rollout (Eq. 4.43), ms: the thesis's 84 rollouts with a thread for each, and
/// with 64 threads, and 60 rollouts (N_c = 2, N_w = 6) with 64. Then the same with physics on all cores, against an
/// iteration by J alone.
Result<void> measure_robust_iteration(const Settings& settings);

/// Measures worker processes that wait instead of simulating: the time their waiting
/// takes when nobody idles, against the time the batch took.
Result<void> measure_scheduling(const Settings& settings);

/// Measures the same with the workers spread over hosts.
Result<void> measure_hosts_scheduling(const Settings& settings);

/// Measures hosts with one worker process each, whose threads wait instead of simulating.
Result<void> measure_lanes(const Settings& settings);

/// Measures round trips and throughput between two hosts over a good and a bad link, through a
/// protected and an unprotected domain, microseconds and MB/s.
Result<void> measure_hosts(const Settings& settings);

/// Measures batches like a plan's, whose samples wait instead of simulating, while one of two hosts
/// of workers is unplugged for a while, against the same left alone, seconds.
Result<void> measure_unplugged(const Settings& settings);

/// Measures one step of 1 s of every coarse model against one of the fine model, microseconds.
/// The sides answer the same question, and give different answers.
Result<void> measure_coarse_models(const Settings& settings);

/// Measures one trajectory by Parareal on all processors against the serial fine model's time
/// divided by the speed-up that Eq. 6.4 allows for so many.
Result<void> measure_parareal(const Settings& settings);

/// Measures the same over N worker processes that wait as long as a slice takes: what the
/// exchange of slices costs, beyond Eq. 6.4, where there are processors enough.
Result<void> measure_parareal_scheduling(const Settings& settings);

/// Measures the time from a sample of a simulated controller to our client's command, at 125 and 500 Hz, against that
/// of a loop that reads a sample and writes a command, microseconds.
Result<void> measure_arm_cycle(const Settings& settings);

/// Measures writing messages of 1 KiB into a bag of each kind against bare appends of the same bytes, messages/s.
Result<void> measure_bag(const Settings& settings);

/// Measures a bag of 1000 messages per second, played at rates from 0.1 to 10 by another process: the
/// time it takes as heard here against the time it has in the bag, ms.
Result<void> measure_play(const Settings& settings);

/// Measures a whole run of `jostle run` in scenes/clutter.yaml with a server for viewers and two viewers that subscribe
/// to everything, against the same run alone, seconds.
Result<void> measure_viewers(const Settings& settings);

/// Is the other process of `round-trip`: answers every assignment until it is told to
/// end. Returns the exit code.
int serve_echo(int domain, std::stop_token stop);

}  // namespace jostle::studies
