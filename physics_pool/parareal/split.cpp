#include "physics_pool/parareal/split.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace jostle::physics_pool {
namespace {

double seconds(const SplitProblem& p, int whole) {
  const int sliced = p.samples - whole, iterations = std::min(p.iterations, p.steps);
  const double slices_each = iterations * p.steps - iterations * (iterations - 1) / 2.0;
  // Whole samples fill workers to different heights; slices fill the rest.
  const double work = whole * p.steps + sliced * slices_each;
  const double tallest = std::ceil(static_cast<double>(whole) / p.workers) * p.steps;
  double slices = std::max(tallest, std::ceil(work / p.workers));
  if (sliced > 0) slices = std::max(slices, static_cast<double>(iterations));
  return slices * p.fine + sliced * (1 + iterations) * p.steps * p.coarse;
}

}  // namespace

double parareal_speed_up(int iterations, int workers, int steps, double coarse, double fine) {
  const double ratio = fine > 0 ? coarse / fine : 0.0;
  return 1 / ((1 + iterations) * ratio + static_cast<double>(iterations) / std::min(workers, steps));
}

Split choose_split(const SplitProblem& problem) {
  SplitProblem p = problem;
  p.samples = std::max(p.samples, 1);
  p.workers = std::max(p.workers, 1);
  Split best{.whole = p.samples, .seconds = seconds(p, p.samples)};
  best.all_whole = best.seconds;
  best.all_sliced = seconds(p, 0);
  best.speed_up = parareal_speed_up(p.iterations, p.workers, p.steps, p.coarse, p.fine);
  for (int whole = p.samples - 1; whole >= 0; --whole) {
    const double expected = seconds(p, whole);
    // Less than a twentieth is not worth the loss of exactness.
    if (expected >= 0.95 * best.seconds) continue;
    best.whole = whole;
    best.seconds = expected;
  }
  best.sliced = p.samples - best.whole;
  return best;
}

std::string explain(const Split& split, const SplitProblem& problem) {
  return fmt::format(
      "{} samples x {} steps on {} workers: {} whole, {} in slices of time; expected {:.3f} s, against {:.3f} s with "
      "whole rollouts alone and {:.3f} s with slices alone (c_c {:.1f} us, c_f {:.2f} ms, {} iterations, "
      "Eq. 6.4 gives one sample {:.2f}x)",
      problem.samples, problem.steps, problem.workers, split.whole, split.sliced, split.seconds, split.all_whole,
      split.all_sliced, 1e6 * problem.coarse, 1e3 * problem.fine, problem.iterations, split.speed_up);
}

}  // namespace jostle::physics_pool
