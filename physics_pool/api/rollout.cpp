#include "physics_pool/api/rollout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "physics_pool/objective/catalogue.hpp"
#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

Result<void> check_size(const char* field, std::size_t got, std::size_t wanted) {
  if (got == wanted) return {};
  return invalid(field, fmt::format("{} values", got), std::to_string(wanted));
}

Result<void> check_finite(const char* field, const std::vector<double>& values) {
  const auto bad = std::ranges::find_if_not(values, [](double value) { return std::isfinite(value); });
  if (bad == values.end()) return {};
  return invalid(fmt::format("{}[{}]", field, bad - values.begin()), fmt::format("{}", *bad), "a finite number");
}

}  // namespace

ControlSequence sample_controls(const ControlSequence& nominal, const SamplingLaw& law, std::uint32_t sample) {
  ControlSequence controls = nominal;
  const std::uint32_t draw = law.draws.empty() ? sample : law.draws[sample];
  const double scale = law.scales[draw % law.scales.size()];
  const double fresh = std::sqrt(1 - law.persistence * law.persistence);
  std::vector<double> noise(static_cast<std::size_t>(nominal.nu), 0.0);
  for (int t = 0; t < nominal.steps(); ++t) {
    const std::span<double> u = controls.step(t);
    const std::span<const double> sigma = law.sigma_of(t);
    for (std::size_t i = 0; i < u.size(); ++i) {
      if (sigma[i] > 0) {
        const double z = standard_normal(law.seed, {.stream = law.stream,
                                                    .sample = draw,
                                                    .step = static_cast<std::uint32_t>(t),
                                                    .axis = static_cast<std::uint32_t>(i)});
        noise[i] = law.persistence > 0 && t > 0 ? law.persistence * noise[i] + fresh * z : z;
        u[i] += scale * sigma[i] * noise[i];
      }
      u[i] = std::clamp(u[i], -law.limit[i], law.limit[i]);
    }
  }
  return controls;
}

int select_winner(const std::vector<RolloutOutcome>& outcomes, double incumbent) {
  int winner = -1;
  double best = incumbent;
  for (int i = 0; i < static_cast<int>(outcomes.size()); ++i) {
    if (outcomes[i].end == End::kSucceeded) return i;
    if (outcomes[i].end == End::kCompleted && outcomes[i].cost < best) {
      best = outcomes[i].cost;
      winner = i;
    }
  }
  return winner;
}

Result<void> validate(const RolloutBatch& batch) {
  if (batch.nominal.nu < 1 || batch.nominal.nu > 64) {
    return invalid("nominal.nu", std::to_string(batch.nominal.nu), "1 to 64");
  }
  const auto nu = static_cast<std::size_t>(batch.nominal.nu);
  if (batch.nominal.values.empty() || batch.nominal.values.size() % nu != 0) {
    return invalid("nominal.values", fmt::format("{} values", batch.nominal.values.size()),
                   fmt::format("a multiple of nu = {}, at least one step", nu));
  }
  if (batch.nominal.steps() > kMaxSteps) {
    return invalid("nominal.values", fmt::format("{} steps", batch.nominal.steps()),
                   fmt::format("at most {}", kMaxSteps));
  }
  if (batch.samples < 1 || batch.samples > kMaxSamples) {
    return invalid("samples", std::to_string(batch.samples), fmt::format("1 to {}", kMaxSamples));
  }
  if (batch.first_sample > UINT32_MAX - batch.samples) {
    return invalid("first_sample", std::to_string(batch.first_sample), "no wrap-around");
  }
  if (!(batch.step_duration > 0 && batch.step_duration <= kMaxStepDuration)) {
    return invalid("step_duration", fmt::format("{} s", batch.step_duration),
                   fmt::format("more than 0, at most {} s", kMaxStepDuration));
  }
  if (!(batch.rest >= 0 && batch.rest <= kMaxStepDuration)) {
    return invalid("rest", fmt::format("{} s", batch.rest), fmt::format("0 to {} s", kMaxStepDuration));
  }
  if (batch.rest > 0 && batch.stop_hopeless) {
    return invalid("rest", "it together with stop_hopeless",
                   "one of them: the bound of what is to come knows nothing of rests");
  }
  if (batch.x0.q.size() > kMaxStateSize || batch.x0.v.size() > kMaxStateSize) {
    return invalid("x0", fmt::format("{} + {} values", batch.x0.q.size(), batch.x0.v.size()),
                   fmt::format("at most {} each", kMaxStateSize));
  }
  if (std::isnan(batch.incumbent)) return invalid("incumbent", "NaN", "a cost or +inf");
  if (batch.min_steps < 0) return invalid("min_steps", std::to_string(batch.min_steps), ">= 0");
  if (batch.wait && (*batch.wait < batch.wait->zero() || *batch.wait > kMaxWait)) {
    return invalid("wait", fmt::format("{} ns", batch.wait->count()), "0 to 10 s");
  }
  if (batch.priority > Priority::kUrgent) {
    return invalid("priority", std::to_string(static_cast<int>(batch.priority)), "0 (normal) or 1 (urgent)");
  }
  if (auto ok = check_size("u_before", batch.u_before.size(), nu); !ok) return ok;
  if (batch.law.sigma.size() != batch.nominal.values.size()) {
    if (auto ok = check_size("law.sigma", batch.law.sigma.size(), nu); !ok) return ok;
  }
  if (auto ok = check_size("law.limit", batch.law.limit.size(), nu); !ok) return ok;
  for (std::size_t i = 0; i < batch.law.sigma.size(); ++i) {
    if (!(batch.law.sigma[i] >= 0 && std::isfinite(batch.law.sigma[i]))) {
      return invalid(fmt::format("law.sigma[{}]", i), fmt::format("{}", batch.law.sigma[i]), "a finite number >= 0");
    }
  }
  for (std::size_t i = 0; i < nu; ++i) {
    if (!(batch.law.limit[i] > 0)) {
      return invalid(fmt::format("law.limit[{}]", i), fmt::format("{}", batch.law.limit[i]), "> 0");
    }
  }
  if (!(batch.law.persistence >= 0 && batch.law.persistence < 1)) {
    return invalid("law.persistence", fmt::format("{}", batch.law.persistence), "at least 0, less than 1");
  }
  const std::size_t last = std::size_t{batch.first_sample} + batch.samples;
  if (!batch.law.draws.empty() && batch.law.draws.size() < last) {
    return invalid("law.draws", fmt::format("{} values", batch.law.draws.size()),
                   fmt::format("none, or one for each of {} samples", last));
  }
  if (!(batch.fidelity.time_step >= 0 && batch.fidelity.time_step <= kMaxTimeStep)) {
    return invalid("fidelity.time_step", fmt::format("{} s", batch.fidelity.time_step),
                   fmt::format("0 for the world's own, at most {} s", kMaxTimeStep));
  }
  if (batch.law.stream >= kSamplingStreams) {
    return invalid("law.stream", std::to_string(batch.law.stream), fmt::format("less than {}", kSamplingStreams));
  }
  for (const auto& [field, value] : {std::pair("noise.sigma", batch.noise.sigma), {"noise.slope", batch.noise.slope}}) {
    if (value >= 0 && std::isfinite(value)) continue;
    return invalid(field, fmt::format("{}", value), "a finite number >= 0");
  }
  if (!batch.noise.is_off() && batch.fidelity != Fidelity{}) {
    return invalid("noise", "it together with a fidelity",
                   "one of them: what is frozen gets no noise, and noise belongs to the world's own time step");
  }
  if (batch.law.scales.empty() || batch.law.scales.size() > kMaxScales) {
    return invalid("law.scales", fmt::format("{} values", batch.law.scales.size()), fmt::format("1 to {}", kMaxScales));
  }
  for (std::size_t i = 0; i < batch.law.scales.size(); ++i) {
    const double scale = batch.law.scales[i];
    if (scale >= 0 && std::isfinite(scale)) continue;
    return invalid(fmt::format("law.scales[{}]", i), fmt::format("{}", scale), "a finite number >= 0");
  }
  if (auto ok = check_finite("x0.q", batch.x0.q); !ok) return ok;
  if (auto ok = check_finite("x0.v", batch.x0.v); !ok) return ok;
  if (auto ok = check_finite("u_before", batch.u_before); !ok) return ok;
  if (auto ok = check_finite("nominal.values", batch.nominal.values); !ok) return ok;
  return validate(batch.objective);
}

Result<void> validate(const RolloutBatch& batch, const StateLayout& layout, double time_step) {
  if (auto ok = validate(batch); !ok) return ok;
  if (auto ok = check_size("x0.q", batch.x0.q.size(), layout.nq); !ok) return ok;
  if (auto ok = check_size("x0.v", batch.x0.v.size(), layout.nv); !ok) return ok;
  if (batch.nominal.nu != layout.nu) {
    return invalid("nominal.nu", std::to_string(batch.nominal.nu), std::to_string(layout.nu));
  }
  for (const Term& term : batch.objective.terms) {
    if (!find_term_kind(term.kind)->takes_state || term.values.empty()) continue;
    if (auto ok = check_size(("objective." + term.kind).c_str(), term.values.size(), layout.nq); !ok) return ok;
  }
  time_step = std::max(time_step, batch.fidelity.time_step);
  for (const auto& [field, duration] : {std::pair("step_duration", batch.step_duration), {"rest", batch.rest}}) {
    if (duration == 0) continue;  // only a rest may be
    const double steps = duration / time_step;
    if (steps >= 0.5 && std::abs(steps - std::round(steps)) <= 1e-6 * steps) continue;
    return invalid(field, fmt::format("{} s", duration), fmt::format("a multiple of the time step, {} s", time_step));
  }
  return {};
}

}  // namespace jostle::physics_pool
