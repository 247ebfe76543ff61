#include "services/task/config/parameter_keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <type_traits>

#include "physics_pool/objective/catalogue.hpp"

namespace jostle::task {
namespace {

using planners::PbstoOptions;

constexpr double kNoMost = std::numeric_limits<double>::max();
constexpr double kManyIterations = 1e6;

// A key that nothing gives or takes yet.
ParameterKey bare(const std::string& path, std::string unit, double least, double most, std::string meaning) {
  const auto dot = path.find('.');
  return {.section = dot == path.npos ? "" : path.substr(0, dot),
          .name = dot == path.npos ? path : path.substr(dot + 1),
          .unit = std::move(unit),
          .least = least,
          .most = most,
          .meaning = std::move(meaning),
          .words = {},
          .also = {},
          .get = {},
          .set = {}};
}

// The key of a field that `access` finds, in constant parameters and in others.
template <class Access>
ParameterKey key(const std::string& path, std::string unit, double least, double most, std::string meaning,
                 Access access) {
  using Field = std::remove_cvref_t<decltype(access(std::declval<Parameters&>()))>;
  using Value = std::conditional_t<std::is_integral_v<Field> && !std::is_same_v<Field, bool>, std::int64_t, Field>;
  ParameterKey key = bare(path, std::move(unit), least, most, std::move(meaning));
  key.get = [access](const Parameters& p) { return ParameterValue(static_cast<Value>(access(p))); };
  key.set = [access](Parameters& p, const ParameterValue& value) {
    access(p) = static_cast<Field>(std::get<Value>(value));
  };
  return key;
}

template <class Access>
ParameterKey flag(const std::string& path, std::string meaning, Access access) {
  return key(path, "", 0, 1, std::move(meaning), access);
}

ParameterKey update_rule() {
  ParameterKey rule = bare("planner.update", "", 0, 0,
                           "How samples become the next candidate: the cheapest one (Eq. 5.7), or their mean with "
                           "weights exp(-cost/lambda) (Eq. 5.8).");
  rule.words = {"greedy", "cost-weighted"};
  rule.get = [words = rule.words](const Parameters& p) {
    return ParameterValue(words[p.planner.update == PbstoOptions::Update::kGreedy ? 0 : 1]);
  };
  rule.set = [words = rule.words](Parameters& p, const ParameterValue& value) {
    const bool is_greedy = std::get<std::string>(value) == words[0];
    p.planner.update = is_greedy ? PbstoOptions::Update::kGreedy : PbstoOptions::Update::kCostWeighted;
  };
  return rule;
}

ParameterKey timeout() {
  ParameterKey timeout =
      bare("control.timeout", "s", 1, 1e6, "Time for planning and acting together (thesis: 15 min).");
  timeout.get = [](const Parameters& p) {
    return ParameterValue(std::chrono::duration<double>(p.limits.timeout).count());
  };
  timeout.set = [](Parameters& p, const ParameterValue& value) {
    p.limits.timeout = std::chrono::milliseconds(std::llround(std::get<double>(value) * 1e3));
  };
  return timeout;
}

void add_planner(std::vector<ParameterKey>& keys) {
  using physics_pool::kMaxSamples;
  keys.push_back(key(
      "planner.rollouts", "", 1, kMaxSamples,
      "Rollouts per iteration (K of Alg. 1); more find more and cost more (thesis: 8 to grasp, 20 to "
      "push).",
      [](auto& p) -> auto& { return p.planner.rollouts; }));
  keys.push_back(key(
      "planner.sigma", "m/s or rad/s", 0, kNoMost,
      "Standard deviation of the noise on the control of each axis of the robot.",
      [](auto& p) -> auto& { return p.planner.sigma; }));
  keys.push_back(key(
      "planner.limit", "m/s or rad/s", 1e-9, kNoMost, "Largest control of each axis, at most the axis's own limit.",
      [](auto& p) -> auto& { return p.planner.limit; }));
  keys.push_back(key(
      "planner.scales", "", 0, kNoMost,
      "Factors of sigma, dealt out to the samples in turn: small ones refine, large ones explore.",
      [](auto& p) -> auto& { return p.planner.scales; }));
  keys.push_back(key(
      "planner.persistence", "", 0, std::nextafter(1.0, 0.0),
      "How much of its noise a sample keeps from one step to the next.",
      [](auto& p) -> auto& { return p.planner.persistence; }));
  keys.push_back(update_rule());
  keys.push_back(key(
      "planner.lambda", "cost", 1e-9, 1e12, "Temperature of the cost-weighted update (Eq. 5.8); a small one is greedy.",
      [](auto& p) -> auto& { return p.planner.lambda; }));
  keys.push_back(flag(
      "planner.stop_losers", "Stops rollouts that can no longer win; never changes a plan.",
      [](auto& p) -> auto& { return p.planner.stop_losers; }));
  keys.push_back(flag(
      "planner.stop_hopeless",
      "Stops losers sooner, counting the cost that is still bound to come "
      "(physics_pool/objective/bound.hpp has the assumption).",
      [](auto& p) -> auto& { return p.planner.stop_hopeless; }));
  keys.push_back(flag(
      "planner.freeze", "Gives objects at rest no freedom until something touches them.",
      [](auto& p) -> auto& { return p.planner.freeze; }));
  keys.push_back(key(
      "planner.screening", "", 1, 1e4,
      "Candidates that are run with long steps for each of the rollouts; the cheapest are run again "
      "with the fine model. 1 screens nothing.",
      [](auto& p) -> auto& { return p.planner.screening; }));
  keys.push_back(key(
      "planner.screening_time_step", "s", 1e-4, physics_pool::kMaxTimeStep,
      "Step of the engine while screening, a part of step_duration; longer is cheaper and ranks worse.",
      [](auto& p) -> auto& { return p.planner.screening_time_step; }));
}

void add_guidance(std::vector<ParameterKey>& keys) {
  keys.push_back(key(
      "planner.guidance", "", 0, 100'000,
      "Candidates per iteration that coarse physics ranks, and of which the engine judges the few best; for a hand "
      "that moves in the plane. In place of Alg. 1, and then rollouts, scales, persistence, update, freezing and "
      "screening have no part in it; or to begin a planner of Ch. 4. 0: without guidance.",
      [](auto& p) -> auto& { return p.guidance.candidates; }));
  keys.push_back(key(
      "planner.guidance_generations", "", 1, 100,
      "Generations that those candidates come in; later ones are drawn around the best of those before.",
      [](auto& p) -> auto& { return p.guidance.generations; }));
  keys.push_back(key(
      "planner.guidance_judged", "", 1, 8,
      "Candidates that the engine judges in an iteration, side by side; doubled after each that the engine denied, up "
      "to "
      "8.",
      [](auto& p) -> auto& { return p.guidance.judged; }));
}

// A phrase of the catalogue as a sentence; symbols such as w_a keep their case.
std::string sentence(std::string text) {
  const bool is_word = text.size() > 1 && std::islower(static_cast<unsigned char>(text[1])) != 0;
  if (is_word) text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  return text + ".";
}

// Every kind of the catalogue by its name, every parameter as KIND_NAME.
void add_objective(std::vector<ParameterKey>& keys) {
  for (const physics_pool::TermKind* kind : physics_pool::term_catalogue()) {
    const std::string name = kind->name;
    ParameterKey weight = bare("objective." + name, kind->unit, 0, kNoMost, "Weight. " + sentence(kind->meaning));
    weight.get = [name](const Parameters& p) { return ParameterValue(p.objective.weight(name)); };
    weight.set = [name](Parameters& p, const ParameterValue& v) { p.objective[name].weight = std::get<double>(v); };
    keys.push_back(std::move(weight));
    for (const physics_pool::TermParameter& parameter : kind->parameters) {
      const std::string part = parameter.name;
      ParameterKey one = bare(fmt::format("objective.{}_{}", name, part), parameter.unit, parameter.least,
                              parameter.most, sentence(parameter.meaning));
      if (one.name == "goal_angle") one.also = "angle";
      one.get = [name, part](const Parameters& p) { return ParameterValue(p.objective.value(name, part)); };
      one.set = [name, part](Parameters& p, const ParameterValue& v) {
        p.objective.value(name, part) = std::get<double>(v);
      };
      keys.push_back(std::move(one));
    }
  }
  keys.push_back(key(
      "objective.success_cost", "cost", 0, kNoMost,
      "A rollout that reaches the goal at no more than this succeeds (C_thresh of Alg. 1).",
      [](auto& p) -> auto& { return p.objective.success_cost; }));
}

void add_control(std::vector<ParameterKey>& keys) {
  keys.push_back(key(
      "control.many_iterations", "", 0, kManyIterations, "Iterations of a whole plan, at most (ManyIter; thesis: 50).",
      [](auto& p) -> auto& { return p.controller.control.many_iterations; }));
  keys.push_back(key(
      "control.few_iterations", "", 0, kManyIterations, "Iterations of a re-plan of `or` (FewIter; thesis: 1).",
      [](auto& p) -> auto& { return p.controller.control.few_iterations; }));
  keys.push_back(key(
      "control.few_iterations_max", "", 0, kManyIterations,
      "few_iterations doubles up to this while re-plans in a row fall short; equal to it, Alg. 2 holds "
      "to the letter.",
      [](auto& p) -> auto& { return p.controller.control.few_iterations_max; }));
  keys.push_back(key(
      "control.deviation_threshold", "m and rad", 0, 1e6,
      "A state that differs more than this from the predicted one makes `or` plan again (SD_thresh; "
      "thesis: 0.5).",
      [](auto& p) -> auto& { return p.controller.control.deviation_threshold; }));
  keys.push_back(key(
      "control.obstruction_patience", "", 0, kManyIterations,
      "After so many re-plans in a row, plans must also clear the hand (objective.obstruction).",
      [](auto& p) -> auto& { return p.controller.control.obstruction_patience; }));
  keys.push_back(key(
      "control.initial_steps", "", 1, physics_pool::kMaxSteps,
      "Actions of the straight line that the first plan improves (thesis: 6).",
      [](auto& p) -> auto& { return p.controller.control.initial_steps; }));
  keys.push_back(key(
      "control.straight_speed", "m/s", 0, 1, "Speed of the single straight step that a re-plan adds (thesis: 0.04).",
      [](auto& p) -> auto& { return p.controller.control.straight_speed; }));
  keys.push_back(flag(
      "control.close_hand", "Closes the fingers on the target at the end.",
      [](auto& p) -> auto& { return p.controller.control.close_hand; }));
  keys.push_back(timeout());
  keys.push_back(key(
      "control.max_rollouts", "", 0, 9e15,
      "Rollouts of all plans together; 0: as many as there is time for. With it a run decides the same "
      "however fast its machines are.",
      [](auto& p) -> auto& { return p.limits.rollouts; }));
  keys.push_back(key(
      "control.plan_while_acting", "m", 0, 1e3,
      "Plans the next action from what the present one is predicted to come to, while the robot acts, and takes that "
      "plan where robot and objects are observed this near to it. 0: plans while the robot stands still.",
      [](auto& p) -> auto& { return p.plan_while_acting; }));
}

void add_mpc(std::vector<ParameterKey>& keys) {
  keys.push_back(key(
      "mpc.horizon", "", 1, physics_pool::kMaxSteps, "Actions of a plan (Sec. 6.3.3: 4).",
      [](auto& p) -> auto& { return p.controller.mpc.horizon; }));
  keys.push_back(key(
      "mpc.first_iterations", "", 0, kManyIterations, "Iterations of the first plan.",
      [](auto& p) -> auto& { return p.controller.mpc.first_iterations; }));
  keys.push_back(key(
      "mpc.iterations", "", 0, kManyIterations, "Iterations of every other plan.",
      [](auto& p) -> auto& { return p.controller.mpc.iterations; }));
  keys.push_back(key(
      "mpc.max_actions", "", 1, kManyIterations, "The task has failed after so many actions (Sec. 6.3.3: 20).",
      [](auto& p) -> auto& { return p.controller.mpc.max_actions; }));
  keys.push_back(key(
      "mpc.straight_speed", "m/s", 0, 1, "Speed of the straight push, at most.",
      [](auto& p) -> auto& { return p.controller.mpc.straight_speed; }));
}

ParameterKey value_rule() {
  using Value = planners::AdaptiveOptions::Value;
  ParameterKey rule = bare("adaptive.value", "", 0, 0,
                           "What stands for the value of the state after an action: the costs from the next action on "
                           "(Eq. 5.3), or line 9 of Alg. 6 as printed, which counts the first action twice.");
  rule.words = {"next", "printed"};
  rule.get = [words = rule.words](const Parameters& p) {
    return ParameterValue(words[p.controller.adaptive.value == Value::kNext ? 0 : 1]);
  };
  rule.set = [words = rule.words](Parameters& p, const ParameterValue& value) {
    p.controller.adaptive.value = std::get<std::string>(value) == words[0] ? Value::kNext : Value::kPrinted;
  };
  return rule;
}

void add_adaptive(std::vector<ParameterKey>& keys) {
  constexpr double kMostCandidates = 1000;
  keys.push_back(key(
      "adaptive.sequences", "", 1, kMostCandidates, "Candidates of a decision (N of Alg. 6).",
      [](auto& p) -> auto& { return p.controller.adaptive.sequences; }));
  keys.push_back(key(
      "adaptive.least_actions", "", 1, physics_pool::kMaxSteps, "Actions of the fastest candidate (n_min of Alg. 7).",
      [](auto& p) -> auto& { return p.controller.adaptive.least_actions; }));
  keys.push_back(key(
      "adaptive.most_actions", "", 1, physics_pool::kMaxSteps,
      "Actions of the slowest candidate (n_max of Alg. 7), and of every one of `uampc` and `slow-mpc`.",
      [](auto& p) -> auto& { return p.controller.adaptive.most_actions; }));
  keys.push_back(key(
      "adaptive.samples", "", 0, physics_pool::kMaxSamples,
      "Noisy rollouts of each candidate's first action (Q of Alg. 6); 0 judges candidates by their plans alone.",
      [](auto& p) -> auto& { return p.controller.adaptive.samples; }));
  keys.push_back(key(
      "adaptive.iterations", "", 0, kManyIterations, "Iterations of the optimizer, at most (I_max of Alg. 9).",
      [](auto& p) -> auto& { return p.controller.adaptive.iterations; }));
  keys.push_back(key(
      "adaptive.noise", "", 0, 1e3,
      "How the planner believes noise to grow with speed (b of Eq. 5.10; thesis: 0.05, 0.075 or 0.1).",
      [](auto& p) -> auto& { return p.controller.adaptive.noise; }));
  keys.push_back(key(
      "adaptive.rest", "s", 0, physics_pool::kMaxStepDuration,
      "No control for so long after every action (t_rest of Sec. 5.2).",
      [](auto& p) -> auto& { return p.controller.adaptive.rest; }));
  keys.push_back(value_rule());
  keys.push_back(key(
      "adaptive.max_actions", "", 1, kManyIterations, "The task has failed after so many actions.",
      [](auto& p) -> auto& { return p.controller.adaptive.max_actions; }));
}

ParameterKey judged_objects() {
  using Judged = planners::RobustStoOptions::Judged;
  static constexpr std::array kJudged{Judged::kAll, Judged::kTarget, Judged::kMoved};
  ParameterKey judged =
      bare("robust.judged", "", 0, 0,
           "Whose deviations metrics are made of: all objects (thesis), the target, or the target and "
           "what the plan itself moves (Sec. 8.1.5).");
  judged.words = {"all", "target", "moved"};
  judged.get = [words = judged.words](const Parameters& p) {
    const auto found = std::ranges::find(kJudged, p.controller.robust.planner.judged);
    return ParameterValue(words[static_cast<std::size_t>(found - kJudged.begin())]);
  };
  judged.set = [words = judged.words](Parameters& p, const ParameterValue& value) {
    const auto found = std::ranges::find(words, std::get<std::string>(value));
    p.controller.robust.planner.judged = kJudged[static_cast<std::size_t>(found - words.begin())];
  };
  return judged;
}

void add_robust(std::vector<ParameterKey>& keys) {
  constexpr double kMostStarts = 10'000;
  const auto number = [&](const char* name, const char* unit, double least, double most, const char* meaning,
                          auto access) {
    keys.push_back(key(std::string("robust.") + name, unit, least, most, meaning, access));
  };
  number(
      "starts", "", 0, kMostStarts,
      "Starts beside the seen state, per world (N_c of Eq. 4.18); 0 plans by costs alone.",
      [](auto& p) -> auto& { return p.controller.robust.planner.starts; });
  number(
      "worlds", "", 0, kMostStarts, "Realizations beside the planning world (N_w of Eq. 4.23); `cp` has none.",
      [](auto& p) -> auto& { return p.controller.robust.planner.worlds; });
  number(
      "start_position", "m", 0, 1, "Standard deviation of the starts' positions.",
      [](auto& p) -> auto& { return p.controller.robust.planner.spread.position; });
  number(
      "start_rotation", "rad", 0, 3, "Standard deviation of the starts' headings.",
      [](auto& p) -> auto& { return p.controller.robust.planner.spread.rotation; });
  number(
      "least_mass", "kg", 1e-3, 1e3, "m_l of Eq. 4.22.",
      [](auto& p) -> auto& { return p.controller.robust.planner.bounds.least_mass; });
  number(
      "most_mass", "kg", 1e-3, 1e3, "m_u of Eq. 4.22.",
      [](auto& p) -> auto& { return p.controller.robust.planner.bounds.most_mass; });
  number(
      "least_friction", "", 1e-3, 10, "mu_l of Eq. 4.22.",
      [](auto& p) -> auto& { return p.controller.robust.planner.bounds.least_friction; });
  number(
      "most_friction", "", 1e-3, 10, "mu_u of Eq. 4.22.",
      [](auto& p) -> auto& { return p.controller.robust.planner.bounds.most_friction; });
  number(
      "size", "m", 0, 0.1, "How much longer or shorter each measure of an object may be (p_l, p_u of Eq. 4.22).",
      [](auto& p) -> auto& { return p.controller.robust.planner.bounds.size; });
  keys.push_back(judged_objects());
  number(
      "expected_weight", "cost", 0, kNoMost, "v_e of Eq. 4.28.",
      [](auto& p) -> auto& { return p.controller.robust.planner.expected_weight; });
  number(
      "maximal_weight", "cost", 0, kNoMost, "v_m of Eq. 4.28.",
      [](auto& p) -> auto& { return p.controller.robust.planner.maximal_weight; });
  number(
      "cost_weight", "", 1e-9, 1e9, "v_j of Eq. 4.28.",
      [](auto& p) -> auto& { return p.controller.robust.planner.cost_weight; });
  number(
      "terminal_cost", "cost", 0, kNoMost, "Largest weighted final cost of a feasible plan (alpha of Eq. 4.31).",
      [](auto& p) -> auto& { return p.controller.robust.planner.terminal_cost; });
  number(
      "tolerance", "", 0, 10, "How far above 1 a metric may be of what still counts as robust.",
      [](auto& p) -> auto& { return p.controller.robust.planner.tolerance; });
  number(
      "robust_edge", "", 1e-9, 1e9, "c_ro of the robustness graph (Sec. 4.2).",
      [](auto& p) -> auto& { return p.controller.robust.planner.graph.robust; });
  number(
      "other_edge", "", 1e-9, 1e9, "c_nr of the robustness graph, per step.",
      [](auto& p) -> auto& { return p.controller.robust.planner.graph.not_robust; });
  number(
      "horizon", "", 1, physics_pool::kMaxSteps, "Actions of a plan (N).",
      [](auto& p) -> auto& { return p.controller.robust.horizon; });
  number(
      "iterations", "", 0, kManyIterations, "Iterations of the first plan, at most (I_max of Alg. 5).",
      [](auto& p) -> auto& { return p.controller.robust.iterations; });
  number(
      "mpc_iterations", "", 0, kManyIterations, "Iterations of every plan while the robot waits, at most.",
      [](auto& p) -> auto& { return p.controller.robust.mpc_iterations; });
  number(
      "max_actions", "", 1, kManyIterations,
      "Actions of `cc`, and of `ocl` in its last segment, after which the task has failed.",
      [](auto& p) -> auto& { return p.controller.robust.max_actions; });
  number(
      "interface_distance", "m", 0, 1e3,
      "Where segments of `ocl` meet: closed-loop control ends, and open-loop execution begins, this near to the plan.",
      [](auto& p) -> auto& { return p.controller.robust.interface_distance; });
}

}  // namespace

std::string ParameterKey::wanted() const {
  if (!words.empty()) return fmt::format("{}", fmt::join(words, " or "));
  if (std::holds_alternative<bool>(get(Parameters{}))) return "true or false";
  const bool is_positive = least > 0 && least < 1e-6;  // a range that ends at 0, without it
  if (most == kNoMost) return is_positive ? "more than 0" : fmt::format("at least {}", least);
  if (is_positive) return fmt::format("more than 0, at most {:.10g}", most);
  if (most < 1 && most > 1 - 1e-9) return fmt::format("at least {}, less than 1", least);
  return fmt::format("{} to {:.10g}", least, most);
}

std::vector<ParameterKey> parameter_keys() {
  std::vector<ParameterKey> keys;
  keys.push_back(key(
      "step_duration", "s", 1e-3, physics_pool::kMaxStepDuration, "Duration of one action (Delta_t; thesis: 1).",
      [](auto& p) -> auto& { return p.planner.step_duration; }));
  keys.push_back(key(
      "min_steps", "", 0, physics_pool::kMaxSteps,
      "Success counts from this action of a plan on (n_min of Alg. 1; thesis: 2).",
      [](auto& p) -> auto& { return p.planner.min_steps; }));
  add_planner(keys);
  add_guidance(keys);
  add_objective(keys);
  add_control(keys);
  add_mpc(keys);
  add_adaptive(keys);
  add_robust(keys);
  return keys;
}

std::string to_text(const ParameterValue& value) {
  return std::visit(
      []<class T>(const T& v) {
        if constexpr (std::is_same_v<T, std::vector<double>>) {
          return fmt::format("[{}]", fmt::join(v, ", "));
        } else {
          return fmt::format("{}", v);
        }
      },
      value);
}

std::vector<ParameterDifference> differences(const Parameters& before, const Parameters& after) {
  std::vector<ParameterDifference> found;
  for (const ParameterKey& key : parameter_keys()) {
    ParameterValue old_value = key.get(before), new_value = key.get(after);
    if (old_value == new_value) continue;
    found.push_back({.key = key.path(), .before = std::move(old_value), .after = std::move(new_value)});
  }
  return found;
}

}  // namespace jostle::task
