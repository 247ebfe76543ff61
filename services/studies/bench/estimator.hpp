#pragma once
/// \file
/// How far the estimate of objects is from the truth, and how far behind it, beside the last measurement as it came.

#include <cstdint>
#include <filesystem>
#include <stop_token>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct EstimatorBenchOptions {
  int worlds = 10;  ///< of each kind of trouble, >= 1; 20 s each
  std::uint64_t seed = 1;
  std::filesystem::path json;  ///< empty: none
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< never null
};

/// Draws worlds of six objects that are pushed in turns at 0.1 m/s, and what two sensors of 50 frames/s say of them:
/// with noise of 5, 10 and 15 mm, objects hidden, markers swapped, outliers, frames that are late, and clocks 2 s
/// apart. Prints the errors at rest and in motion, the lag, and how often states overlap, of the last measurement as it
/// came, of the estimate, and of the nearest state that physics can start from. Errors   kCancelled, kIo
Result<void> bench_estimator(const EstimatorBenchOptions& options);

}  // namespace jostle::studies
