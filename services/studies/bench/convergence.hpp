#pragma once
/// \file
/// How fast planners get cheaper plans: cost reached against rollouts spent and
/// against seconds.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "physics_pool/api/pool.hpp"
#include "planners/api/planner.hpp"

namespace jostle::studies {

struct ConvergenceOptions;

/// A planner that takes part.
struct Contender {
  std::string name;
  std::function<std::unique_ptr<planners::Planner>(physics_pool::Pool&, const ConvergenceOptions&,
                                                   planners::OnProgress)>
      make;
};

/// Returns PBSTO greedy (the thesis's) and cost-weighted, predictive sampling, MPPI, CEM
/// and iCEM-like, in this order. All have their default options but for what
/// ConvergenceOptions says and for the peers' one sigma: it gives their noise the
/// variance that PBSTO's has over its scales.
std::vector<Contender> usual_contenders();

struct ConvergenceOptions {
  std::vector<Contender> contenders = usual_contenders();
  std::uint64_t rollouts = 400;         ///< a search ends after the iteration that reaches it, >= 1
  std::vector<std::uint64_t> seeds{1};  ///< the noise's; every world is searched with each
  /// Rollouts per iteration; for iCEM, in the first one. CEM fits a deviation to a
  /// quarter of them, which asks for more than the thesis's 8.
  int batch = 16;
  int steps = 6;                    ///< n of the straight line that all begin with, >= 1
  double step_duration = 1.0;       ///< Delta_t, s
  physics_pool::Fidelity fidelity;  ///< that of every rollout whose planner asks for no other
  /// The objective's success_cost does not count: it becomes 0, which no rollout that moves
  /// the hand reaches, so that nobody ends early. A search that succeeds after
  /// ten rollouts would say nothing about the next three hundred.
  physics_pool::Objective objective = physics_pool::Objective::standard();
};

struct CurvePoint {
  std::uint64_t rollouts = 0;
  double seconds = 0.0;  ///< since the search began
  double cost = 0.0;     ///< that of the best sequence so far; +inf until one was scored
};

/// One search; its first point is the straight line's.
struct Curve {
  std::string method;
  std::string world;
  std::uint64_t seed = 0;
  std::vector<CurvePoint> points;
};

/// Called after each curve: `done` of `total` curves are done.
using OnCurve = std::function<void(const Curve&, std::size_t done, std::size_t total)>;

/// Lets all contenders search every scene with every seed, one after the other
/// and in turns, so that what disturbs the machine for a while disturbs all.
/// Errors   kInvalidArgument  nothing to measure
///          kCancelled        a stop was requested
///          those of the pool and of Planner::plan
Result<std::vector<Curve>> measure_convergence(physics_pool::Pool& pool, const std::vector<physics_pool::Scene>& scenes,
                                               const ConvergenceOptions& options, const OnCurve& on_curve = {},
                                               std::stop_token stop = {});

enum class Spent { kRollouts, kSeconds };

/// A Summary joins one method's curves over worlds and seeds. Costs are parts of the straight line's.
struct Summary {
  std::string method;
  std::vector<double> x;                  ///< rollouts or s, evenly spaced on a logarithmic scale
  std::vector<double> low, median, high;  ///< quartiles at each x
};

/// Summarizes methods, in the order of their first curves. A curve is a staircase: it has
/// the cost of its last point at or before x, 1 before its first, and keeps its
/// last cost once it has ended. Rollouts go up to the largest number spent,
/// seconds up to the method's median. Curves whose straight line diverged have
/// nothing to be compared with and are left out.
std::vector<Summary> summarize(const std::vector<Curve>& curves, Spent spent, int points = 120);

/// Writes {"curves": [{method, world, seed, rollouts: [...], seconds: [...], cost: [...]}]};
/// an infinite cost is null.
nlohmann::json to_json(const std::vector<Curve>& curves);

/// Draws two panels, over rollouts and over seconds. Errors are those of plot().
Result<void> plot_convergence(const std::vector<Curve>& curves, const std::filesystem::path& png);

}  // namespace jostle::studies
