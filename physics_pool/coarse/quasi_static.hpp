#pragma once
/// \file
/// Quasi-static pushing with limit surfaces, of one slider or of many.

#include <Eigen/Core>
#include <vector>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/coarse/contact.hpp"

namespace jostle::physics_pool {

struct QuasiStaticOptions {
  bool sliders_touch = true;  ///< false: every slider meets the pusher alone
  double step = 0.001;        ///< m the pusher goes per substep; cost grows as its inverse
  int min_substeps = 8;
  int max_substeps = 128;
  int sweeps = 4;  ///< over all contacts per substep, where there are several
};

/// Sliders stick to the surface by friction and move only as far as contact makes
/// them. Forces that a slider on the verge of sliding can bear form an ellipsoid,
/// the limit surface (Goyal, Ruina & Papadopoulos, "Planar sliding with dry
/// friction", Wear 1991), whose normal is the direction it slides in:
///
///   (v, omega) = A·(f, m),  A = diag(1, 1, 1/c^2)/f_max,  c = m_max/f_max
///
/// f_max = mu·m·g, and the support points of the fine model (corners of a box, rim of a
/// cylinder) are all equally far from the centre, so c is that distance. The
/// contact's force keeps to the friction cone: it sticks while the motion is inside
/// the motion cone and slides along its edge otherwise (Lynch, Maekawa & Tanie,
/// "Manipulation and active sensing by pushing using tactile feedback", IROS 1992).
///
/// The pusher moves in short substeps. A slider that the pusher, or another slider, has entered is
/// moved out by these rules, contact after contact (Gauss-Seidel). With one contact
/// that is the closed form of the motion cone; with many, sliders push each other.
class QuasiStaticModel final : public CoarseModel {
 public:
  QuasiStaticModel(const Scene& scene, const QuasiStaticOptions& options);

  std::string_view name() const override { return options_.sliders_touch ? "planar" : "limit-surface"; }
  PlanarLayout layout() const override { return layout_; }
  void advance(std::span<double> states, std::span<const double> controls, double duration) override;

 private:
  struct Slider {
    Outline outline;
    double friction = 0.0;  // against whatever meets it
    double mobility = 0.0;  // 1/f_max, 1/N
    double turning = 0.0;   // 1/(c^2·f_max), 1/(N m^2)
  };

  void advance_one(double* x, const double* u, double duration);
  void yield(const Eigen::Vector2d& moved);
  void part_from_pusher(std::size_t i, const Contact& contact, const Eigen::Vector2d& moved);
  void part(std::size_t i, std::size_t j, const Contact& contact);
  void apply(std::size_t i, const Eigen::Vector2d& point, const Eigen::Vector2d& force);
  Eigen::Vector2d carried(std::size_t i, const Eigen::Vector2d& point) const;

  PlanarLayout layout_;
  QuasiStaticOptions options_;
  Outline pusher_;
  std::vector<Slider> sliders_;
  PlanarPose pusher_pose_;
  std::vector<PlanarPose> poses_, before_;  // [sliders] now, and at the substep's start
};

}  // namespace jostle::physics_pool
