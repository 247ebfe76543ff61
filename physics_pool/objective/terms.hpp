#pragma once
/// \file
/// The measures behind the terms of Eq. 3.2 and 6.10, each a small function of states at the borders of a control
/// step. Engine-free. What a task does not have costs 0: obstructions without a hand, an obstacle where there
/// is none.

#include <span>

#include "physics_pool/objective/catalogue.hpp"

namespace jostle::physics_pool {

/// Returns c_a(u_before, u) = |u - u_before|^2.
double acceleration_cost(std::span<const double> u_before, std::span<const double> u);

/// Returns c_d(x0, x1) = sum over the objects but the target of |dp|^2 + w·|rotation|^2.
double disturbance_cost(const TaskGeometry& geometry, const State& x0, const State& x1, double rotation_weight);

struct EdgeCost {
  double rate = 1000.0;       ///< k, 1/m
  double exponent_max = 6.0;  ///< cap of the exponent k·d_E, which reaches 50 in one step without it
  double margin = 0.05;       ///< m; the safe zone is the surface less this much along its border
};

/// Returns c_e(x0, x1) = sum of exp(min(k·d_E, cap)) over all objects outside the safe
/// zone at x1, where d_E is how far the object moved from x0 to x1.
double edge_cost(const TaskGeometry& geometry, const State& x0, const State& x1, const EdgeCost& edge);

struct RimCost {
  double rate = 25.0;          ///< k, 1/m
  double exponent_max = 20.0;  ///< cap of the exponent
  double margin = 0.01;        ///< m; least distance of a safe footprint from the surface's border
  double still = 0.001;        ///< m; an object that moved less was not moved
};

/// Returns the edge cost of Eq. 5.4: the sum of exp(min(k·d_E, cap)) over all objects that were moved from x0 to x1 in
/// the plane, by d_E, and whose footprint at x1, taken as a disc around it, is nearer to the surface's border than
/// `margin`.
double rim_cost(const TaskGeometry& geometry, const State& x0, const State& x1, const RimCost& rim);

/// Returns L_f of a push (Sec. 5.4): (R_o - R_g)^2, m^2, where R_o is the target's distance from the middle of the goal
/// region of radius R_g; 0 inside it and for tasks that have none.
double miss_cost(const TaskGeometry& geometry, const State& x);

/// Returns c_g of Eq. 4.39, d^2 + w_phi·phi^2: d from the point between the hand's pads, where approaches aim to have
/// the target, phi its bearing as the palm sees it. At the pads the thesis's own phi, from the same point as d, is
/// undefined.
double pads_cost(const TaskGeometry& geometry, const State& x, double angle_weight);

struct ObstacleCost {
  double target = 5.0;    ///< w_s, m^2
  double pusher = 1.0;    ///< w_p, m^2
  double nearest = 0.02;  ///< m; centres closer than this count as this far apart: costs stay finite
};

/// Returns w_s/|p_T - p_O|^2 + w_p/|p_P - p_O|^2 for target T, pusher P and obstacle O (Eq. 6.10); 0 without an
/// obstacle.
double obstacle_cost(const TaskGeometry& geometry, const State& x, const ObstacleCost& obstacle);

}  // namespace jostle::physics_pool
