#pragma once
/// \file
/// A batch of rollouts, described rather than shipped, and what comes back.

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/hash.hpp"
#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/api/objective.hpp"

namespace jostle::physics_pool {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// How sample k's controls follow from the nominal ones:
///
///   u[k][t][i] = clamp(U[t][i] + scales[k mod m]·sigma[i]·z, -limit[i], +limit[i])
///   z = standard normal, a pure function of (seed, stream, k, t, i)
///
/// Any worker can make any sample; sigma = 0 gives the clamped nominal controls.
struct SamplingLaw {
  std::vector<double> sigma;  ///< [nu] standard deviations, m/s and rad/s, >= 0
  std::vector<double> limit;  ///< [nu] largest magnitudes, m/s and rad/s, > 0
  /// [m] factors of sigma, dealt out to the samples in turn, >= 0: a batch can
  /// refine and explore at once.
  std::vector<double> scales{1.0};
  std::uint64_t seed = 0;
  std::uint32_t stream = 0;  ///< the planner's iteration: same seed, fresh noise
};

/// K rollouts of n control steps from one state.
struct RolloutBatch {
  Hash world;                   ///< of a scene given to Pool::load
  State x0;                     ///< [nq], [nv]
  ControlSequence nominal;      ///< [n][nu]
  std::vector<double> u_before; ///< [nu] control before step 0, for c_a; the thesis's u_{-1} = 0
  double step_duration = 1.0;   ///< Delta_t, seconds; a multiple of the world's time step
  SamplingLaw law;
  std::uint32_t first_sample = 0;
  std::uint32_t samples = 1;  ///< K >= 1
  Objective objective;
  /// Cost to beat: a rollout that can no longer get below it, nor succeed, stops.
  double incumbent = kInfinity;
  bool stop_losers = true;       ///< off: every rollout runs to its end
  bool stop_on_success = false;  ///< Alg. 1, lines 8-9
  int min_steps = 0;             ///< n_min: success counts from this control step (0-based) on
  bool want_all_trajectories = false;
  /// Scheduling studies only: wait this long per rollout and simulate nothing.
  std::optional<std::chrono::nanoseconds> wait;
};

/// Why a rollout ended.
enum class End : std::uint8_t {
  kCompleted,  ///< ran all its steps
  kSucceeded,  ///< reached success and stopped there
  kLost,       ///< could no longer win
  kDiverged,   ///< the engine produced a non-finite state or ran out of room
  kSkipped,    ///< not run: a sample with a lower index had succeeded
};

struct RolloutOutcome {
  std::uint32_t sample = 0;
  End end = End::kSkipped;
  double cost = kInfinity;         ///< total of Eq. 3.2; +inf unless completed or succeeded
  std::uint32_t steps = 0;         ///< control steps whose cost is known
  std::uint64_t engine_steps = 0;  ///< physics steps spent
  bool grasped = false;            ///< target in the pre-grasp region at the last state
  std::vector<double> step_costs;  ///< [steps]; the last one carries the goal cost
  Trajectory trajectory;           ///< [steps + 1], or empty if not asked for
  std::string reason;              ///< why it diverged
};

/// Everything a batch gave, in sample order.
struct BatchReply {
  std::vector<RolloutOutcome> outcomes;  ///< [K]
  /// Index into outcomes of the success with the lowest sample index, else of
  /// the lowest cost below the incumbent (lowest index on ties), else -1. Its
  /// trajectory is always present.
  int winner = -1;
};

/// Controls of one sample, bit for bit what the workers ran.
ControlSequence sample_controls(const ControlSequence& nominal, const SamplingLaw& law,
                                std::uint32_t sample);

/// Chooses BatchReply::winner.
int select_winner(const std::vector<RolloutOutcome>& outcomes, double incumbent);

/// Checks everything that can be checked without the world. `layout` adds the
/// checks of sizes that need it.
/// Errors   kInvalidArgument, naming the field, what it got and what it wanted.
Result<void> validate(const RolloutBatch& batch);
Result<void> validate(const RolloutBatch& batch, const StateLayout& layout, double time_step);

/// Limits that no sane batch reaches; what is beyond them is refused, not tried.
inline constexpr std::uint32_t kMaxSamples = 1'000'000;
inline constexpr int kMaxSteps = 10'000;
inline constexpr double kMaxStepDuration = 60.0;         // seconds
inline constexpr std::size_t kMaxStateSize = 100'000;    // numbers in q or v
inline constexpr std::size_t kMaxScales = 1'000;
inline constexpr std::chrono::seconds kMaxWait{10};

}  // namespace jostle::physics_pool
