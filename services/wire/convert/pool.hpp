#pragma once
/// \file
/// The pool's words on the wire and back, bit for bit.

#include "idl/msg/pool.h"
#include "idl/types/result.hpp"
#include "physics_pool/api/rollout.hpp"

namespace jostle::wire {

jostle_msgs::msg::WorldHash to_wire(const Hash& hash);
Hash from_wire(const jostle_msgs::msg::WorldHash& wire);

jostle_msgs::msg::BatchDescription to_wire(const physics_pool::RolloutBatch& batch);

/// Never fails: whatever the wire holds becomes a batch, to be judged by
/// physics_pool::validate.
physics_pool::RolloutBatch from_wire(jostle_msgs::msg::BatchDescription wire);

/// Converts the outcome only; the sender fills in who asked and who answers.
jostle_msgs::msg::AssignmentResult to_wire(const physics_pool::RolloutOutcome& outcome);

/// Errors   the worker's own, if it refused the assignment
///          kInvalidArgument  `end`, `cost`, `step_costs` or `trajectory` make no sense
Result<physics_pool::RolloutOutcome> from_wire(jostle_msgs::msg::AssignmentResult wire);

}  // namespace jostle::wire
