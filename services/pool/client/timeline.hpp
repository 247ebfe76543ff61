#pragma once
/// \file
/// Timeline: what each worker's threads did when, seen from the client.

#include <cstdint>
#include <string>
#include <vector>

#include "physics_pool/api/pool.hpp"

namespace jostle::pool {

/// One sample that came back. Times are seconds, each on the clock it was taken from.
struct SampleTrace {
  std::uint64_t client = 0, worker = 0, epoch = 0;
  std::string worker_name;
  std::uint32_t thread = 0, sample = 0, attempt = 0;
  bool first = true;                                    ///< false: its result came late, or again, and was dropped
  double sent = 0.0, received = 0.0;                    ///< assignment and result, client's clock
  double arrived = 0.0, started = 0.0, finished = 0.0;  ///< assignment and sample, worker's clock
};

/// Estimates how far a worker's clock W is ahead of the client's C, from messages both ways.
/// With delays d >= 0,
///
///   there   arrived_W - sent_C      = theta + d    so theta <= the least of these
///   back    received_C - finished_W = d - theta    so theta >= minus the least of these
///
/// and theta is taken halfway: the error is at most half of the two least delays, a
/// fraction of a millisecond. Clocks that drift apart widen it: those of two machines by
/// about a millisecond per minute. On one machine there is only one clock.
///
/// Source   Cristian, "Probabilistic clock synchronization", Distributed Computing 3, 1989.
class ClockOffset {
 public:
  void add(const SampleTrace& trace);

  double seconds() const { return (there_ - back_) / 2; }  ///< theta; 0 before the first trace
  double error() const { return (there_ + back_) / 2; }    ///< at most, s

 private:
  bool any_ = false;
  double there_ = 0.0, back_ = 0.0;  // the least so far, s
};

struct Timeline {
  /// One worker's thread.
  struct Row {
    std::string worker;
    std::uint32_t thread = 0;
    double busy = 0.0;         ///< s
    int samples = 0;           ///< all that came back, copies included
    int copies = 0;            ///< those dropped
    double longest_gap = 0.0;  ///< s, before, between or after samples
  };
  /// A sample on its thread, client's clock.
  struct Bar {
    int row = 0;
    double from = 0.0, to = 0.0;  ///< s since the first assignment was sent
    std::uint64_t client = 0, epoch = 0;
    bool first = true;
  };

  std::vector<Row> rows;     ///< by worker, then thread
  std::vector<Bar> bars;     ///< by row, then time
  double length = 0.0;       ///< s from the first assignment sent to the last result received
  double efficiency = 0.0;   ///< busy time as part of the available time, all rows
  double clock_error = 0.0;  ///< s, of the worker whose clock is known worst
  double on_the_way = 0.0;   ///< s, median per sample: from sent to received, less the time at the worker
  double in_line = 0.0;      ///< s, median per sample: at the worker before it ran
};

/// Makes the timeline of samples. `workers`: all that there were; their idle threads get rows too. Workers are
/// told apart by name.
Timeline timeline_of(const std::vector<SampleTrace>& traces,
                     const std::vector<physics_pool::WorkerStatus>& workers = {});

}  // namespace jostle::pool
