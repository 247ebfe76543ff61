#pragma once
/// \file
/// Predictors by name: what plans are made with.

#include <functional>
#include <memory>
#include <string>

#include "idl/types/result.hpp"
#include "physics_pool/parareal/parareal_pool.hpp"

namespace jostle::task {

/// A Predictor stands between planner and pool: plans are made with the pool that it gives out.
class Predictor {
 public:
  /// Makes a predictor from `text`, where MODEL is one of make_coarse_model's names, or `learned` for the
  /// network that comes along (default: planar):
  ///
  ///   fine                      the pool itself
  ///   coarse[,MODEL]            the coarse model alone
  ///   parareal:K[,MODEL]        K iterations of Parareal
  ///   parareal:adaptive[,…]     until an iteration moves nothing by 8.10 mm or 4.20 degrees
  ///   parareal:…,split          whole rollouts or slices, whichever is quicker on the workers there are
  ///
  /// `on_split` hears what a split chose and why.
  /// Error kInvalidArgument naming what was got and what is wanted.
  static Result<Predictor> make(const std::string& text, physics_pool::AsyncPool& pool,
                                std::function<void(const std::string&)> on_split = {});

  /// Makes the same checks without a pool, and checks that the model fits the scene.
  static Result<void> check(const std::string& text, const physics_pool::Scene& scene);

  physics_pool::Pool& pool() { return parareal_ ? static_cast<physics_pool::Pool&>(*parareal_) : engine_; }

 private:
  explicit Predictor(physics_pool::AsyncPool& engine) : engine_(engine) {}

  physics_pool::AsyncPool& engine_;
  std::unique_ptr<physics_pool::PararealPool> parareal_;  // null: fine
};

}  // namespace jostle::task
