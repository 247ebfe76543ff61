#pragma once
/// \file
/// One push as the network sees it. States that differ only by a symmetry of the fine model
/// look the same.

#include <array>
#include <span>

#include "physics_pool/coarse/coarse_model.hpp"

namespace jostle::physics_pool {

inline constexpr int kSlots = 4;        ///< N_s, sliders at most
inline constexpr int kPushInputs = 5;   ///< way ahead (3), heading, speed
inline constexpr int kSlotInputs = 9;   ///< position in two frames (4), velocity (3), rough way (2)
inline constexpr int kSlotOutputs = 6;  ///< change of pose, velocity
inline constexpr int kInputs = kPushInputs + kSlots * kSlotInputs;
inline constexpr int kOutputs = kSlots * kSlotOutputs;

/// A pusher and sliders, all equal, on a surface.
struct PushBodies {
  double pusher_radius = 0.0145;   ///< m
  double slider_radius = 0.05115;  ///< m
  double slider_friction = 0.2;    ///< against the surface

  double pusher_reach() const { return pusher_radius + slider_radius; }
  double slider_reach() const { return 2 * slider_radius; }
  /// How far a slider that is let go at a velocity slides on, m. Friction is a pyramid:
  /// at first it acts along the faster axis only.
  std::array<double, 2> coasting(double vx, double vy) const;
};

/// Where the network is told that unused slots are, in the frame of the push: behind the pusher, out of
/// its reach, each in its own place. Part of the trained network (Sec. 7.2.1.2).
using Parking = std::array<std::array<double, 2>, kSlots>;  // m
inline constexpr Parking kParking{{{-0.30, -0.30}, {-0.30, -0.45}, {-0.45, -0.30}, {-0.45, -0.45}}};

/// What a pusher is about to do to its sliders during one control step.
///
/// Frame    fold: origin at the pusher where it first touches a slider, axes the
///          world's up to reflections and quarter turns, such that the pusher's way
///          is at an angle in [0, pi/4] from x. The fine model's friction cones are
///          pyramids aligned with the world's axes: it has the symmetries of the
///          square, and no others.
/// Slots    sliders that the pusher, or what it moves, could reach, by their distance
///          from the pusher's way. Others take no part.
class PushView {
 public:
  /// `state` as PlanarLayout says; u in m/s.
  PushView(const PushBodies& bodies, std::span<const double> state, int sliders, std::array<double, 2> u,
           double duration);

  /// The number of sliders in slots; 0: the pusher meets none.
  int slots() const { return slots_; }
  int slider(int slot) const { return slider_[at(slot)]; }

  /// Writes the network's inputs, [kInputs], SI, in fold's frame and in that frame turned into the pusher's way.
  void inputs(const Parking& parking, std::span<float> values) const;

  /// Writes what the network should answer, from the states before and after F: [kOutputs], per slot the
  /// change of x and y beyond the rough guess (m), that of theta (rad), and the new velocity as
  /// a share of the pusher's speed (angular: times the slider's radius). Zero for unused slots.
  void targets(std::span<const double> before, std::span<const double> after, std::span<float> values) const;

  /// Moves pusher and sliders as the network answers. `state` is the one that this view was made from.
  /// A slider out of reach of the pusher, and of all that the pusher moves, slides on as far
  /// as its velocity takes it, and rests.
  void apply(std::span<const float> outputs, std::span<double> state) const;

  /// Where the pusher's axis ends, in fold's frame, m.
  std::array<double, 2> pusher_end() const { return {way_ * cos_, way_ * sin_}; }
  /// Where a slot's slider ends by the rough guess, in fold's frame, m.
  std::array<double, 2> guess(int slot) const {
    return {x_[at(slot)] + guess_x_[at(slot)], y_[at(slot)] + guess_y_[at(slot)]};
  }

 private:
  static std::size_t at(int index) { return static_cast<std::size_t>(index); }
  std::array<double, 2> fold(double x, double y) const;
  std::array<double, 2> unfold(double x, double y) const;
  void choose_side(int first);
  void fill_slots(int first);
  void guess_ways();
  void touched(std::span<const float> outputs, std::array<bool, kSlots>& touched) const;

  PushBodies bodies_;
  int sliders_ = 0;
  std::array<double, 2> u_{};
  double duration_ = 0.0, speed_ = 0.0;
  bool swap_ = false;  // x and y, after the signs
  double sign_x_ = 1.0, sign_y_ = 1.0;
  double handedness_ = 1.0;       // -1: the fold is a reflection
  double cos_ = 1.0, sin_ = 0.0;  // of the angle of the pusher's way in the fold
  double way_ = 0.0;              // m, left once a slider is touched
  // In fold's frame: of slider i until slots are filled, of slot i afterwards.
  std::array<double, kSlots> x_{}, y_{}, vx_{}, vy_{}, omega_{};
  std::array<double, kSlots> guess_x_{}, guess_y_{};  // rough guess of how far slots move, m
  std::array<int, kSlots> slider_{-1, -1, -1, -1};
  int slots_ = 0;
};

}  // namespace jostle::physics_pool
