#include <algorithm>
#include <thread>

#include "physics_pool/local/thread_pool.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using physics_pool::BatchReply;
using physics_pool::Pool;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

// What a plan is so far, and what it costs.
struct Candidate {
  ControlSequence controls;
  Trajectory states;
  double cost = physics_pool::kInfinity;
};

// A whole plan's batches in a row: noise around the best so far, whose cost is
// the one to beat.
struct Planning {
  Pool& pool;
  RolloutBatch first;
  int iterations = 0;
  std::stop_token stop;

  struct Outcome {
    Candidate best;
    std::uint64_t engine_steps = 0;
  };

  Result<Outcome> run(bool stop_losers) const {
    Outcome outcome{.best = {.controls = first.nominal}};
    for (int i = 0; i < iterations; ++i) {
      if (auto ok = improve(i, stop_losers, outcome); !ok) return ok.error();
    }
    return outcome;
  }

  // The first iteration scores the nominal controls as they are.
  Result<void> improve(int iteration, bool stop_losers, Outcome& outcome) const {
    RolloutBatch batch = first;
    batch.nominal = outcome.best.controls;
    batch.incumbent = outcome.best.cost;
    batch.law.stream = static_cast<std::uint32_t>(iteration);
    batch.stop_losers = stop_losers;
    if (iteration == 0) {
      batch.samples = 1;
      batch.law.scales = {0.0};
    }
    auto reply_result = pool.run(batch, std::chrono::steady_clock::now() + kPatience, stop);
    if (!reply_result) return reply_result.error();
    for (const RolloutOutcome& sample : reply_result->outcomes) outcome.engine_steps += sample.engine_steps;
    if (reply_result->winner < 0) return {};
    const RolloutOutcome& winner = reply_result->outcomes[static_cast<std::size_t>(reply_result->winner)];
    outcome.best = {.controls = physics_pool::sample_controls(batch.nominal, batch.law, winner.sample),
                    .states = winner.trajectory,
                    .cost = winner.cost};
    return {};
  }
};

Hash hash_of_plan(const Candidate& plan) {
  std::vector<State> all = plan.states;
  all.push_back({.q = plan.controls.values, .v = {plan.cost}});
  return hash_of_states(all);
}

// One whole plan, in rollouts per second; notes the engine steps it took.
Result<Sample> time_plan(const Planning& planning, bool stop_losers, std::uint64_t& engine_steps) {
  const auto start = std::chrono::steady_clock::now();
  auto outcome_result = planning.run(stop_losers);
  const double seconds = seconds_since(start);
  if (!outcome_result) return outcome_result.error();
  engine_steps += outcome_result->engine_steps;
  const double rollouts = 1.0 + (planning.iterations - 1.0) * planning.first.samples;
  return Sample{.value = rollouts / seconds, .hash = hash_of_plan(outcome_result->best)};
}

}  // namespace

Result<void> measure_early_stop(const Settings& settings) {
  settings.announce(1);
  auto scene_result = clutter(15);
  if (!scene_result) return scene_result.error();
  physics_pool::ThreadPool pool(static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u)));
  if (auto loaded = pool.load(*scene_result); !loaded) return loaded.error();
  Planning planning{.pool = pool, .first = push(*scene_result, 6, 1.0, 8), .iterations = 6, .stop = settings.stop};
  // The thesis's nu = 0.008 read as a variance: wide enough that some are lost early.
  planning.first.law.sigma[0] = planning.first.law.sigma[1] = 0.09;

  std::uint64_t steps_stopping = 0, steps_patient = 0;
  auto result =
      compare({"losers stopped", [&] { return time_plan(planning, true, steps_stopping); }},
              {"all to the end", [&] { return time_plan(planning, false, steps_patient); }}, settings.turns());
  if (!result) return result.error();
  result->name = "early-stop";
  result->unit = "rollouts/s";
  result->details = {{"steps_saved", 1.0 - static_cast<double>(steps_stopping) / static_cast<double>(steps_patient)}};
  settings.keep(*std::move(result));
  return {};
}

}  // namespace jostle::studies
