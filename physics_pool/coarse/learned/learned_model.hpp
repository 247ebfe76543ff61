#pragma once
/// \file
/// The learned coarse model of Sec. 7.2.1.

#include <filesystem>
#include <memory>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/coarse/learned/network.hpp"

namespace jostle::physics_pool {

/// "learned": a pusher and one to four equal cylinders. The pusher moves exactly as
/// it is told (Eq. 6.8); what it does to the sliders, a network says (PushView).
///
/// A step longer than those of the training is taken in equal parts. One of another
/// duration is taken for one of the training's duration with the same way: a push
/// this slow leaves things where it does, however fast it is, and velocities scale.
/// Masses, heights and frictions are taken for those of the training.
///
/// Errors   of load_network; kInvalidArgument if the scene is none of the kind the
///          network was trained for; says what is different
Result<std::unique_ptr<CoarseModel>> load_learned_model(const std::filesystem::path& file, const Scene& scene);

/// The same with a network at hand; `origin` names it in messages.
Result<std::unique_ptr<CoarseModel>> make_learned_model(const Network& network, const Scene& scene,
                                                        const std::string& origin);

}  // namespace jostle::physics_pool
