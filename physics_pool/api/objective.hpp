#pragma once
/// \file
/// What a rollout is scored by. Evaluated where the simulation runs, so that
/// costs travel and states need not.

namespace jostle::physics_pool {

/// Weights and constants of Eq. 3.2, plus toppling (Eq. 4.37) and dropping; of
/// pushing also those of Eq. 6.10 and Sec. 7.3. Defaults are those of Sec. 3.3.1
/// where the thesis gives one; `docs/chapter3.md` says how the others were chosen,
/// and `experiments/pushing.yaml` has those of pushing. Every weight is >= 0, so a running sum of
/// costs never falls: that is what makes stopping losers early exact.
struct Objective {
  double goal = 10000.0;       ///< w_g, 1/m^2; w of Eq. 6.10 when pushing
  double angle = 1.0;          ///< w_phi, m^2/rad^2; a pusher has no bearing
  double acceleration = 0.1;   ///< w_a, per (m/s)^2 or (rad/s)^2; w_u of Eq. 6.10
  double disturbance = 800.0;  ///< w_d, 1/m^2
  /// Weight of a squared rotation against a squared translation inside c_d,
  /// m^2/rad^2: 0 counts only translations.
  double disturbance_rotation = 0.0;
  double edge = 1.0;          ///< w_e
  double edge_rate = 1000.0;  ///< k, 1/m
  /// Cap of the exponent k·d_E, which reaches 50 in one step without it.
  double edge_exponent_max = 6.0;
  double edge_margin = 0.05;  ///< m; the safe zone is the surface less this much on each side
  double topple = 2000.0;     ///< per toppled object and step, once it lies
  double topple_angle = 0.5;  ///< rad; tilt above which an object counts as toppled
  double drop = 20000.0;      ///< per dropped object and step, once it has fallen; W_E
  double drop_height = 0.02;  ///< m below its resting height at which an object counts as dropped
  /// Per other object whose centre is in the hand at the end. What lodges between
  /// palm and target pushes the target ahead of the hand for ever.
  double obstruction = 1000.0;
  double obstacle_target = 5.0;  ///< w_s, m^2, over the squared distance of target and obstacle
  double obstacle_pusher = 1.0;  ///< w_p, m^2, the same of pusher and obstacle
  /// m; centres closer than this count as this far apart: deep inside any obstacle
  /// there is nothing left to tell apart, and costs stay finite.
  double obstacle_nearest = 0.02;
  /// Per step with the target, or the pusher, over the obstacle, and for each of them.
  /// Eq. 6.10 has nothing of the kind: without it a plan through the obstacle that
  /// ends at the goal is a success.
  double collision = 20000.0;
  double intrusion = 20000.0;  ///< per other object in the goal region and step
  /// C_thresh of Alg. 1: a rollout succeeds when the goal is reached (`at_goal`)
  /// and the cost so far, goal cost included, is at most this.
  double success_cost = 1000.0;
};

}  // namespace jostle::physics_pool
