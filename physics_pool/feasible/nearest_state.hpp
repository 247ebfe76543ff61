#pragma once
/// \file
/// The nearest state that physics can start from, of objects that were measured.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "idl/types/pose.hpp"
#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// Where an object of a scene is, and how surely.
struct MeasuredObject {
  std::string name;
  Pose X_WB;
  /// [6][6] of (translation, m; rotation vector, rad), world axes: R_true = exp(rotation) R. Symmetric, >= 0.
  std::array<double, 36> covariance{};
};

struct NearestOptions {
  double slack = 0.001;         ///< m, standard deviation of shapes and of the surface: added to every covariance
  double turning_slack = 0.01;  ///< rad, the same of faces
  /// Squared Mahalanobis distance by which an object may be moved at most, 6 degrees of freedom: more than that its
  /// covariance does not explain.
  double most = 30.0;
  double gap = 2e-5;  ///< m that is left between bodies
};

struct PlacedObject {
  std::string name;
  Pose X_WB;
  /// Whether it stands on the surface, upright or on a side. One that leans, lies on others, is lifted or fell off the
  /// surface is left as it was measured.
  bool stands = false;
  double moved = 0.0;  ///< squared Mahalanobis distance from where it was measured
};

/// Finds the nearest state in which every object that may well stand on the surface does so, and none of these is
/// inside another or inside a fixture:
///
///   x* = argmin sum_i (x_i - m_i)^T P_i^-1 (x_i - m_i)   subject to   z, tilt of i at rest,   gap_k(x) >= 0
///
/// Standing is what the Gaussian of each object is conditioned on: what is known least is moved most, such as the
/// distance from a camera, and what is correlated with it moves along. What is left, x, y and the turn about z, is
/// kept apart as outlines in the plane: gaps are made linear again and again, and each quadratic problem is solved
/// by projected Gauss-Seidel for its multipliers. Where that ends in a bad minimum, it starts again nearby.
///
/// Source   Eq. 6.9 for many bodies, each weighed by how surely it is known
/// Known    objects and upright fixtures as outlines at their heights. Not the robot.
/// Threads  a pure function; equal arguments give equal states.
/// Errors   kInvalidArgument  a name that the scene has not, numbers that are not finite or no covariance; or no such
///          state was found within what the covariances explain: names the objects
Result<std::vector<PlacedObject>> nearest_state(const Scene& scene, std::span<const MeasuredObject> measured,
                                                const NearestOptions& options = {});

}  // namespace jostle::physics_pool
