#pragma once
/// \file
/// `jostle bench chaos`: plans while workers are killed, stalled and unplugged.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::studies {

struct ChaosOptions {
  std::uint64_t seed = 1;  ///< the schedule's, see chaos_schedule()
  int faults = 200;        ///< >= 1; three or so a second
  int workers = 4;         ///< processes of one thread, dealt to two hosts
  int domain = 0;
  std::filesystem::path json;                            ///< empty: none
  std::function<void(const std::string& line)> on_news;  ///< never empty
  std::stop_token stop;
};

/// Makes the same plan again and again while the faults of a schedule happen, and once more
/// when all are made good, and prints what became of it. Without the right to make hosts
/// nothing is unplugged; it says so.
///
/// Returns whether every plan was bit-equal to the undisturbed one.
/// Errors   kUnavailable, kDeadline  a plan failed, or a worker did not come back; names
///                                   seed and fault. A plan that hangs ends the process
///                                   with kExitBroken, after saying the same.
///          kCancelled               a stop was requested
Result<bool> bench_chaos(const ChaosOptions& options);

}  // namespace jostle::studies
