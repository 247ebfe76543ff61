#pragma once
/// \file
/// Candidates: sequences of controls that a hand might try, from several families.

#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/state.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::planners {

/// What all candidates of a plan have in common.
struct CandidateLaw {
  std::vector<double> sigma, limit;  ///< [nu] m/s and rad/s, as those of PbstoOptions
  double step_duration = 1.0;        ///< s
  int min_steps = 2;                 ///< n_min: no way is shorter
  std::uint64_t seed = 0;
};

/// Names one candidate's random numbers. Two with different indices are independent.
struct CandidateIndex {
  std::uint32_t stream = 0;  ///< the planner's iteration
  std::uint32_t number = 0;  ///< of the candidate
};

/// Where a candidate may begin: at the plan's state with nothing decided, or where the engine has already been.
struct Beginning {
  const State* x = nullptr;                 ///< where what is drawn begins
  const ControlSequence* so_far = nullptr;  ///< the controls that lead there, its first `steps`; null: none
  int steps = 0;
};

/// Draws candidate `index` of n steps, n those of `line`, from one of these families, each of which is for a reason why
/// the straight line fails:
///
///   line       `line` with noise, white or persistent, of several sizes
///   approach   onto the target from another heading, which is taken up ahead of it
///   via        by way of a point beside the straight way
///   retreat    first back, so that what lies between the fingers stays behind, then an approach
///
/// A pure function of its arguments. Controls are within law.limit. The robot moves in the plane, turns and has a hand.
ControlSequence draw_candidate(const physics_pool::TaskGeometry& geometry, const CandidateLaw& law,
                               const ControlSequence& line, const Beginning& beginning, const CandidateIndex& index);

/// Returns `centre` with noise of `scale` times law.sigma, within law.limit.
ControlSequence draw_around(const CandidateLaw& law, const ControlSequence& centre, double scale,
                            const CandidateIndex& index);

/// Returns the largest distance of the hands of two sequences at the ends of their steps, m, as commanded.
double distance_between(const physics_pool::TaskGeometry& geometry, const ControlSequence& a, const ControlSequence& b,
                        double step_duration);

}  // namespace jostle::planners
