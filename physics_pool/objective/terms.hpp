#pragma once
/// \file
/// The terms of Eq. 3.2 and 6.10, each a small function of states at the borders of
/// a control step, and the predicates built on them. Engine-free. What one task
/// does not have is 0 for it: obstructions when pushing, an obstacle when grasping.

#include <span>
#include <string>
#include <vector>

#include "idl/types/state.hpp"
#include "physics_pool/api/objective.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// What the terms need to know of a scene.
struct TaskGeometry {
  explicit TaskGeometry(const Scene& scene);

  StateLayout layout;
  double half_x = 0.0, half_y = 0.0;  ///< m, half extents of the surface
  std::vector<double> rest_heights;   ///< [objects] m
  SceneTask task;
  SceneObject target;          ///< its shape, without a name; where it is says the state
  double pusher_radius = 0.0;  ///< m; 0 for a gripper
};

/// Distance and bearing of the target from the hand, Fig. 3.2; grasping only.
struct TargetBearing {
  double distance = 0.0;  ///< d_T, m
  double angle = 0.0;     ///< phi_T, rad, in [0, pi]
};
TargetBearing target_bearing(const TaskGeometry& geometry, const State& x);

/// How far the task is from its end, m: the target from the hand, or from the
/// centre of its goal region.
double goal_distance(const TaskGeometry& geometry, const State& x);

/// c_g(x) = d_T^2 + w_phi · phi_T^2 for a hand, and |p_T - p_goal|^2 for a pusher
double goal_cost(const TaskGeometry& geometry, const State& x, double angle_weight);

/// Other objects whose centre lies between the fingers, palm to fingertips.
int count_obstructions(const TaskGeometry& geometry, const State& x);

/// What a rollout that ends at x pays there: w_g·c_g and the obstructions.
double final_cost(const TaskGeometry& geometry, const Objective& objective, const State& x);

/// c_a(u_before, u) = |u - u_before|^2
double acceleration_cost(std::span<const double> u_before, std::span<const double> u);

/// c_d(x0, x1) = sum over the objects but the target of |dp|^2 + w·|rotation|^2
double disturbance_cost(const TaskGeometry& geometry, const State& x0, const State& x1, double rotation_weight);

/// c_e(x0, x1) = sum of exp(min(k·d_E, cap)) over all objects outside the safe
/// zone at x1, where d_E is how far the object moved from x0 to x1.
double edge_cost(const TaskGeometry& geometry, const State& x0, const State& x1, const Objective& objective);

/// Objects whose axis leans more than `angle` from upright, rad.
int toppled_objects(const TaskGeometry& geometry, const State& x, double angle);

/// w_s/|p_T - p_O|^2 + w_p/|p_P - p_O|^2 of target T, pusher P and obstacle O (Eq. 6.10),
/// distances no smaller than obstacle_nearest; 0 without an obstacle.
double obstacle_cost(const TaskGeometry& geometry, const State& x, const Objective& objective);

/// Other objects than the target whose centre is in the goal region.
std::vector<int> intruders(const TaskGeometry& geometry, const State& x);
int count_intruders(const TaskGeometry& geometry, const State& x);

/// Whether the target's, or the pusher's, footprint is over the obstacle.
bool target_hits_obstacle(const TaskGeometry& geometry, const State& x);
bool pusher_hits_obstacle(const TaskGeometry& geometry, const State& x);
int count_collisions(const TaskGeometry& geometry, const State& x);  ///< of the two, how many

/// Indices of objects whose centre is more than `height` m below its resting place.
std::vector<int> dropped_objects(const TaskGeometry& geometry, const State& x, double height);
int count_dropped(const TaskGeometry& geometry, const State& x, double height);

/// Whether the task's goal is reached: the target's centre is in the hand's
/// pre-grasp region, or in the goal region, and the target stands.
bool at_goal(const TaskGeometry& geometry, const State& x, const Objective& objective);

/// All running terms of one control step, weighted. Where Eq. 6.10 leaves x_N to the
/// final cost alone, here every step counts.
double running_cost(const TaskGeometry& geometry, const Objective& objective, std::span<const double> u_before,
                    std::span<const double> u, const State& x0, const State& x1);

}  // namespace jostle::physics_pool
