#pragma once
/// \file
/// A batch of rollouts, described rather than shipped, and what comes back.

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "idl/types/hash.hpp"
#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/objective/objective.hpp"
#include "physics_pool/objective/step_facts.hpp"
#include "physics_pool/sampling/velocity_noise.hpp"

namespace jostle::physics_pool {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A sampling law makes sample k's controls from the nominal ones U:
///
///   u[k][t][i] = clamp(U[t][i] + scales[d mod m]·sigma[t][i]·e[t][i], -limit[i], +limit[i])
///   e[t][i] = persistence·e[t-1][i] + sqrt(1 - persistence^2)·z,   e[0][i] = z
///   z = standard normal, a pure function of (seed, stream, d, t, i)
///   d = draws[k], or k without a list
///
/// Any worker can make any sample; sigma = 0 gives the clamped nominal controls.
struct SamplingLaw {
  /// [nu], the same for all steps, or [n][nu] row-major: standard deviations,
  /// m/s and rad/s, >= 0.
  std::vector<double> sigma;
  std::vector<double> limit;  ///< [nu] largest magnitudes, m/s and rad/s, > 0
  /// [m] factors of sigma, dealt out to the samples in turn, >= 0: a batch can
  /// refine and explore at once.
  std::vector<double> scales{1.0};
  std::uint64_t seed = 0;
  std::uint32_t stream = 0;  ///< the planner's iteration: same seed, fresh noise; below kSamplingStreams
  double persistence = 0.0;  ///< in [0, 1): how much of the noise the next step keeps; 0 is white
  /// Empty, or [K] the draw d of each sample. So a small batch can run samples picked from
  /// the draws of a larger one.
  std::vector<std::uint32_t> draws;

  /// Returns the standard deviations of step t, [nu].
  std::span<const double> sigma_of(int t) const {
    const std::size_t nu = limit.size(), row = sigma.size() > nu ? static_cast<std::size_t>(t) * nu : 0;
    return {sigma.data() + row, nu};
  }
};

/// How exact the physics of a rollout is. The defaults are the fine model F.
struct Fidelity {
  /// Objects that stand still have no freedom until something touches them. The
  /// touch is found before it has any effect, and the object is free from there on.
  bool freeze = false;
  /// Engine step, s, where it is longer than the world's own: cheaper and less
  /// exact, for screening. Drives are softened where they would be unstable.
  double time_step = 0.0;

  bool operator==(const Fidelity&) const = default;
};

/// Whose rollouts run first where several clients share workers. It changes when a
/// batch is done, never what comes out.
enum class Priority : std::uint8_t {
  kNormal = 0,
  kUrgent = 1,  ///< a robot waits for it
};

/// K rollouts of n control steps from one state.
struct RolloutBatch {
  Hash world;                    ///< names a scene given to Pool::load
  State x0;                      ///< [nq], [nv]
  ControlSequence nominal;       ///< [n][nu]
  std::vector<double> u_before;  ///< [nu] control before step 0, for c_a; the thesis's u_{-1} = 0
  double step_duration = 1.0;    ///< Delta_t, seconds; a multiple of the world's time step
  /// t_rest of Sec. 5.2, seconds, a multiple of the world's time step: after each control step all controls are 0 for
  /// so long, and only then is the step over. It belongs to F: whoever executes such a plan rests as well.
  double rest = 0.0;
  SamplingLaw law;
  std::uint32_t first_sample = 0;
  std::uint32_t samples = 1;  ///< K >= 1
  Objective objective = Objective::standard();
  /// Cost to beat: a rollout that can no longer get below it, nor succeed, stops.
  double incumbent = kInfinity;
  bool stop_losers = true;  ///< off: every rollout runs to its end
  /// Also judge losers by the cost that is bound to come (`objective/bound.hpp`).
  bool stop_hopeless = false;
  bool stop_on_success = false;  ///< Alg. 1, lines 8-9
  int min_steps = 0;             ///< n_min: success counts from this control step (0-based) on
  bool want_all_trajectories = false;
  /// The noise of physics, drawn by (sample, engine step, degree of freedom). So all candidates can meet the same
  /// noises: each has a batch of its own, with one sample per noise. It needs the fine model, because frozen objects
  /// would get no noise.
  VelocityNoise noise;
  Fidelity fidelity;
  Priority priority = Priority::kNormal;
  /// Wait this long per rollout and simulate nothing; for scheduling studies only.
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
  std::uint32_t thawed = 0;        ///< times a frozen object was touched and set free
  bool at_goal = false;            ///< the task's goal is reached at the last state
  std::vector<double> step_costs;  ///< [steps]; the last one carries the goal cost
  std::vector<StepFacts> facts;    ///< [steps] what happened in each
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
ControlSequence sample_controls(const ControlSequence& nominal, const SamplingLaw& law, std::uint32_t sample);

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
inline constexpr double kMaxStepDuration = 60.0;       // seconds
inline constexpr double kMaxTimeStep = 0.02;           // seconds; beyond it nothing is stable
inline constexpr std::size_t kMaxStateSize = 100'000;  // numbers in q or v
inline constexpr std::size_t kMaxScales = 1'000;
inline constexpr std::chrono::seconds kMaxWait{10};

}  // namespace jostle::physics_pool
