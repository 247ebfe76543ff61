#include "services/bags/replay/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace jostle::bags {
namespace {

using jostle_msgs::msg::Observation;
using jostle_msgs::msg::Plan;

bool same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return std::ranges::equal(a, b, [](double x, double y) { return same_bits(x, y); });
}

std::string number(double value, const char* unit) { return fmt::format("{:.17g}{}{}", value, *unit ? " " : "", unit); }

struct Axis {
  const char *name, *unit;
};

constexpr Axis kAxes[] = {{"x", "m/s"}, {"y", "m/s"}, {"rotation", "rad/s"}, {"opening", "m/s"}};

std::string decision_of(const Plan& plan) {
  return plan.observation() == 0 ? fmt::format("plan {}, before any action", plan.number())
                                 : fmt::format("plan {}, after action {}", plan.number(), plan.observation());
}

// The first entry of two controls that differs, `nu` to a step.
void describe_controls(const std::vector<double>& recorded, const std::vector<double>& replayed, int nu,
                       Difference& difference) {
  if (recorded.size() != replayed.size()) {
    const auto steps = [nu](std::size_t values) {
      return fmt::format("{} steps", values / static_cast<std::size_t>(std::max(nu, 1)));
    };
    difference.field += ", length";
    difference.recorded = steps(recorded.size());
    difference.replayed = steps(replayed.size());
    return;
  }
  const auto at = std::ranges::mismatch(recorded, replayed, [](double a, double b) { return same_bits(a, b); });
  const auto i = static_cast<std::size_t>(at.in1 - recorded.begin());
  const auto axes = static_cast<std::size_t>(std::max(nu, 1));
  const Axis axis = i % axes < std::size(kAxes) ? kAxes[i % axes] : Axis{"?", ""};
  difference.field += fmt::format(", step {}, {}", i / axes, axis.name);
  difference.recorded = number(*at.in1, axis.unit);
  difference.replayed = number(*at.in2, axis.unit);
}

std::string effect_of(const StateLayout& layout, const Plan& recorded, const Plan& replayed) {
  const auto nq = static_cast<std::size_t>(layout.nq);
  if (layout.target < 0 || recorded.states().size() < nq || replayed.states().size() < nq) return "";
  const auto q = static_cast<std::size_t>(layout.objects[static_cast<std::size_t>(layout.target)].q);
  const double* a = recorded.states().data() + recorded.states().size() - nq + q;
  const double* b = replayed.states().data() + replayed.states().size() - nq + q;
  return fmt::format("the target is predicted to end {:.3g} mm apart; cost {:.6g} recorded, {:.6g} replayed",
                     1e3 * std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]), recorded.cost(), replayed.cost());
}

// What a plan is made from: the first of it that is not equal, or nothing.
std::optional<Difference> compare_given(const Plan& a, const Plan& b) {
  Difference difference{.decision = decision_of(a)};
  const auto differs = [&](const char* field, const auto& recorded, const auto& replayed) {
    if (recorded == replayed) return false;
    difference.field = field;
    difference.recorded = fmt::format("{}", recorded);
    difference.replayed = fmt::format("{}", replayed);
    return true;
  };
  if (a.observation() != b.observation()) {
    difference.decision = fmt::format("plan {}", a.number());
    difference.field = "when it was made";
    difference.recorded = fmt::format("after action {}", a.observation());
    difference.replayed = fmt::format("after action {}", b.observation());
    return difference;
  }
  if (differs("made while acting", a.while_acting(), b.while_acting())) return difference;
  if (!same_bits(a.deviation(), b.deviation())) {
    difference.field = "distance of what was observed from what had been predicted";
    difference.recorded = number(a.deviation(), "m");
    difference.replayed = number(b.deviation(), "m");
    return difference;
  }
  if (!same_bits(a.q(), b.q()) || !same_bits(a.v(), b.v())) {
    difference.field = a.while_acting() ? "predicted start state" : "start state, made feasible";
    difference.recorded = difference.replayed = "the same observation";
    return difference;
  }
  if (!same_bits(a.initial(), b.initial())) {
    difference.field = "candidate it begins with";
    describe_controls(a.initial(), b.initial(), a.nu(), difference);
    return difference;
  }
  if (differs("iterations allowed", a.iterations_allowed(), b.iterations_allowed()) ||
      differs("noise stream", a.stream(), b.stream()) ||
      differs("hand to be cleared", a.clear_hand(), b.clear_hand())) {
    return difference;
  }
  return {};
}

std::optional<Difference> compare_made(const Plan& a, const Plan& b) {
  Difference difference{.decision = decision_of(a),
                        .given = "equal: start state, candidate, iterations allowed, noise stream"};
  if (!same_bits(a.controls(), b.controls())) {
    difference.field = "controls";
    describe_controls(a.controls(), b.controls(), a.nu(), difference);
    return difference;
  }
  if (!same_bits(a.cost(), b.cost())) {
    difference.field = "cost, though the controls are equal";
    difference.recorded = number(a.cost(), "");
    difference.replayed = number(b.cost(), "");
    return difference;
  }
  if (!same_bits(a.states(), b.states())) {
    difference.field = "predicted states, though the controls are equal";
    difference.recorded = difference.replayed = "see the effect";
    return difference;
  }
  if (a.iterations() != b.iterations() || a.rollouts() != b.rollouts()) {
    difference.field = "the search took another path to the same controls";
    difference.recorded = fmt::format("{} iterations, {} rollouts", a.iterations(), a.rollouts());
    difference.replayed = fmt::format("{} iterations, {} rollouts", b.iterations(), b.rollouts());
    return difference;
  }
  return {};
}

std::optional<Difference> compare_action(const Observation& a, const Observation& b) {
  if (same_bits(a.command(), b.command()) && same_bits(a.duration(), b.duration())) return {};
  Difference difference{.decision = fmt::format("action {}", a.number()),
                        .field = "control",
                        .given = "equal: everything observed and planned before it"};
  if (same_bits(a.command(), b.command())) {
    difference.field = "duration";
    difference.recorded = number(a.duration(), "s");
    difference.replayed = number(b.duration(), "s");
  } else {
    describe_controls(a.command(), b.command(), static_cast<int>(std::max(a.command().size(), b.command().size())),
                      difference);
  }
  return difference;
}

// One side decided more than the other.
std::optional<Difference> compare_ends(const RecordedRun& recorded, const Decisions& replayed) {
  const std::size_t plans = recorded.plans.size(), actions = recorded.observations.size() - 1;
  const std::size_t now_plans = replayed.plans.size(), now_actions = replayed.observations.size() - 1;
  Difference difference{.decision = fmt::format("after action {}", std::min(actions, now_actions)),
                        .field = "what comes next",
                        .given = "equal: everything observed, planned and done before it"};
  const std::string end = recorded.result ? fmt::format("ended: {}", recorded.result->reason()) : "ends (cut off)";
  if (now_actions < actions || (now_actions == actions && now_plans < plans)) {
    difference.recorded = now_actions < actions ? "acted once more" : "planned once more";
    difference.replayed = "ended";
    return difference;
  }
  // A run that was interrupted would have gone on in the same way.
  if (recorded.concluded() && (now_plans > plans || replayed.asked_for_more)) {
    difference.recorded = end;
    difference.replayed = now_plans > plans ? "plans once more" : "acts once more";
    return difference;
  }
  return {};
}

}  // namespace

std::optional<Difference> compare(const StateLayout& layout, const Plan& recorded, const Plan& replayed) {
  auto difference = compare_given(recorded, replayed);
  if (!difference) difference = compare_made(recorded, replayed);
  if (difference) difference->effect = effect_of(layout, recorded, replayed);
  return difference;
}

Comparison compare(const StateLayout& layout, const RecordedRun& recorded, const Decisions& replayed) {
  Comparison comparison{.plans = recorded.plans.size(), .actions = recorded.observations.size() - 1};
  // In the order they were made: the action that led to an observation, then the plans that start from it.
  std::size_t plan = 0;
  const auto note = [&](std::optional<Difference> difference, std::size_t& equal) {
    if (!difference)
      ++equal;
    else if (!comparison.first)
      comparison.first = std::move(difference);
  };
  for (std::size_t i = 0; i < std::min(recorded.observations.size(), replayed.observations.size()); ++i) {
    if (i > 0) note(compare_action(recorded.observations[i], replayed.observations[i]), comparison.equal_actions);
    for (; plan < std::min(recorded.plans.size(), replayed.plans.size()) && recorded.plans[plan].observation() <= i;
         ++plan) {
      note(compare(layout, recorded.plans[plan], replayed.plans[plan]), comparison.equal_plans);
    }
  }
  if (!comparison.first) comparison.first = compare_ends(recorded, replayed);
  return comparison;
}

}  // namespace jostle::bags
