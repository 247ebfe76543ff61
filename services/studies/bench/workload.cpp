#include "services/studies/bench/workload.hpp"

#include <atomic>
#include <cmath>
#include <future>

#include "physics_pool/scenarios/chapter3.hpp"
#include "services/studies/bench/benchmarks.hpp"

namespace jostle::studies {

using physics_pool::BatchReply;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;
using physics_pool::Simulator;

namespace {

int engine_steps(const Simulator& simulator, const RolloutBatch& batch) {
  return static_cast<int>(std::lround(batch.step_duration / simulator.world().time_step()));
}

State simulate(Simulator& simulator, const RolloutBatch& batch, std::uint32_t sample) {
  const ControlSequence controls = physics_pool::sample_controls(batch.nominal, batch.law, sample);
  const int steps = engine_steps(simulator, batch);
  State x = batch.x0;
  for (int t = 0; t < controls.steps(); ++t) {
    simulator.begin(x, controls.step(t));
    for (int i = 0; i < steps; ++i) simulator.step();
    simulator.read(x);
  }
  return x;
}

}  // namespace

Result<physics_pool::Scene> clutter(int objects) {
  return physics_pool::generate_chapter3({.objects = objects, .seed = 1});
}

RolloutBatch push(const physics_pool::Scene& scene, int steps, double step_duration, std::uint32_t samples) {
  RolloutBatch batch;
  batch.world = physics_pool::scene_hash(scene);
  batch.x0 = physics_pool::initial_state(scene);
  batch.nominal.nu = 4;
  for (int t = 0; t < steps; ++t) batch.nominal.append(std::vector{0.05, 0.0, 0.0, 0.0});
  batch.u_before.assign(4, 0.0);
  batch.step_duration = step_duration;
  batch.law = {.sigma = {0.04, 0.04, 0.25, 0.004}, .limit = {0.15, 0.15, 0.8, 0.05}, .seed = 1};
  batch.samples = samples;
  batch.stop_losers = false;
  return batch;
}

Hash hash_of_states(const std::vector<State>& states) {
  std::vector<double> all;
  for (const State& x : states) {
    all.insert(all.end(), x.q.begin(), x.q.end());
    all.insert(all.end(), x.v.begin(), x.v.end());
  }
  return hash_of(all);
}

Hash hash_of_last_states(const BatchReply& reply) {
  std::vector<State> last;
  for (const RolloutOutcome& outcome : reply.outcomes) {
    if (!outcome.trajectory.empty()) last.push_back(outcome.trajectory.back());
  }
  return hash_of_states(last);
}

Hash hash_of_answers(const std::vector<RolloutOutcome>& outcomes) {
  std::vector<double> all;
  for (const RolloutOutcome& outcome : outcomes) {
    all.insert(all.end(), {static_cast<double>(outcome.sample), static_cast<double>(outcome.end), outcome.cost});
  }
  return hash_of(all);
}

Result<Sample> time_steps(physics_pool::Pool& pool, const RolloutBatch& batch, std::stop_token stop) {
  const auto start = std::chrono::steady_clock::now();
  auto reply_result = pool.run(batch, start + kPatience, stop);
  const double seconds = seconds_since(start);
  if (!reply_result) return reply_result.error();
  double steps = 0.0;
  for (const RolloutOutcome& outcome : reply_result->outcomes) steps += static_cast<double>(outcome.engine_steps);
  return Sample{.value = steps / seconds, .hash = hash_of_last_states(*reply_result)};
}

BareLoops::BareLoops(const physics_pool::WorldPtr& world, int threads) {
  for (int i = 0; i < threads; ++i) simulators_.push_back(std::make_unique<Simulator>(world));
}

Sample BareLoops::run(const RolloutBatch& batch) {
  std::vector<State> last(batch.samples);
  std::atomic<std::uint32_t> next = 0;
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::future<void>> loops;
  for (const auto& simulator : simulators_) {
    loops.push_back(std::async(std::launch::async, [&last, &next, &batch, simulator = simulator.get()] {
      for (std::uint32_t i = next++; i < batch.samples; i = next++) {
        last[i] = simulate(*simulator, batch, batch.first_sample + i);
      }
    }));
  }
  for (std::future<void>& loop : loops) loop.get();
  const double seconds = seconds_since(start);
  const double steps =
      static_cast<double>(batch.samples) * batch.nominal.steps() * engine_steps(*simulators_.front(), batch);
  return {.value = steps / seconds, .hash = hash_of_states(last)};
}

}  // namespace jostle::studies
