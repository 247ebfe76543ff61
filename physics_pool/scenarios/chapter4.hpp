#pragma once
/// \file
/// Random worlds after Sec. 4.5.3: a shelf, and a target behind other objects.

#include <cstdint>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

struct GenerateShelfOptions {
  int objects = 9;  ///< movable objects beside the target, 2 to 15; the thesis's D is 10 with it
  std::uint64_t seed = 1;
};

/// Makes a shelf of 0.6 m x 0.5 m, open towards the planar gripper, with random boxes and cylinders. The target, a box,
/// is at the back; two others are within 2 cm of the straight line from the hand to it, in front of it, so that this
/// line pushes them along. Masses and frictions are those of Table 4.1, sizes those of Sec. 3.3.1, since the thesis
/// gives none; its own objects are from the YCB set, and its robot an arm. Errors   kInvalidArgument  objects out of
/// range, or no place found for them.
Result<Scene> generate_chapter4(const GenerateShelfOptions& options);

/// Makes a shelf of 0.5 m x 0.8 m with a board above it at 0.4 m, open towards a UR5 whose joints are what one controls
/// (Sec. 4.5.1), with things of a kitchen (household.hpp) that differ from scene to scene. The target is a soup can at
/// the back; two others are in front of it, within 2 cm of the straight line from the hand. The hand starts level, 75
/// mm above the shelf, always in the same place (Sec. 4.5.3). Frictions are those of Table 4.1.
///
/// The target can be reached as far as kinematics can tell: were there nothing but the shelf, the hand could go
/// straight to its pre-grasp place, every joint in its range and every link clear of every board. Errors
/// kInvalidArgument  objects out of range, or no place found for them
Result<Scene> generate_chapter4_arm(const GenerateShelfOptions& options);

/// Whether the robot's hand can go straight from where it starts to where it has the target between its pads, level as
/// it is, with all links clear of all fixtures; objects are not looked at.
bool is_reachable(const Scene& scene);

}  // namespace jostle::physics_pool
