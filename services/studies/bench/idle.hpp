#pragma once
/// \file
/// How long a robot stands still before its actions, with plans made while it stands and while it acts.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct IdleOptions {
  /// Of idle_rows(); empty: all.
  std::vector<std::string> rows;
  int worlds = 8;                  ///< of each row, and one run of each side in each
  std::uint64_t first_seed = 901;  ///< of the worlds: seeds up to 999 are for tuning
  double nearness = 0.01;          ///< m, plan_while_acting of the side that has it: see planners::ControlSetup
  double noise = 0.05;             ///< b of the worlds of Ch. 5, which their planner believes in
  double rate = 1.0;               ///< world seconds per second while acting
  int workers = 2;                 ///< threads of the pool
  double timeout = 180.0;          ///< s, planning and acting of one run
  WorkLine* line = nullptr;        ///< never null
};

/// One run.
struct IdleRun {
  std::uint64_t seed = 0;
  bool success = false;
  std::string reason;
  int actions = 0, plans_ahead = 0, taken_ahead = 0;
  std::uint64_t rollouts = 0, abandoned_rollouts = 0;
  double seconds = 0.0;      ///< of the run, by the clock
  std::vector<double> idle;  ///< s before each action but the first
};

/// A controller in worlds of one kind.
struct IdleRow {
  std::string name, controller, world;
  std::vector<IdleRun> before, after;  ///< plans made while the robot stands; and while it acts
};

/// Returns the names of all rows: a controller, and where it acts.
std::vector<std::string> idle_rows();

/// Runs both sides in every world, in turns, each beginning every other world. A world keeps time with the clock while
/// a robot acts. After a stop request it returns what was measured until then.
/// Errors   those of the scenes, the pool and the controllers
Result<std::vector<IdleRow>> measure_idle(const IdleOptions& options, std::stop_token stop);

std::string to_text(const std::vector<IdleRow>& rows);
nlohmann::json to_json(const std::vector<IdleRow>& rows, const IdleOptions& options);

/// `jostle bench idle`: measures, prints, writes. Error kCancelled after a stop request, with what was measured written
/// as partial
Result<void> bench_idle(const IdleOptions& options, const std::filesystem::path& json, std::stop_token stop);

}  // namespace jostle::studies
