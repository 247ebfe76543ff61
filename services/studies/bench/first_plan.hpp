#pragma once
/// \file
/// How long first plans and re-plans of grasps take, without and with guidance.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct FirstPlanOptions {
  int worlds = 100;                 ///< fresh ones of Sec. 3.3.1, without uncertainty
  std::uint64_t first_seed = 1001;  ///< of the worlds: seeds up to 999 are for tuning
  int objects = 15;                 ///< beside the target
  double table = 0.0;               ///< m, its side; 0: as dense as in Sec. 3.3.1
  int workers = 2;                  ///< threads of the pool
  double timeout = 60.0;            ///< s, planning and acting of one run
  int guidance = 600;               ///< candidates of the side with guidance
  bool before = true;               ///< run the side without guidance, too
  WorkLine* line = nullptr;         ///< never null
};

/// One plan, however it ended.
struct TimedPlan {
  double seconds = 0.0;
  std::uint64_t engine_steps = 0;
};

/// All runs of one side.
struct FirstPlanSide {
  std::string name;
  int worlds = 0, solved = 0;             ///< solved: the target was grasped
  int planned = 0;                        ///< a first plan that reaches the target
  std::vector<TimedPlan> first, replans;  ///< first: one per world, those that failed with the time that they took
};

/// Runs the controller `or` with the parameters of `jostle run` in every world, the sides in turns: without guidance,
/// if asked for, then with it. After a stop request it returns what was measured until then. Errors   those of the
/// scenes, the pool and the controller
Result<std::vector<FirstPlanSide>> measure_first_plans(const FirstPlanOptions& options,
                                                       const std::filesystem::path& parameters, std::stop_token stop);

std::string to_text(const std::vector<FirstPlanSide>& sides);

/// Returns fields worlds, solved, plan_seconds, replan_seconds, plan_engine_steps and replan_engine_steps (each median,
/// p90, and all values) of the last side, and the same of the first, if there are two, under `before`.
nlohmann::json to_json(const std::vector<FirstPlanSide>& sides, const FirstPlanOptions& options);

/// `jostle bench first-plan`: measures, prints, writes. Error kCancelled after a stop request, with what was measured
/// written as partial
Result<void> bench_first_plan(const FirstPlanOptions& options, const std::filesystem::path& json,
                              const std::filesystem::path& parameters, std::stop_token stop);

}  // namespace jostle::studies
