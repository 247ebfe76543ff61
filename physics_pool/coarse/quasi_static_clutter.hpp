#pragma once
/// \file
/// Quasi-static physics of a planar robot of any outline among many objects.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/coarse/touching.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// How the model solves, and what it knows of the fine model's friction. The defaults of the latter were fitted to the
/// fine model in worlds that no study reports on.
struct ClutterOptions {
  double step = 0.004;     ///< m that the robot goes per substep; the cost grows as its inverse
  int max_substeps = 128;  ///< per control step
  int weightings = 2;      ///< how often dampers are fitted to speeds per substep
  int sweeps = 3;          ///< over all contacts per fitting
  /// Factor of the coefficients of friction between bodies. Fitted.
  double contact_friction = 0.5;
  /// Factor of the objects' friction on the surface; to ask how a prediction depends on it.
  double support_friction = 1.0;
  /// Friction across the direction of motion, at least, as a share of that along it: the fine model's cones are
  /// pyramids along the world's axes, and oppose little that is across.
  double across = 0.3;
  /// s, that a force acts on a resting mass before friction holds it: the fine model's friction is soft, and creeps.
  double creep = 0.00106;
};

/// Objects slide on the surface against dry friction and rest without a force; the robot's joints move as their drives
/// are told, less what contact forces take from them. Each substep of length h minimises the dissipated power
///
///   min_v  sum_j k_j/2·(v_j - u_j)^2 + sum_i D_i(v_i)    subject to  n·(v_a - v_b) >= -gap/h  at every contact,
///
/// with k_j the drive's gain, u_j the commanded joint velocity, and D_i = f_max·|(v_x, v_y, c·omega)| of object i's
/// limit surface, f_max = mu·m·g, c the distance of its support points. |(v_x, v_y)| is the norm of order 3 along the
/// world's axes, which lies between an ellipsoid's and a pyramid's. D is weighted anew as f_max/(2·speed)·v^2
/// (iteratively reweighted least squares), and the forces, with friction at contacts, are found by projected
/// Gauss-Seidel from those of the substep before.
///
/// Source   limit surfaces: Goyal, Ruina & Papadopoulos, Wear 1991; the principle: Peshkin & Sanderson, "Minimization
/// of
///          energy in quasi-static manipulation", IEEE T-RA 1989.
/// Known    objects and robot as outlines at their heights, fixtures, edges of the surface, joint limits
/// Unknown  inertia, impacts, what topples or lies on others
/// Threads  one at a time; a copy is independent. Nothing is allocated after construction.
class QuasiStaticClutter {
 public:
  static constexpr std::size_t kMostJoints = 8;

  /// Errors   kInvalidArgument  a robot or fixture that the plane cannot show: a joint that leaves the plane or that
  ///          nothing drives, a mesh, a tilted box; says which
  static Result<QuasiStaticClutter> make(const Scene& scene, const ClutterOptions& options = {});

  /// Sets what is fitted, from the next step on; the scene stays.
  void set_options(const ClutterOptions& options) { options_ = options; }

  /// Moves x by one control step: a pure function of its arguments. Heights and tilts stay as they are, but for objects
  /// that leave the surface, which fall below it and out of the way. `v` becomes the last substep's velocities.
  /// `u` [nu], m/s and rad/s, `duration` in s. x has the sizes of the scene's states. Numbers that are not finite stay
  /// so.
  void advance(State& x, std::span<const double> u, double duration);

 private:
  struct Body {  // an object
    Outline outline;
    double reach = 0.0;                // m
    double low = 0.0, high = 0.0;      // m, heights at rest
    double friction = 0.0;             // against everything
    double mass = 0.0, support = 0.0;  // kg; N, f_max
    double lever = 0.0;                // m, c
    double rest_height = 0.0;          // m
    int q = 0, v = 0;                  // where it is in a State
  };
  struct Motion {  // an object's
    PlanarPose pose;
    double turned = 0.0;            // rad since the control step's start
    Eigen::Vector2d v{0.0, 0.0};    // m/s
    double w = 0.0;                 // rad/s
    double speed = 0.0;             // m/s, of the damper; 0: never moved
    std::array<double, 3> yield{};  // of x, y, rotation: velocity per force
    bool gone = false;              // fell
    bool active = false;            // touched in this substep, or moving
    bool asked = false;             // its contacts with others are known
    bool moved = false;             // in this control step
  };
  struct Piece {  // of the robot, or a fixture
    Outline outline;
    double reach = 0.0;
    double low = 0.0, high = 0.0;
    int link = -1;  // -1: a fixture
    PlanarPose in_link, pose;
  };
  struct Drive {
    bool is_slide = true;
    Eigen::Vector2d axis{1.0, 0.0};  // in its link; of a hinge: (sign, 0)
    double low = 0.0, high = 0.0;
    double yield = 0.0;  // 1/gain
  };
  struct PlanarLink {
    int parent = -1;
    PlanarPose in_parent;
    std::vector<int> joints;
    std::uint32_t chain = 0;  // joints that move it
  };
  struct Pressing {      // of one body on another, at a point
    int a = -1, b = -1;  // objects, or -1
    int key = 0;         // names the pair and the point
    double robot = 0.0;  // +1, -1: the robot is a, b; 0: it is neither
    double target = 0.0, friction = 0.0;
    double normal_force = 0.0, tangent_force = 0.0;  // N
    // Along the normal, then the tangent: J of a and of b (x, y, rotation), of the robot's joints; 1/(J·M·J').
    std::array<std::array<double, 3>, 2> ja{}, jb{};
    std::array<std::array<double, kMostJoints>, 2> jr{};
    std::array<double, 2> inverse{};
  };

  QuasiStaticClutter() = default;

  Result<void> take_robot(const Scene& scene);
  Result<void> take_fixtures(const Scene& scene);
  void make_room();
  void place_robot();
  void find_contacts();
  void touch(int a, int b, int piece, const Touches& touches);
  void solve(double h);
  void weigh();
  void prepare();
  void sweep(double h);
  double relative(const Pressing& contact, std::size_t row) const;
  void push(const Pressing& contact, std::size_t row, double force);
  void integrate(double h);

  ClutterOptions options_;
  Surface surface_;
  std::vector<Body> bodies_;
  std::vector<Piece> pieces_, fixtures_;
  std::vector<PlanarLink> links_;
  std::vector<Drive> drives_;
  std::vector<std::vector<std::pair<int, double>>> axes_;

  PlanarPose base_;
  // Of the substep.
  std::vector<Motion> objects_;
  std::vector<PlanarPose> link_poses_;
  std::array<double, kMostJoints> q_{}, v_{}, free_{}, held_{};  // joints; held_: force of the limit they are at
  std::array<Eigen::Vector2d, kMostJoints> arrows_{};            // of a slide: its direction; of a hinge: its place
  std::vector<Pressing> contacts_, before_;
  std::size_t most_contacts_ = 0;
  std::vector<int> queue_;
  double margin_ = 0.0, approach_ = 0.0, h_ = 0.0;
};

}  // namespace jostle::physics_pool
