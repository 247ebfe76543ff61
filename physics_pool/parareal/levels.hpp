#pragma once
/// \file
/// Every iteration of one prediction: what studies of Parareal look at.

#include <stop_token>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "physics_pool/parareal/iteration.hpp"

namespace jostle::physics_pool {

/// Describes F(start, u) as a batch of one rollout of one step. It takes world, step duration and fidelity
/// from the batch `of`.
RolloutBatch slice_batch(const RolloutBatch& of, const State& start, std::span<const double> u);

/// Predicts the trajectories of k = 0 … N iterations for the nominal controls of a batch, one
/// slice after the other on `pool`. The last one is the serial fine model's.
/// Errors   those of Pool::run
///          kInternal  a slice diverged, or a coarse prediction is not finite; says why
Result<std::vector<Trajectory>> predict_levels(Pool& pool, const RolloutBatch& batch, const PlanarUpdate& update,
                                               CoarseModel& coarse, TimePoint deadline, std::stop_token stop = {},
                                               double correction_limit = PararealStop{}.correction_limit);

}  // namespace jostle::physics_pool
