#pragma once
/// \file
/// Estimates as ROS 2's tools show them.

#include <vector>

#include "idl/msg/vision.h"
#include "perception/estimator/estimator.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::world {

/// Returns a detection for each object: its name as `id` and class, its pose with covariance, and as its box what the
/// scene says; of size 0 where `scene` is null or has no such object. Its own stamp is when it was seen last; the score
/// is 1, or 0 while it is unseen. `time`: s, of the poses.
vision_msgs::msg::Detection3DArray detections_message(const std::vector<perception::Estimate>& estimates, double time,
                                                      const physics_pool::Scene* scene);

}  // namespace jostle::world
