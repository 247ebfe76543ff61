#pragma once
/// \file
/// Random pushes to learn from: where things start and what the pusher does.

#include <cstdint>

#include "physics_pool/api/pool.hpp"
#include "services/studies/train_coarse/transitions.hpp"

namespace jostle::studies {

/// Control steps of one episode; each is a transition. Later ones start from what
/// earlier ones left: in contact, still moving.
inline constexpr int kEpisodeSteps = 4;

/// Makes the world of an episode: a pusher and `sliders` equal cylinders on a large table.
physics_pool::Scene training_scene(const DataOrigin& origin, int sliders);

/// Sliders in episode number `episode`: 1, 2, 3, 4, 1, …
inline int episode_sliders(std::uint64_t episode) { return 1 + static_cast<int>(episode % kMaxSliders); }

/// Draws start and controls of an episode, as a batch of one rollout; a pure function
/// of the origin, the episode's number and the attempt. Sliders lie around the
/// world's origin, most of them close to another one; the pusher starts close to
/// one of them and mostly aims at one, at any offset at which it still touches.
/// Rejection sampling keeps everything out of everything else (footnote 1 of Ch. 7).
physics_pool::RolloutBatch draw_episode(const DataOrigin& origin, std::uint32_t episode, std::uint32_t attempt);

/// Returns an episode's transitions, from the states it went through, [kEpisodeSteps + 1].
std::vector<Transition> transitions_of(const physics_pool::RolloutBatch& batch, const Trajectory& trajectory,
                                       int sliders);

/// Returns the smallest distance between two bodies of a state, m; negative in penetration.
double clearance(const DataOrigin& origin, const std::array<float, kPlanarSize>& state, int sliders);

}  // namespace jostle::studies
