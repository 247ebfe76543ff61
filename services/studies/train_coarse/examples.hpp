#pragma once
/// \file
/// Transitions as the network sees them, and how well a model predicts them.

#include <string>
#include <vector>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/coarse/learned/network.hpp"
#include "services/studies/train_coarse/transitions.hpp"

namespace jostle::studies {

/// What the network is to learn. Transitions in which the pusher meets no slider are left out.
struct Examples {
  std::vector<float> inputs;   ///< [N][kInputs], SI
  std::vector<float> targets;  ///< [N][kOutputs], SI
  /// [N][2·kSlots + 3] for penetration: where the slots end by guess, m, pusher's end, slots used.
  std::vector<float> places;
  static constexpr int kPlaces = 2 * physics_pool::kSlots + 3;

  std::size_t size() const { return inputs.size() / physics_pool::kInputs; }
};

physics_pool::PushBodies bodies_of(const DataOrigin& origin);

/// Which transitions are taken. Those of every n-th round of episodes (a round has one episode per number of
/// sliders) are held out from learning: whole episodes, so that the network has seen nothing of them.
enum class Part { kAll, kLearn, kHeldOut };
bool is_part(Part part, double held_out, std::size_t transition);

Examples examples_of(const TransitionFile& data, Part part, double held_out, const physics_pool::Parking& parking);

/// Errors of one-step predictions over the sliders that F moves by 1 mm or more; common::kNone where there are none.
struct Accuracy {
  int sliders = 0;                             ///< in the scene
  std::size_t pushed = 0;                      ///< sliders that F moved
  double mean_way = 0.0;                       ///< how far, m
  double mean = 0.0, median = 0.0, p90 = 0.0;  ///< position error, m
  double angle_median = 0.0, angle_p90 = 0.0;  ///< rad
  double all_mean = 0.0;                       ///< position error of all sliders of all transitions, m
  double all_rms = 0.0;                        ///< its root mean square, m
  double penetrating = 0.0;                    ///< share of predictions with penetration beyond 0.5 mm
  double deepest = 0.0, mean_depth = 0.0;      ///< penetration of those, m
};

/// Measures the accuracy per number of sliders; numbers without a transition are left out.
std::vector<Accuracy> accuracy_of(const physics_pool::Network& network, const TransitionFile& data, Part part,
                                  double held_out);

/// Writes a table, in mm and degrees.
std::string accuracy_table(const std::vector<Accuracy>& rows);

}  // namespace jostle::studies
