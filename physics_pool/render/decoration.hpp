#pragma once
/// \file
/// What pictures show beyond the physics. Private to this folder: it shows MuJoCo's types.

#include "physics_pool/local/engine.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/scene/task_kind.hpp"

namespace jostle::physics_pool {

/// Adds what nothing can touch: the wrist, the fingers' pads, the goal region (red),
/// the obstacle (dark). Drawn here rather than modelled, so that no simulation pays
/// for it.
void decorate(const SceneTask& task, const mjModel& model, const mjData& data, mjvScene& scene);

}  // namespace jostle::physics_pool
