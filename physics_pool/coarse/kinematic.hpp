#pragma once
/// \file
/// The kinematic model of Sec. 6.1.2.

#include <vector>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/scene/outline.hpp"

namespace jostle::physics_pool {

/// Every slider that the pusher meets goes along with it from there on:
///
///   q^S <- q^S + (u_x, u_y, omega)·p_c·Delta_t                       (6.5)
///   p_c = d_contact/(d_contact + d_free),
///   omega = K_omega·|u|·sin(theta)/|r_c|                             (6.6)
///   dq^S <- (u_x, u_y, omega) if p_c > 0, else dq^S                  (6.7)
///   q^P <- q^P + u·Delta_t,  dq^P <- u                               (6.8)
///
/// d_free is how far the pusher goes before it touches the slider, d_contact the
/// rest; r_c leads from the contact to the slider's centre, theta from u to r_c. The
/// touch is found by following the signed distance, so any outline will do. The thesis
/// does not give K_omega; 1/2 is what quasi-static friction makes of a push that
/// sticks as far from the centre as the support is: omega = (u x r)/(c^2 + r^2).
/// Sliders do not meet each other.
class KinematicModel final : public CoarseModel {
 public:
  /// `rotation_gain`: K_omega.
  explicit KinematicModel(const Scene& scene, double rotation_gain = 0.5);

  std::string_view name() const override { return "kinematic"; }
  PlanarLayout layout() const override { return layout_; }
  void advance(std::span<double> states, std::span<const double> controls, double duration) override;

 private:
  void advance_one(double* x, const double* u, double duration) const;

  PlanarLayout layout_;
  std::vector<Outline> outlines_;  // [sliders]
  double pusher_radius_;
  double rotation_gain_;
};

}  // namespace jostle::physics_pool
