#include <algorithm>
#include <thread>

#include "physics_pool/local/thread_pool.hpp"
#include "services/bench/benchmarks.hpp"
#include "services/bench/workload.hpp"

namespace jostle::services {
namespace {

using physics_pool::BatchReply;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

// Of the plan a batch leaves its caller with: the winner's controls and states.
Hash hash_of_plan(const RolloutBatch& batch, const BatchReply& reply) {
  if (reply.winner < 0) return {};
  const RolloutOutcome& winner = reply.outcomes[static_cast<std::size_t>(reply.winner)];
  const ControlSequence controls = physics_pool::sample_controls(batch.nominal, batch.law, winner.sample);
  std::vector<State> plan = winner.trajectory;
  plan.push_back({.q = controls.values});
  return hash_of_states(plan);
}

// The second iteration of a plan: noise around the first one's winner, whose
// cost is the one to beat.
Result<RolloutBatch> second_iteration(physics_pool::Pool& pool, RolloutBatch batch, std::stop_token stop) {
  auto first_result = pool.run(batch, std::chrono::steady_clock::now() + kPatience, stop);
  if (!first_result) return first_result.error();
  if (first_result->winner < 0) return Error{Code::kInternal, "early-stop: every rollout diverged"};
  const RolloutOutcome& winner = first_result->outcomes[static_cast<std::size_t>(first_result->winner)];
  batch.nominal = physics_pool::sample_controls(batch.nominal, batch.law, winner.sample);
  batch.incumbent = winner.cost;
  batch.law.stream = 1;
  return batch;
}

// One batch, in rollouts per second; adds the engine steps it took.
Result<Sample> time_rollouts(physics_pool::Pool& pool, const RolloutBatch& batch, double& steps,
                             std::stop_token stop) {
  const auto start = std::chrono::steady_clock::now();
  auto reply_result = pool.run(batch, start + kPatience, stop);
  const double seconds = seconds_since(start);
  if (!reply_result) return reply_result.error();
  for (const RolloutOutcome& outcome : reply_result->outcomes) steps += static_cast<double>(outcome.engine_steps);
  return Sample{.value = batch.samples / seconds, .hash = hash_of_plan(batch, *reply_result)};
}

}  // namespace

Result<Measurements> measure_early_stop(const Settings& settings) {
  auto scene_result = clutter(15);
  if (!scene_result) return scene_result.error();
  physics_pool::ThreadPool pool(static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u)));
  if (auto loaded = pool.load(*scene_result); !loaded) return loaded.error();
  auto batch_result = second_iteration(pool, push(*scene_result, 6, 1.0, 8), settings.stop);
  if (!batch_result) return batch_result.error();
  const RolloutBatch& patient = *batch_result;
  RolloutBatch stopping = patient;
  stopping.stop_losers = true;

  double steps_stopping = 0.0, steps_patient = 0.0;
  auto result = compare(
      {"losers stopped", [&] { return time_rollouts(pool, stopping, steps_stopping, settings.stop); }},
      {"all to the end", [&] { return time_rollouts(pool, patient, steps_patient, settings.stop); }},
      settings.repeats, settings.stop);
  if (!result) return result.error();
  result->name = "early-stop";
  result->unit = "rollouts/s";
  result->details = {{"steps_saved", 1.0 - steps_stopping / steps_patient},
                     {"winner_found", result->hash_b.empty() ? 0.0 : 1.0}};
  return Measurements{*std::move(result)};
}

}  // namespace jostle::services
