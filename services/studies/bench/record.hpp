#pragma once
/// \file
/// `jostle bench record`: the recorder at full pace, and what it costs others.

#include <filesystem>
#include <stop_token>

#include "idl/types/result.hpp"

namespace jostle::studies {

struct RecordBenchOptions {
  double rate = 20'000.0;  ///< messages per second, of 1 KiB
  double seconds = 60.0;
  int pairs = 0;  ///< of plans with and without a recorder; 0: the recorder at its pace
  int domain = 0;
  std::filesystem::path json;  ///< empty: none
  std::stop_token stop;
};

/// A publisher process at a rate, a recorder process, and everything counted three times: by
/// the publisher, by the recorder's counters, and by the numbers in what the bag holds. Beside
/// it loops that append the same messages to a bag, and to a bare file, as fast as they can.
/// Or, with `pairs`, the times of a plan with a recorder that is started, stopped and started
/// again beside it, and without, in turns.
/// Errors   kUnavailable, kIo; kCancelled. Lost messages are a result, not an error.
Result<void> bench_record(const RecordBenchOptions& options);

/// The publisher: waits for a reader, writes, waits until all was received; says how it went in
/// `json`. An exit code.
int publish_for_record(const RecordBenchOptions& options);

}  // namespace jostle::studies
