#pragma once
/// \file
/// How a joint moves what hangs on it.

#include "idl/types/transform.hpp"
#include "physics_pool/robot/robot_model.hpp"

namespace jostle::physics_pool {

/// Moves a frame X that hangs on a joint by `value`, m or rad, along or about the joint's axis.
void move(Eigen::Isometry3d& X, const Joint& joint, double value);

}  // namespace jostle::physics_pool
