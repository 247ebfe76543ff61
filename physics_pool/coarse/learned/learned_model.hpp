#pragma once
/// \file
/// The learned coarse model of Sec. 7.2.1.

#include <filesystem>
#include <memory>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/coarse/learned/network.hpp"

namespace jostle::physics_pool {

/// Loads the model "learned", for a pusher and one to four equal cylinders. The pusher moves exactly as
/// it is told (Eq. 6.8); a network predicts what it does to the sliders (PushView).
///
/// A step in which the pusher goes farther than in training is taken in equal parts. A step of another duration is
/// predicted as one of the training's duration over the same distance: pushes are so slow that sliders end in the same
/// place at any speed, and velocities scale. Masses, heights and frictions are taken to be those of the training.
///
/// Errors   those of load_network; kInvalidArgument if the scene is not of the kind the
///          network was trained for; says what is different
Result<std::unique_ptr<CoarseModel>> load_learned_model(const std::filesystem::path& file, const Scene& scene);

/// Makes the same model from a network at hand; `origin` names it in messages.
Result<std::unique_ptr<CoarseModel>> make_learned_model(const Network& network, const Scene& scene,
                                                        const std::string& origin);

}  // namespace jostle::physics_pool
