#include "physics_pool/local/rollout.hpp"

#include <cmath>

#include "physics_pool/api/tally.hpp"
#include "physics_pool/objective/bound.hpp"

namespace jostle::physics_pool {
namespace {

// Waits as a scheduling study asks. It costs next to nothing, so that a thousand threads may wait on one machine.
RolloutOutcome wait_instead(const RolloutBatch& batch, std::uint32_t sample, BatchSignals& signals) {
  if (!signals.wait_until(std::chrono::steady_clock::now() + *batch.wait, sample)) return {.sample = sample};
  return {.sample = sample, .end = End::kCompleted, .cost = 0.0};
}

}  // namespace

RolloutOutcome run_rollout(Dynamics& dynamics, const RolloutBatch& batch, std::uint32_t sample, BatchSignals& signals) {
  if (batch.wait) return wait_instead(batch, sample, signals);

  const TaskGeometry& geometry = dynamics.world().geometry();
  const Objective& objective = batch.objective;
  const ControlSequence controls = sample_controls(batch.nominal, batch.law, sample);
  const int steps = controls.steps();
  const int engine_steps = static_cast<int>(std::lround(batch.step_duration / dynamics.time_step()));
  const int rest_steps = static_cast<int>(std::lround(batch.rest / dynamics.time_step()));
  const std::vector<double> no_control(static_cast<std::size_t>(controls.nu), 0.0);
  const auto obsolete = [&signals, sample] { return signals.is_obsolete(sample); };

  RolloutOutcome outcome{.sample = sample};
  Tally tally(geometry, batch, controls, outcome);
  State x = batch.x0;
  const auto finish = [&](End end) {
    tally.close(end);
    return std::move(outcome);
  };

  const auto advance_by = [&](std::span<const double> u, int engine_steps_of_it) {
    Advance advance =
        dynamics.advance(x, u, engine_steps_of_it, obsolete,
                         {.noise = batch.noise, .stream = {.sample = sample}, .first_step = outcome.engine_steps});
    outcome.engine_steps += advance.engine_steps;
    outcome.thawed += advance.thawed;
    return advance;
  };

  for (int t = 0; t < steps; ++t) {
    const auto u = std::as_const(controls).step(t);
    Advance advance = advance_by(u, engine_steps);
    if (rest_steps > 0 && !advance.interrupted && advance.diverged.empty()) {
      const StepFacts before = advance.facts;
      advance = advance_by(no_control, rest_steps);
      advance.facts.robot_hit_fixture |= before.robot_hit_fixture;
    }
    if (advance.interrupted) return finish(End::kSkipped);
    if (!advance.diverged.empty()) {
      outcome.reason = std::move(advance.diverged);
      return finish(End::kDiverged);
    }
    if (const std::optional<End> end = tally.count(x, advance.facts)) {
      if (*end == End::kSucceeded) signals.offer_success(sample);
      if (*end == End::kCompleted) signals.offer_cost(tally.sum());
      return finish(*end);
    }
    if (!batch.stop_losers) continue;
    const double sum = tally.sum();
    const bool can_succeed = batch.stop_on_success && sum <= objective.success_cost;
    if (!can_succeed && (sum >= batch.incumbent || sum > signals.best())) return finish(End::kLost);
    // Never against a sibling, whose news come sooner or later: should the bound's
    // assumption fail, the plan is another one, but the same one everywhere.
    if (!batch.stop_hopeless) continue;
    const Outlook ahead = outlook(geometry, objective, controls, t + 1, u, x, batch.step_duration);
    if (!(can_succeed && ahead.may_succeed) && sum + ahead.cost >= batch.incumbent) return finish(End::kLost);
  }
  return finish(End::kCompleted);  // no steps at all: a batch has at least one
}

}  // namespace jostle::physics_pool
