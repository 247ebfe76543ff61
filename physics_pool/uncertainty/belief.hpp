#pragma once
/// \file
/// Planning worlds made from execution worlds, and what a planner sees of the one in the other.

#include <cstdint>

#include "idl/types/state.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/uncertainty/levels.hpp"

namespace jostle::physics_pool {

/// Makes the planning world of an execution world, by Gaussian noise on poses, sizes,
/// masses and frictions (footnote 2 of Ch. 3: 5 mm, 0.005 rad, 5 mm, 10 g and
/// 0.005 at low; twice and three times that at medium and high). What the
/// thesis calls variances are standard deviations here. Believed objects never
/// overlap: an object that would is drawn again, with less noise after each try; if
/// that does not help, all objects are.
Scene perturb(const Scene& execution, Uncertainty level, std::uint64_t seed);

/// What has happened before a measurement.
enum class Measurement {
  kInitial,   ///< nothing has moved: objects are where the planning world has them
  kFeedback,  ///< an action: poses are exact, shapes remain believed
};

/// Returns the state of the execution world as the planner sees it. The thesis adds
/// pose noise when a planning world is made and then observes; its experiments
/// with noisy tracking are separate ones (Sec. 3.3.3). Every object is as high
/// above the surface as its believed shape puts it; joints are exact.
State observed_state(const Scene& execution, const Scene& belief, const State& truth, Measurement measurement);

/// Checks that a belief has the same robot as the execution world, and objects of the same names in the same order;
/// their shapes and places may differ.
/// Error kInvalidArgument naming what differs.
Result<void> check_belief(const Scene& execution, const Scene& belief);

}  // namespace jostle::physics_pool
