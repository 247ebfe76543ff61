#pragma once
/// \file
/// Frames of a recorded run.

#include <filesystem>
#include <string>

#include "idl/types/result.hpp"
#include "services/bags/recorded/recorded_motion.hpp"
#include "services/tools/render/frames.hpp"

namespace jostle::tools {

struct BagFramesOptions {
  std::string goal;                               ///< which run; empty: the bag's only one
  bags::RunClock clock = bags::RunClock::kWorld;  ///< kWall shows how long the robot waited for plans
  double per_second = 20.0;                       ///< frames per second of the run's clock
  int count = 0;                                  ///< so many frames, evenly spread, instead; 0: by time
};

/// Loads what was measured while a run went on: the execution scene in its recorded states, each
/// with its time, action and plan below.
/// Errors   those of BagReader, read_runs, select_runs and RecordedMotion
///          kInvalidArgument  several runs and none chosen
Result<Frames> load_bag(const std::filesystem::path& bag, const BagFramesOptions& options);

}  // namespace jostle::tools
