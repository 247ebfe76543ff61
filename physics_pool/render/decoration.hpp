#pragma once
/// \file
/// What pictures show beyond the physics. Private to this folder: it shows MuJoCo's types.

#include "physics_pool/local/engine.hpp"

namespace jostle::physics_pool {

/// Adds what nothing can touch: the wrist, the fingers' pads.
/// Drawn here rather than modelled, so that no simulation pays for it.
void decorate(const mjModel& model, const mjData& data, mjvScene& scene);

}  // namespace jostle::physics_pool
