#pragma once
/// \file
/// Parareal's arithmetic on states: corrections in the plane, and their feasibility.

#include <span>
#include <vector>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/coarse/contact.hpp"

namespace jostle::physics_pool {

/// A PlanarUpdate carries coarse predictions over to full states. Coarse models know only the plane; a slider keeps
/// height and tilt of the state that is corrected. Poses are updated in tangent space: a
/// slider is moved and turned about the vertical, so its quaternion stays a unit one.
///
/// Threads  immutable; safe from any.
class PlanarUpdate {
 public:
  explicit PlanarUpdate(const Scene& scene);

  /// Puts a planar state into x: a coarse prediction becomes a full state. A slider
  /// whose centre is beyond the surface's edge is put below it: it has fallen.
  void replace(State& x, std::span<const double> planar) const;

  /// One application of C: the planar state it began with, and the one it came to.
  struct Step {
    std::span<const double> start, end;
  };

  /// Adds C(now) - C(before) to x: Eq. 6.3, where x is F(x_n^k), and C was applied to
  /// x_n^{k+1} now and to x_n^k before. No slider is corrected by more than `limit` times
  /// the difference of C's two starts, that of the slider and that of the pusher: where the pusher touches in
  /// one start and not in the other, C jumps by a whole push, and F does not.
  void correct(State& x, const Step& now, const Step& before, double limit) const;

  /// Moves sliders, as little as it takes, until none is deeper in the pusher or in
  /// another than kTolerance: Eq. 6.9 along contact normals, for any number of
  /// bodies (Gauss-Seidel; two sliders share the way). The pusher stays.
  void project(State& x) const;

  static constexpr double kTolerance = 0.0005;  // m, as in the author's program

  /// Largest distance, m, and rotation, rad, between the sliders of two states.
  struct Change {
    double translation = 0.0, rotation = 0.0;
  };
  Change change(const State& a, const State& b) const;

  const StateLayout& layout() const { return layout_; }
  PlanarLayout planar_layout() const { return {static_cast<int>(layout_.objects.size())}; }

 private:
  double reach(std::size_t slider) const;
  void displace(State& x, std::size_t slider, double dx, double dy, double turn) const;

  StateLayout layout_;
  Surface surface_;
  Outline pusher_;
  std::vector<Outline> outlines_;
  std::vector<double> rest_heights_;
};

}  // namespace jostle::physics_pool
