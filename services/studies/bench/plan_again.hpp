#pragma once
/// \file
/// One plan, made again and again.

#include <stop_token>

#include "physics_pool/scene/scene.hpp"
#include "planners/pbsto/pbsto.hpp"
#include "services/studies/bench/measurement.hpp"

namespace jostle::studies {

/// A search of Alg. 1 among five objects that is never content before its last
/// iteration. It gives the same plan each time, bit for bit, whatever becomes of the workers.
class PlanAgain {
 public:
  /// Loads the scene. Keeps a reference to the pool. Errors: those of Pool::load.
  static Result<PlanAgain> make(physics_pool::Pool& pool, int iterations);

  /// Plans once; returns the seconds, and the hash of controls, states and cost. Errors: those of Pool::run.
  Result<Sample> run(physics_pool::TimePoint deadline, std::stop_token stop) const;

 private:
  PlanAgain(physics_pool::Pool& pool, planners::Problem problem) : pool_(&pool), problem_(std::move(problem)) {}

  physics_pool::Pool* pool_;  // never null
  planners::Problem problem_;
};

}  // namespace jostle::studies
