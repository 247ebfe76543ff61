#include "physics_pool/parareal/iteration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace jostle::physics_pool {
namespace {

bool is_finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

}  // namespace

PararealIteration::PararealIteration(const PlanarUpdate& update, CoarseModel& coarse, const State& x0,
                                     ControlSequence controls, double duration, const PararealStop& stop)
    : update_(update),
      coarse_(coarse),
      controls_(std::move(controls)),
      duration_(duration),
      stop_(stop),
      steps_(controls_.steps()) {
  stop_.iterations = std::clamp(stop.iterations, 0, steps_);
  levels_.resize(static_cast<std::size_t>(stop_.iterations) + 1);
  for (Level& each : levels_) {
    each.states.resize(static_cast<std::size_t>(steps_) + 1);
    each.starts.resize(static_cast<std::size_t>(steps_));
    each.coarse.resize(static_cast<std::size_t>(steps_));
    each.slices.resize(static_cast<std::size_t>(steps_), -1);
    each.states[0] = x0;
  }
  level(0).known = 1;
}

void PararealIteration::next_start(std::span<double> planar) const {
  const Level& first = levels_.front();
  to_planar(update_.layout(), first.states[static_cast<std::size_t>(first.known - 1)], planar);
}

void PararealIteration::guess(std::span<const double> planar) {
  Level& first = level(0);
  const auto n = static_cast<std::size_t>(first.known - 1);
  first.starts[n].resize(planar.size());
  to_planar(update_.layout(), first.states[n], first.starts[n]);
  take_coarse(first, n, {planar.begin(), planar.end()}, 0);
  State x = first.states[n];
  if (problem_.empty()) {
    update_.replace(x, planar);
    update_.project(x);
  }
  first.states[n + 1] = std::move(x);
  if (++first.known > steps_) begin();
}

void PararealIteration::begin() {
  if (stop_.iterations == 0) {
    final_level_ = 0;
    return;
  }
  for (std::size_t n = 0; n < static_cast<std::size_t>(steps_); ++n) open_slice(0, n);
  for (int k = 1; k <= stop_.iterations; ++k) know(k, level(k).states[0]);
}

void PararealIteration::open_slice(int k, std::size_t n) {
  Level& here = level(k);
  here.slices[n] = static_cast<int>(fine_.size());
  ready_.push_back({.id = here.slices[n], .level = k, .step = static_cast<int>(n), .start = &here.states[n]});
  fine_.emplace_back();
}

void PararealIteration::take_coarse(Level& here, std::size_t n, std::vector<double> planar, int k) {
  if (!is_finite(planar) && problem_.empty()) {
    problem_ = fmt::format(
        "coarse model '{}': got a state that is not finite after control step {} of iteration {}, "
        "wanted finite numbers",
        coarse_.name(), n, k);
  }
  here.coarse[n] = std::move(planar);
}

void PararealIteration::complete(int slice, State end) {
  fine_[static_cast<std::size_t>(slice)] = std::move(end);
  fill();
}

// The next state of level k is x.
void PararealIteration::know(int k, State x) {
  Level& here = level(k);
  const auto n = static_cast<std::size_t>(here.known++);
  here.states[n] = std::move(x);
  if (here.known > steps_) return judge(k);
  const Level& before = level(k - 1);
  if (here.states[n] == before.states[n]) {
    here.starts[n] = before.starts[n];
    here.coarse[n] = before.coarse[n];
    here.slices[n] = before.slices[n];
    return;
  }
  std::vector<double> planar(static_cast<std::size_t>(update_.planar_layout().size()));
  to_planar(update_.layout(), here.states[n], planar);
  here.starts[n] = planar;
  coarse_.advance(planar, controls_.step(static_cast<int>(n)), duration_);
  take_coarse(here, n, std::move(planar), k);
  if (k < stop_.iterations) open_slice(k, n);  // nothing starts from the last level
}

// Makes every entry that can be made.
void PararealIteration::fill() {
  for (int k = 0; k < stop_.iterations && !done() && problem_.empty(); ++k) {
    Level& here = level(k);
    Level& next = level(k + 1);
    while (next.known <= steps_ && next.known <= here.known) {
      const auto n = static_cast<std::size_t>(next.known - 1);
      if (here.slices[n] < 0) break;
      const std::optional<State>& fine = fine_[static_cast<std::size_t>(here.slices[n])];
      if (!fine) break;
      State x = *fine;
      if (next.states[n] != here.states[n]) {
        update_.correct(x, {next.starts[n], next.coarse[n]}, {here.starts[n], here.coarse[n]}, stop_.correction_limit);
        update_.project(x);
      }
      know(k + 1, std::move(x));
      if (done() || !problem_.empty()) return;
    }
  }
}

// Level k is complete: is it the last?
void PararealIteration::judge(int k) {
  if (done()) return;
  bool last = k == stop_.iterations;
  if (stop_.adaptive && !last) {
    last = true;
    for (std::size_t n = 1; n <= static_cast<std::size_t>(steps_) && last; ++n) {
      const auto change = update_.change(level(k).states[n], level(k - 1).states[n]);
      last = 1e3 * change.translation <= stop_.translation_mm &&
             change.rotation * 180 / std::numbers::pi <= stop_.rotation_deg;
    }
  }
  if (last) final_level_ = k;
}

}  // namespace jostle::physics_pool
