#pragma once
/// \file
/// A scene as MJCF text.

#include <climits>
#include <string>

#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// What stands before the names of the robot's bodies, and before those of its geoms and of fixtures: URDF files like
/// to have a link "world", which is the engine's own, and the scene has geoms of its own.
inline constexpr const char* kLinkPrefix = "link:";
inline constexpr const char* kGeomPrefix = "geom:";

/// Says which parts of a scene go into a model.
struct ModelContent {
  /// The first `free` objects can move. The others are mocap bodies, which
  /// stand where they are put and touch only what moves.
  int free = INT_MAX;
  bool looks = false;  ///< whether it has what only pictures need: a megabyte of sky
};

/// Returns how many geoms the object of a scene has that has most of them.
std::size_t most_geoms(const Scene& scene);

/// Writes a scene as MJCF. Joints and actuators come in the order of layout_of(scene); bodies and geoms
/// of the objects come last, in their order: one geom for the shape that an object stands on, then one for each part.
/// Where some objects cannot move all have most_geoms() of them, so that any can take the place of any other.
std::string model_xml(const Scene& scene, const ModelContent& content = {});

}  // namespace jostle::physics_pool
