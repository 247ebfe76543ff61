#pragma once
/// \file
/// What each lever that makes physics cheaper gains, and what it costs in truth.

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "physics_pool/api/pool.hpp"
#include "planners/control/controller.hpp"
#include "planners/pbsto/pbsto.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/studies/bench/convergence.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

/// A lever is a way to plan. The first of a list is what the others are compared with.
struct Lever {
  std::string name;
  planners::PbstoOptions options;
};

/// Returns plain (Sec. 3.3.1: 8 rollouts, full physics); freeze, screening and hopeless alone,
/// each as `shipped` has it; and all: `shipped` itself.
std::vector<Lever> usual_levers(const planners::PbstoOptions& shipped);

struct CheapPhysicsOptions {
  std::vector<Lever> levers;
  /// What to measure: any of speed, truth, success, demo, peers.
  std::vector<std::string> parts{"speed", "truth", "success", "demo", "peers"};
  physics_pool::Objective objective = physics_pool::Objective::standard();
  planners::ControlOptions control;       ///< initial_steps, many_iterations and step_duration
  std::vector<int> sizes{5, 10, 15, 40};  ///< objects beside the target
  int worlds = 3;                         ///< worlds of each size, seeds 1 to this
  int repeats = 3;                        ///< measurements of speed in each world
  int iterations = 2;                     ///< iterations of a planner whose speed is measured
  std::uint32_t samples = 16;             ///< samples per world whose costs and poses are compared
  int executed_objects = 15;              ///< objects of the worlds that are planned and executed
  int executed_worlds = 20;               ///< seeds 1 to this
  int large_iterations = 12;              ///< iterations of plans in worlds of more objects, which take minutes
  std::vector<physics_pool::Scene> demo;  ///< scenes that are planned only, with each of demo_seeds
  int demo_seeds = 5;
  std::uint64_t peer_rollouts = 150;  ///< budget of each peer in each world
  WorkLine* line = nullptr;           ///< where it is shown how far the work has come; null: nowhere
};

/// One lever in worlds of one size. Ratios are to the first lever.
struct LeverResult {
  std::string name;
  int objects = 0;
  std::vector<double> ratios;        ///< candidates per second, losers not stopped; one per world and repeat
  std::vector<double> correlations;  ///< per world: Spearman's, of costs in the first ranking and with full physics
  std::vector<double> pose_errors;   ///< m, last position of each object that full physics moved by 1 mm
  int planned = 0, executed = 0, worlds = 0;  ///< success predicted; success in the full world
  std::vector<double> time_ratios;            ///< seconds to success, first lever's / this one's, where both planned
  int denials = 0;                            ///< successes it claimed that full physics denied, over all worlds
  int same_plans = 0;                         ///< plans that are the first lever's, bit for bit
};

/// The demo's scene with one seed.
struct DemoPlan {
  std::string lever;
  std::uint64_t seed = 0;
  bool planned = false;
  double seconds = 0.0;
};

struct CheapPhysics {
  std::vector<LeverResult> levers;
  std::vector<DemoPlan> demo;
  bool complete = true;  ///< no stop was requested
};

/// Levers take turns in every world, so that what disturbs the machine for a while
/// disturbs all. Plans are executed open loop in the full world, undisturbed: what
/// full physics has predicted is what happens, so `executed` falls behind `planned`
/// only if a plan was believed that full physics never saw. After a stop request it returns what was measured until
/// then. Errors   those of the pool and of Planner::plan
Result<CheapPhysics> measure_cheap_physics(physics_pool::Pool& pool, const CheapPhysicsOptions& options,
                                           std::stop_token stop);

/// Returns Spearman's rank correlation, ties at their mean rank; NaN for fewer than two
/// pairs or for constant values.
double rank_correlation(const std::vector<double>& a, const std::vector<double>& b);

std::string to_text(const CheapPhysics& results);
nlohmann::json to_json(const CheapPhysics& results);

/// `jostle bench cheap-physics`: measures, prints, writes. Files may be empty. After a stop request it prints and
/// writes what was measured until then. Error kCancelled after that; else those of measure_cheap_physics and of the
/// files
struct CheapPhysicsFiles {
  std::filesystem::path json, plot;
};
Result<void> bench_cheap_physics(CheapPhysicsOptions options, const CheapPhysicsFiles& files,
                                 const std::filesystem::path& parameters, std::stop_token stop);

}  // namespace jostle::studies
