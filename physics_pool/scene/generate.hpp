#pragma once
/// \file
/// Random worlds of Sec. 3.3.1, and the planning worlds made from them.

#include <cstdint>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

struct GenerateOptions {
  int objects = 15;  ///< movable objects beside the target, 0 to 40
  std::uint64_t seed = 1;
  /// m; side of the square table, 0 for the thesis's 0.6 m, and for more than 15
  /// objects as much more as keeps the clutter as dense.
  double table = 0.0;
  /// m; least distance of an object's centre from the surface's edge. The
  /// thesis says only "on the table"; here everything starts in the safe zone.
  double edge_distance = 0.08;
  double gap = 0.003;  ///< m; least distance between two objects
};

/// A table, of 0.6 m x 0.6 m unless told, with random boxes and cylinders. Ranges are those
/// of the thesis's footnote 1 of Ch. 3, read as full extents; the target is a
/// box of the same range, because a cylinder of 70 to 80 mm leaves an 85 mm
/// gripper no room. Its position is normal about the centre, sigma 1 cm.
/// Errors   kInvalidArgument  objects out of range, or no place found for them.
Result<Scene> generate_chapter3(const GenerateOptions& options);

/// How far the planner's belief is from the world (Sec. 3.3).
enum class Uncertainty { kNone, kLow, kMedium, kHigh };

Result<Uncertainty> parse_uncertainty(std::string_view word);
const char* to_string(Uncertainty level);

/// Standard deviation of the velocity noise of Eq. 3.3, per engine step and
/// degree of freedom, m/s and rad/s: 0, 0.003, 0.006, 0.009.
double velocity_noise(Uncertainty level);

/// The planning world of an execution world: Gaussian noise on poses, sizes,
/// masses and frictions (footnote 2 of Ch. 3: 5 mm, 0.005 rad, 5 mm, 10 g and
/// 0.005 at low; twice and three times that at medium and high). What the
/// thesis calls variances are standard deviations here. Believed objects never
/// overlap: a draw that would is made again, with less noise after each try, and
/// if that does not help, everything is.
Scene perturb(const Scene& execution, Uncertainty level, std::uint64_t seed);

/// What a measurement follows.
enum class Measurement {
  kInitial,   ///< nothing has moved: objects are where the planning world has them
  kFeedback,  ///< an action: poses are exact, shapes remain believed
};

/// The state of the execution world as the planner sees it. The thesis adds
/// pose noise when a planning world is made and then observes; its experiments
/// with noisy tracking are separate ones (Sec. 3.3.3). Every object is as high
/// above the surface as its believed shape puts it; joints are exact.
State observed_state(const Scene& execution, const Scene& belief, const State& truth, Measurement measurement);

}  // namespace jostle::physics_pool
