#pragma once
/// \file
/// A scene as MJCF text.

#include <string>

#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// Joints and actuators come in the order of layout_of(scene).
std::string model_xml(const Scene& scene);

}  // namespace jostle::physics_pool
