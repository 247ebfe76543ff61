#pragma once
/// \file
/// A fleet of workers that nobody has, simulated: the pool's own Scheduler and Outbox, and a model of everything
/// between.

#include <cstdint>

namespace jostle::studies {

/// CPU time that messages and samples take, s. What a machine needs is measured by `jostle bench lanes`.
struct FleetCosts {
  double turn = 10e-6;        ///< of the client's dispatcher, beside what is in it
  double answer = 25e-6;      ///< a message with results, at the thread of the client that reads
  double read = 1.5e-6;       ///< each result in it, likewise
  double result = 2e-6;       ///< each result, at the client's dispatcher
  double assignment = 35e-6;  ///< a message with samples, at the client
  double heartbeat = 25e-6;   ///< at the thread that reads
  double take = 60e-6;        ///< a message with samples, at the worker
  double sample = 70e-6;      ///< threads that wake up and fall asleep, at the worker
  double send = 45e-6;        ///< a message with results, at the worker
};

struct FleetOptions {
  int hosts = 200;             ///< with one worker process each
  int lanes = 64;              ///< threads of each
  double sample = 0.05;        ///< s that a sample takes
  int samples_per_lane = 200;  ///< of the one batch
  double latency = 100e-6;     ///< s, of a message, each way
  double jitter = 100e-6;      ///< s, mean of an exponential that is added to it
  /// Share of hosts that die in a minute, without a word; each is back as somebody new `away` later.
  double deaths_per_minute = 0.01;
  double away = 10.0;          ///< s
  int shared_cores = 0;        ///< that clients and workers share; 0: each lane has its own, and so has the client
  bool time_scheduler = true;  ///< count what the Scheduler really takes on this machine; else it takes nothing
  std::uint64_t seed = 1;
  FleetCosts costs;
};

struct FleetResult {
  double seconds = 0.0;       ///< from the start of the batch to its last result
  double efficiency = 0.0;    ///< part of that in which the lanes ran samples that were needed, had none died
  double client_busy = 0.0;   ///< part of that in which the busier of the client's two threads ran
  double scheduler_us = 0.0;  ///< CPU time of the Scheduler per sample, microseconds; 0 if not timed
  double samples_per_assignment = 0.0;
  double samples_per_answer = 0.0;
  std::uint64_t heartbeats = 0;  ///< that the client heard
  int deaths = 0;
  std::uint64_t reissued = 0;
  std::uint64_t duplicates = 0;
  bool finished = false;  ///< false: it hung, and was given up after ten times the time it should take
};

/// Runs one batch through the fleet, in simulated time.
///
/// Repeats  equal options give equal results, unless the Scheduler is timed.
FleetResult simulate(const FleetOptions& options);

}  // namespace jostle::studies
