#include "planners/robustness/divergence.hpp"

#include <algorithm>
#include <cmath>

#include "physics_pool/api/rollout.hpp"
#include "physics_pool/task/state_distance.hpp"

namespace jostle::planners {
namespace {

using physics_pool::kInfinity;

constexpr std::size_t kNobody = static_cast<std::size_t>(-1);

std::size_t at(int i) { return static_cast<std::size_t>(i); }

double ratio(double end, double start) {
  if (std::isinf(end)) return kInfinity;
  if (start > 0) return end / start;
  return end > 0 ? kInfinity : 1.0;
}

// E-hat of one world without one of the trajectories.
double metric_without(std::size_t left_out, Metric metric, const Deviations& deviations, int p, int q) {
  double start = 0.0, end = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < deviations.size(); ++i) {
    if (i == left_out) continue;
    start += deviations[i][at(p)];
    end += deviations[i][at(q)];
    largest = std::max(largest, ratio(deviations[i][at(q)], deviations[i][at(p)]));
  }
  return metric == Metric::kExpected ? ratio(end, start) : largest;
}

double worst_without(std::size_t left_out, Metric metric, std::span<const Deviations> worlds, int p, int q) {
  double worst = 0.0;
  for (const Deviations& world : worlds) worst = std::max(worst, metric_without(left_out, metric, world, p, q));
  return worst;
}

}  // namespace

Deviations deviations(const physics_pool::TaskGeometry& geometry, const Trajectory& planned,
                      std::span<const Trajectory> samples, std::span<const int> objects) {
  Deviations result;
  for (const Trajectory& sample : samples) {
    std::vector<double>& row = result.emplace_back(planned.size(), kInfinity);
    for (std::size_t t = 0; t < std::min(planned.size(), sample.size()); ++t) {
      row[t] = physics_pool::objects_distance(geometry, sample[t].q, planned[t].q, objects);
    }
  }
  return result;
}

double path_metric(Metric metric, const Deviations& deviations, int p, int q) {
  return metric_without(kNobody, metric, deviations, p, q);
}

double path_metric(Metric metric, std::span<const Deviations> worlds, int p, int q) {
  return worst_without(kNobody, metric, worlds, p, q);
}

double divergence_rate(double step_metric, double step_duration) { return std::log(step_metric) / step_duration; }

std::vector<double> step_metrics(Metric metric, const Deviations& deviations) {
  std::vector<double> steps;
  const int borders = deviations.empty() ? 0 : static_cast<int>(deviations.front().size());
  for (int t = 0; t + 1 < borders; ++t) steps.push_back(path_metric(metric, deviations, t, t + 1));
  return steps;
}

double segment_metric(std::span<const double> steps, int p, int q) {
  double product = 1.0;
  for (int t = p; t < q; ++t) {
    if (std::isinf(steps[at(t)])) return kInfinity;  // whatever it is multiplied with
    product *= steps[at(t)];
  }
  return product;
}

double segment_metric(std::span<const std::vector<double>> steps, int p, int q) {
  double worst = 0.0;
  for (const std::vector<double>& world : steps) worst = std::max(worst, segment_metric(world, p, q));
  return worst;
}

Estimate estimate(Metric metric, std::span<const Deviations> worlds, int p, int q) {
  Estimate result{.value = path_metric(metric, worlds, p, q), .spread = kInfinity};
  const std::size_t n = worlds.empty() ? 0 : worlds.front().size();
  if (n < 2 || std::isinf(result.value)) return result;
  std::vector<double> values;
  double mean = 0.0, square = 0.0;
  for (std::size_t i = 0; i < n; ++i) values.push_back(worst_without(i, metric, worlds, p, q));
  for (const double value : values) mean += value / static_cast<double>(n);
  for (const double value : values) square += (value - mean) * (value - mean);
  result.spread = std::sqrt(square * static_cast<double>(n - 1) / static_cast<double>(n));
  return result;
}

}  // namespace jostle::planners
