#pragma once
/// \file
/// `jostle bench record`: the recorder at full pace, and what it costs others.

#include <filesystem>
#include <stop_token>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct RecordBenchOptions {
  double rate = 20'000.0;  ///< messages per second, of 1 KiB
  double seconds = 60.0;
  int pairs = 0;  ///< pairs of plans, with and without a recorder; 0: measure the recorder at its pace
  int domain = 0;
  std::filesystem::path json;  ///< empty: none
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< where it is shown how far the work has come; never null, but for the publisher
};

/// Runs a publisher process at a rate and a recorder process, and counts everything three times: by
/// the publisher, by the recorder's counters, and by the numbers in what the bag holds. Beside
/// them it runs loops that append the same messages to a bag, and to a bare file, as fast as they can.
/// With `pairs` it measures instead, in turns, the times of a plan beside which a recorder is started,
/// stopped and started again, and of one without.
/// Errors   kUnavailable, kIo; kCancelled after a stop request, when what was finished has been printed and written.
///          Lost messages are a result, not an error.
Result<void> bench_record(const RecordBenchOptions& options);

/// Is the publisher: waits for a reader, writes, waits until all was received; says how it went in
/// `json`. Returns an exit code.
int publish_for_record(const RecordBenchOptions& options);

}  // namespace jostle::studies
