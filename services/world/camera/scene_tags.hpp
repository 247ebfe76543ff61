#pragma once
/// \file
/// Which tag is on which object of a scene, and where a camera looks on from.

#include <string>
#include <vector>

#include "idl/types/pose.hpp"
#include "perception/camera/camera.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::world {

/// A tag on an object.
struct ObjectTag {
  std::string object;
  int id = 0;
  double size = 0.0;    ///< m, outer edge of the black border
  Pose X_BT;            ///< perception/tags/pose.hpp says which way T lies
  double height = 0.0;  ///< m, of the object's origin above the surface when it stands
};

/// Returns a tag for each object, flat in the middle of its top: its id is the object's place in the scene, from 0, and
/// its size the largest in whole millimetres whose paper fits on the top.
/// Error kInvalidArgument: more objects than there are tags, or an object too small for a tag of 10 mm.
Result<std::vector<ObjectTag>> tags_of(const physics_pool::Scene& scene);

/// Returns the intrinsics of the simulated camera: 1280x960, with a lens that distorts a little.
perception::Camera simulated_camera();

/// Returns X_WC of a camera above the middle of the surface that looks down and sees all of it.
Pose overhead(const physics_pool::Scene& scene);

}  // namespace jostle::world
