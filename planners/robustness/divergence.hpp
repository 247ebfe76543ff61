#pragma once
/// \file
/// Divergence metrics: whether trajectories that begin beside a planned one end nearer to it, or further away.
///
/// All functions are pure. Below, i = 1 … N_c counts trajectories and t = 0 … N the borders of control steps; p < q are
/// two of these borders. The thesis writes sums from i = 0 and products up to t_q; its sums have N_c terms, and its
/// products telescope only if they end one step before t_q.

#include <span>
#include <vector>

#include "physics_pool/task/task_geometry.hpp"
#include "planners/api/robustness.hpp"

namespace jostle::planners {

/// How far each of N_c trajectories is from the planned one: [N_c][N + 1], |x^i_t - x_t|, m. Infinite where a
/// trajectory ended in a divergence of the engine.
using Deviations = std::vector<std::vector<double>>;

/// Returns the deviations of trajectories over chosen objects (`objects_distance`). One that is shorter than the
/// planned one deviates infinitely from where it ends.
Deviations deviations(const physics_pool::TaskGeometry& geometry, const Trajectory& planned,
                      std::span<const Trajectory> samples, std::span<const int> objects);

enum class Metric {
  kExpected,  ///< of the mean deviation (Eq. 4.18)
  kMaximal,   ///< of the trajectory that deviates most, relative to its start (Eq. 4.19)
};

/// Returns E-hat between two borders, in one world:
///
///   expected   sum_i d[i][q] / sum_i d[i][p]      Eq. 4.18, and 4.24 for q = p + 1
///   maximal    max_i d[i][q] / d[i][p]            Eq. 4.19
///
/// Below 1 deviations shrink, above 1 they grow. 0/0 is 1: what did not deviate, and does not, neither shrinks nor
/// grows.
double path_metric(Metric metric, const Deviations& deviations, int p, int q);

/// Returns E-hat^r, the largest over worlds (Eq. 4.23). `worlds`: [N_w + 1], the nominal one first.
double path_metric(Metric metric, std::span<const Deviations> worlds, int p, int q);

/// Returns D-hat, 1/s: the rate of divergence ln(E)/delta_t of a step that takes delta_t (Eq. 4.16, 4.17).
double divergence_rate(double step_metric, double step_duration);

/// Returns the vector of one-step metrics, [N] (Eq. 4.25, whose N + 1 entries belong to N steps).
std::vector<double> step_metrics(Metric metric, const Deviations& deviations);

/// Returns the product of one-step metrics from p to q (Eq. 4.26, 4.27). For the expected metric it is path_metric();
/// for the maximal one only a bound of it from above.
double segment_metric(std::span<const double> steps, int p, int q);

/// Returns the largest product over worlds. The product of each step's worst world would be looser, as no world need be
/// the worst in every step. `steps`: [N_w + 1][N].
double segment_metric(std::span<const std::vector<double>> steps, int p, int q);

/// Returns E-hat^r between two borders with its spread. `worlds`: as above, with the same starts in the same order.
Estimate estimate(Metric metric, std::span<const Deviations> worlds, int p, int q);

}  // namespace jostle::planners
