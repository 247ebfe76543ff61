#pragma once
/// \file
/// Candidates of different speeds: straight lines to the goal in fewer or more actions (Alg. 7).

#include <vector>

#include "idl/types/state.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::planners {

/// Returns n^k = ceil((n_max - n_min)/(N - 1)·k) + n_min for k = 0 … N - 1: from the fewest actions to the most.
/// Source   line 2 of Alg. 7, which divides by 0 where N is 1: there the count is n_min.
/// 1 <= n_min <= n_max, N >= 0.
std::vector<int> action_counts(int n_min, int n_max, int sequences);

/// Where a straight line to the goal leads, in the plane.
struct StraightWay {
  double dx = 1.0, dy = 0.0;  ///< unit direction
  double length = 0.0;        ///< m, that the robot has to go
};

/// Returns the straight way of a task from state x:
///
///   push    from the tool towards the middle of the goal region; as far as the target is from there, and the free
///           way until the tool touches the target
///   others  from the tool to the target, as far as the task asks for it to come
///
/// The tool touches with its fingertips, or with its palm what fits between the fingers; a disc with its side.
StraightWay straight_way(const physics_pool::TaskGeometry& geometry, const State& x);

/// Returns N sequences with the counts of action_counts(), each of a constant velocity along the straight way, so that
/// all of them end at its end: length/(n^k·Delta_t) (line 3 of Alg. 7). No axis is asked for more than `limit` ([nu],
/// m/s and rad/s); a sequence that would be too fast goes less far. The hand neither turns nor opens.
std::vector<ControlSequence> action_sequences(const physics_pool::TaskGeometry& geometry, const State& x, int n_min,
                                              int n_max, int sequences, double step_duration,
                                              const std::vector<double>& limit);

}  // namespace jostle::planners
