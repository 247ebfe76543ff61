#pragma once
/// \file
/// How far two states of one scene are from each other, in metres.

#include <span>

#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {

/// Returns the distance of chosen objects between two states, m:
///
///   sqrt( sum_i |p_i^a - p_i^b|^2 + (r_i·theta_i)^2 )
///
/// with theta_i the angle between the two orientations, and r_i the radius of the object's footprint. Of a cylinder
/// only the tilt counts, because its spin changes nothing. Velocities do not count. `a`, `b`: [nq]. `objects`: indices
/// into the layout's objects. Source   the norm of Eq. 4.16 to 4.19, which the thesis writes over the whole state,
/// metres beside radians
double objects_distance(const TaskGeometry& geometry, std::span<const double> a, std::span<const double> b,
                        std::span<const int> objects);

/// Returns the same over all objects and the robot's joints, m. An angle of a joint counts 0.1 m per rad, as in
/// control_norm.
/// Source   |x^d - x| of Eq. 4.41
double state_distance(const TaskGeometry& geometry, std::span<const double> a, std::span<const double> b);

}  // namespace jostle::physics_pool
