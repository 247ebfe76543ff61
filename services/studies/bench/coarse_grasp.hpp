#pragma once
/// \file
/// How well coarse physics ranks candidates of a grasp, and what it costs beside the engine.

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <vector>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct CoarseGraspOptions {
  std::vector<int> objects{5, 15, 40};  ///< beside the target, one table row each
  int worlds = 10;                      ///< fresh ones of Sec. 3.3.1 for each
  int candidates = 60;                  ///< in each world, from the families of guided planning
  std::uint64_t seed = 1001;            ///< of the first world; seeds up to 999 are for tuning
  std::filesystem::path parameters;     ///< of `jostle run`
  std::filesystem::path json;           ///< empty: none
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< never null
};

/// Rolls the same candidates out in coarse physics, in the engine with resting objects frozen, and in the engine's full
/// physics, one after the other on one thread, and prints prices as ratios of each candidate's own times, how costs are
/// ranked against full physics, and how often the best five hold a success where any candidate is one.
/// Errors   kCancelled, kIo, those of scenes and parameters
Result<void> bench_coarse_grasp(const CoarseGraspOptions& options);

}  // namespace jostle::studies
