#pragma once
/// \file
/// Batches that are quick to run and easy to judge.

#include <gtest/gtest.h>

#include <vector>

#include "idl/types/hash.hpp"
#include "physics_pool/api/pool.hpp"
#include "physics_pool/scenarios/chapter3.hpp"

namespace jostle::tests {

/// Three objects of Sec. 3.3.1 on their table.
inline physics_pool::Scene small_scene(std::uint64_t seed = 1) {
  auto scene_result = physics_pool::generate_chapter3({.objects = 2, .seed = seed});
  if (!scene_result) throw std::runtime_error(scene_result.error().message);
  return std::move(scene_result).value();
}

/// `samples` noisy straight pushes of three steps of 0.2 s.
inline physics_pool::RolloutBatch push_batch(const physics_pool::Scene& scene, std::uint32_t samples) {
  physics_pool::RolloutBatch batch;
  batch.world = physics_pool::scene_hash(scene);
  batch.x0 = physics_pool::initial_state(scene);
  const auto nu = static_cast<std::size_t>(physics_pool::layout_of(scene).nu);
  const auto axes = [nu](std::vector<double> values) {
    values.resize(nu, values.back());
    return values;
  };  // a pusher has two, an arm more
  batch.nominal.nu = static_cast<int>(nu);
  for (int t = 0; t < 3; ++t) batch.nominal.append(axes({0.1, 0.0, 0.0, 0.0}));
  batch.u_before.assign(nu, 0.0);
  batch.step_duration = 0.2;
  batch.law = {.sigma = axes({0.04, 0.04, 0.25, 0.01}), .limit = axes({0.15, 0.15, 0.8, 0.05}), .seed = 42};
  batch.samples = samples;
  return batch;
}

/// `samples` pauses of `time` each, without physics.
inline physics_pool::RolloutBatch wait_batch(const physics_pool::Scene& scene, std::uint32_t samples,
                                             std::chrono::nanoseconds time) {
  physics_pool::RolloutBatch batch = push_batch(scene, samples);
  batch.wait = time;
  return batch;
}

/// The bits of an outcome that must not depend on who ran it.
inline Hash fingerprint(const physics_pool::RolloutOutcome& outcome) {
  std::vector<double> all{static_cast<double>(outcome.sample), static_cast<double>(outcome.end), outcome.cost,
                          static_cast<double>(outcome.at_goal)};
  all.insert(all.end(), outcome.step_costs.begin(), outcome.step_costs.end());
  for (const State& x : outcome.trajectory) {
    all.insert(all.end(), x.q.begin(), x.q.end());
    all.insert(all.end(), x.v.begin(), x.v.end());
  }
  return hash_of(all);
}

/// Of the winner; empty without one.
inline Hash winner_fingerprint(const physics_pool::BatchReply& reply) {
  if (reply.winner < 0) return {};
  return fingerprint(reply.outcomes[static_cast<std::size_t>(reply.winner)]);
}

/// Of every outcome, in order.
inline std::vector<Hash> fingerprints(const physics_pool::BatchReply& reply) {
  std::vector<Hash> hashes;
  for (const auto& outcome : reply.outcomes) hashes.push_back(fingerprint(outcome));
  return hashes;
}

}  // namespace jostle::tests
