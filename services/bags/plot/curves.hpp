#pragma once
/// \file
/// Curves of a recorded run: what its plans cost, how far the target was, how fast things moved.

#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/bag_reader.hpp"
#include "services/bags/recorded/recorded_run.hpp"

namespace jostle::bags {

/// Values over time. Times: s of the world's clock, which may stand still while plans are made, from the run's first
/// sample on.
struct Curve {
  std::vector<double> time, value;
};

struct RunCurves {
  std::string task;              ///< as scenes name it
  bool has_goal = false;         ///< distances are those to a goal; else to the hand
  Curve cost;                    ///< of the plan that is being executed; each holds until the next one
  Curve distance;                ///< m, as the task measures how far it is from its end
  Curve hand_speed;              ///< m/s, of the hand's frame
  std::uint64_t unreadable = 0;  ///< states of the bag that cannot be read
  Curve target_speed;            ///< m/s, of the target's centre
  Curve idle;  ///< s that the robot stood still before each action but the first, at the action's end; none of old bags
};

/// Makes the curves of a run.
/// Errors   kInvalidArgument  its scene cannot be read; those of RecordedMotion::read
Result<RunCurves> curves_of(BagReader& reader, const RecordedRun& run);

}  // namespace jostle::bags
