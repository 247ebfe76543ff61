#include "physics_pool/parareal/levels.hpp"

#include "physics_pool/parareal/iteration.hpp"

namespace jostle::physics_pool {

RolloutBatch slice_batch(const RolloutBatch& of, const State& start, std::span<const double> u) {
  const std::size_t nu = u.size();
  return {.world = of.world,
          .x0 = start,
          .nominal = {.nu = static_cast<int>(nu), .values = {u.begin(), u.end()}},
          .u_before = std::vector<double>(nu, 0.0),
          .step_duration = of.step_duration,
          .law = {.sigma = std::vector<double>(nu, 0.0), .limit = std::vector<double>(nu, kInfinity)},
          .objective = of.objective,
          .stop_losers = false,
          .want_all_trajectories = true,
          .fidelity = of.fidelity,
          .priority = of.priority};
}

Result<std::vector<Trajectory>> predict_levels(Pool& pool, const RolloutBatch& batch, const PlanarUpdate& update,
                                               CoarseModel& coarse, TimePoint deadline, std::stop_token stop,
                                               double correction_limit) {
  const int steps = batch.nominal.steps();
  PararealIteration iteration(update, coarse, batch.x0, batch.nominal, batch.step_duration,
                              {.iterations = steps, .correction_limit = correction_limit});
  std::vector<double> planar(static_cast<std::size_t>(update.planar_layout().size()));
  for (int n = 0; n < steps; ++n) {
    iteration.next_start(planar);
    coarse.advance(planar, batch.nominal.step(n), batch.step_duration);
    iteration.guess(planar);
  }
  while (!iteration.done() && iteration.problem().empty()) {
    for (const PararealIteration::Slice& slice : iteration.take_ready()) {
      auto reply_result = pool.run(slice_batch(batch, *slice.start, batch.nominal.step(slice.step)), deadline, stop);
      if (!reply_result) return reply_result.error();
      RolloutOutcome& outcome = reply_result->outcomes.front();
      if (outcome.end == End::kDiverged) {
        return Error{Code::kInternal, "slice of one step: " + outcome.reason};
      }
      iteration.complete(slice.id, std::move(outcome.trajectory.back()));
    }
  }
  if (!iteration.problem().empty()) return Error{Code::kInternal, iteration.problem()};
  std::vector<Trajectory> levels;
  for (int k = 0; k <= steps; ++k) levels.push_back(iteration.states(k));
  return levels;
}

}  // namespace jostle::physics_pool
