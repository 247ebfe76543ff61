#pragma once
/// \file
/// A scene as MJCF text.

#include <climits>
#include <string>

#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// Before the names of the robot's bodies: URDF files like to have a link "world", which is the engine's own.
inline constexpr const char* kLinkPrefix = "link:";

/// What of a scene goes into a model.
struct ModelContent {
  /// Objects with freedom, from the first on; the others are mocap bodies, which
  /// stand where they are put and meet only what moves.
  int free = INT_MAX;
  bool looks = false;  ///< what only pictures need: a megabyte of sky
};

/// Joints and actuators come in the order of layout_of(scene); bodies and geoms
/// of the objects come last, in their order.
std::string model_xml(const Scene& scene, const ModelContent& content = {});

}  // namespace jostle::physics_pool
