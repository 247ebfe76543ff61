#pragma once
/// \file
/// `jostle bench chaos`: plans while workers are killed, stalled and unplugged.

#include <cstdint>
#include <filesystem>
#include <stop_token>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct ChaosOptions {
  std::uint64_t seed = 1;  ///< the schedule's, see chaos_schedule()
  int faults = 200;        ///< >= 1; three or so a second
  int workers = 4;         ///< processes of one thread, dealt to two hosts
  int domain = 0;
  std::filesystem::path json;  ///< empty: none
  WorkLine* line = nullptr;    ///< where it is shown how far the work has come; never null
  std::stop_token stop;
};

/// Makes the same plan again and again while the faults of a schedule happen, and once more
/// when all are made good, and prints what became of it. Without the right to make hosts
/// nothing is unplugged; it says so.
///
/// Returns whether every plan was bit-equal to the undisturbed one. After a stop request it prints and writes what has
/// happened so far.
/// Errors   kUnavailable, kDeadline  a plan failed, or a worker did not come back; names
///                                   seed and fault. A plan that hangs ends the process
///                                   with kExitBroken, after saying the same.
///          kCancelled               a stop was requested, after what was printed, if there was a plan
Result<bool> bench_chaos(const ChaosOptions& options);

}  // namespace jostle::studies
