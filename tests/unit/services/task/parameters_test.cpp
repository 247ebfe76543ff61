#include "services/task/config/parameters.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "planners/controllers/catalogue.hpp"
#include "services/task/config/parameter_keys.hpp"
#include "tests/support/costs.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::task {
namespace {

using testing::HasSubstr;

Parameters parsed(const std::string& text) {
  auto result = parse_parameters(text, "p.yaml");
  if (!result) {
    ADD_FAILURE() << result.error().message;
    return {};
  }
  return std::move(result).value();
}

TEST(Parameters, KeepDefaultsOfWhatTheFileLeavesOut) {
  const Parameters sut = parsed("planner: {rollouts: 17}\n"), wanted;
  EXPECT_EQ(sut.planner.rollouts, 17);
  EXPECT_EQ(sut.planner.sigma, wanted.planner.sigma);
  EXPECT_EQ(sut.planner.limit, wanted.planner.limit);
  EXPECT_EQ(sut.planner.update, wanted.planner.update);
  EXPECT_EQ(sut.planner.lambda, wanted.planner.lambda);
  EXPECT_EQ(sut.planner.min_steps, wanted.planner.min_steps);
  EXPECT_EQ(sut.planner.step_duration, wanted.planner.step_duration);
  EXPECT_EQ(sut.planner.stop_losers, wanted.planner.stop_losers);
  EXPECT_EQ(sut.objective.weight("goal"), wanted.objective.weight("goal"));
  EXPECT_EQ(sut.objective.value("edge", "exponent_max"), wanted.objective.value("edge", "exponent_max"));
  EXPECT_EQ(sut.objective.success_cost, wanted.objective.success_cost);
  EXPECT_EQ(sut.controller.control.many_iterations, wanted.controller.control.many_iterations);
  EXPECT_EQ(sut.controller.control.deviation_threshold, wanted.controller.control.deviation_threshold);
  EXPECT_EQ(sut.limits.timeout, wanted.limits.timeout);
  EXPECT_EQ(sut.controller.control.close_hand, wanted.controller.control.close_hand);
}

// Whatever the catalogue has, files may say.
TEST(Parameters, TakeEveryTermOfTheCatalogue) {
  for (const physics_pool::TermKind* kind : physics_pool::term_catalogue()) {
    EXPECT_EQ(parsed(fmt::format("objective: {{{}: 0.125}}", kind->name)).objective,
              tests::objective_with({{kind->name, 0.125}}));
    for (const physics_pool::TermParameter& parameter : kind->parameters) {
      const std::string key = fmt::format("{}_{}", kind->name, parameter.name);
      EXPECT_EQ(parsed(fmt::format("objective: {{{}: 0.125}}", key)).objective, tests::objective_with({{key, 0.125}}));
    }
  }
}

TEST(Parameters, StillCallTheGoalsAngleByItsFirstName) {
  EXPECT_EQ(parsed("objective: {angle: 7}\n").objective, tests::objective_with({{"goal_angle", 7}}));
}

TEST(Parameters, TakeEveryKey) {
  const Parameters sut = parsed(R"(
step_duration: 0.5
min_steps: 4
planner: {rollouts: 3, sigma: [1, 2, 3, 4], limit: [5, 6, 7, 8], scales: [0.5, 2], update: cost-weighted, lambda: 9, persistence: 0.9, stop_losers: false,
          stop_hopeless: true, freeze: true, screening: 32, screening_time_step: 0.005}
objective: {goal: 10, angle: 11, acceleration: 12, disturbance: 13, disturbance_rotation: 14, edge: 15, edge_rate: 16,
            edge_exponent_max: 17, edge_margin: 18, topple: 19, topple_angle: 0.2, drop: 21, drop_height: 22, success_cost: 23, obstruction: 24,
            obstacle_target: 25, obstacle_pusher: 26, obstacle_nearest: 27, intrusion: 28, collision: 29}
control: {many_iterations: 24, few_iterations: 25, deviation_threshold: 26, initial_steps: 27, straight_speed: 0.28,
          few_iterations_max: 30, obstruction_patience: 31,
          timeout: 29.5, max_rollouts: 37, close_hand: false}
mpc: {horizon: 32, first_iterations: 33, iterations: 34, max_actions: 35, straight_speed: 0.36}
adaptive: {sequences: 41, least_actions: 2, most_actions: 42, samples: 43, iterations: 44, noise: 0.45, rest: 0.46, value: printed, max_actions: 47}
)");
  EXPECT_EQ(sut.planner.step_duration, 0.5);
  EXPECT_EQ(sut.controller.control.step_duration, 0.5);
  EXPECT_EQ(sut.planner.min_steps, 4);
  EXPECT_EQ(sut.controller.control.min_steps, 4);
  EXPECT_EQ(sut.planner.rollouts, 3);
  EXPECT_THAT(sut.planner.sigma, testing::ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(sut.planner.limit, testing::ElementsAre(5, 6, 7, 8));
  EXPECT_THAT(sut.planner.scales, testing::ElementsAre(0.5, 2));
  EXPECT_EQ(sut.planner.update, planners::PbstoOptions::Update::kCostWeighted);
  EXPECT_EQ(sut.planner.lambda, 9);
  EXPECT_EQ(sut.planner.persistence, 0.9);
  EXPECT_FALSE(sut.planner.stop_losers);
  EXPECT_TRUE(sut.planner.stop_hopeless);
  EXPECT_TRUE(sut.planner.freeze);
  EXPECT_EQ(sut.planner.screening, 32);
  EXPECT_EQ(sut.planner.screening_time_step, 0.005);
  EXPECT_EQ(sut.objective, tests::objective_with({{"goal", 10},
                                                  {"goal_angle", 11},
                                                  {"acceleration", 12},
                                                  {"disturbance", 13},
                                                  {"disturbance_rotation", 14},
                                                  {"edge", 15},
                                                  {"edge_rate", 16},
                                                  {"edge_exponent_max", 17},
                                                  {"edge_margin", 18},
                                                  {"topple", 19},
                                                  {"topple_angle", 0.2},
                                                  {"drop", 21},
                                                  {"drop_height", 22},
                                                  {"success_cost", 23},
                                                  {"obstruction", 24},
                                                  {"obstacle_target", 25},
                                                  {"obstacle_pusher", 26},
                                                  {"obstacle_nearest", 27},
                                                  {"intrusion", 28},
                                                  {"collision", 29}}));
  EXPECT_EQ(sut.controller.control.many_iterations, 24);
  EXPECT_EQ(sut.controller.control.few_iterations, 25);
  EXPECT_EQ(sut.controller.control.deviation_threshold, 26);
  EXPECT_EQ(sut.controller.control.initial_steps, 27);
  EXPECT_EQ(sut.controller.control.straight_speed, 0.28);
  EXPECT_EQ(sut.controller.control.few_iterations_max, 30);
  EXPECT_EQ(sut.controller.control.obstruction_patience, 31);
  EXPECT_EQ(sut.limits.timeout, std::chrono::milliseconds(29500));
  EXPECT_FALSE(sut.controller.control.close_hand);
  EXPECT_EQ(sut.controller.mpc.horizon, 32);
  EXPECT_EQ(sut.controller.mpc.first_iterations, 33);
  EXPECT_EQ(sut.controller.mpc.iterations, 34);
  EXPECT_EQ(sut.controller.mpc.max_actions, 35);
  EXPECT_EQ(sut.controller.mpc.straight_speed, 0.36);
  EXPECT_EQ(sut.controller.mpc.step_duration, 0.5);
  EXPECT_EQ(sut.limits.rollouts, 37u);
  EXPECT_EQ(sut.controller.adaptive, (planners::AdaptiveOptions{.sequences = 41,
                                                                .least_actions = 2,
                                                                .most_actions = 42,
                                                                .samples = 43,
                                                                .iterations = 44,
                                                                .noise = 0.45,
                                                                .rest = 0.46,
                                                                .value = planners::AdaptiveOptions::Value::kPrinted,
                                                                .step_duration = 0.5,
                                                                .max_actions = 47}));
}

TEST(Parameters, OfAdaptiveControlAreThoseOfTheCode) {
  const auto result = load_parameters(std::filesystem::path(JOSTLE_SOURCE_DIR) / "experiments/adaptive.yaml");
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->controller.adaptive, planners::AdaptiveOptions{});
}

// experiments/pushing.yaml says what the code's defaults of pushing are.
TEST(Parameters, OfPushingAreThoseOfTheCode) {
  const auto result = load_parameters(std::filesystem::path(JOSTLE_SOURCE_DIR) / "experiments/pushing.yaml");
  ASSERT_TRUE(result) << result.error().message;
  const planners::MpcOptions &mpc = result->controller.mpc, defaults;
  EXPECT_EQ(mpc.horizon, defaults.horizon);
  EXPECT_EQ(mpc.first_iterations, defaults.first_iterations);
  EXPECT_EQ(mpc.iterations, defaults.iterations);
  EXPECT_EQ(mpc.max_actions, defaults.max_actions);
  EXPECT_EQ(mpc.straight_speed, defaults.straight_speed);
  EXPECT_EQ(result->limits.timeout, planners::RunLimits{}.timeout);
}

// Controllers' files are for one robot, and others do their tasks, too.
TEST(StandardParameters, AreOfTheAxesThatARobotHas) {
  physics_pool::Scene pusher = tests::push_ahead(), gripper = tests::push_ahead();
  gripper.robot.model = tests::three_objects().robot.model;
  for (const planners::ControllerKind* kind : planners::controllers()) {
    for (const physics_pool::Scene& scene : {pusher, gripper}) {
      if (!kind->fits(scene)) continue;
      const auto result = standard_parameters(*kind, &scene);
      ASSERT_TRUE(result) << kind->name << ": " << result.error().message;
      EXPECT_TRUE(check_fit(*result, scene)) << kind->name << " with " << scene.robot.model.name;
    }
  }
  const auto adaptive = standard_parameters(**planners::find_controller("tampc", pusher), &pusher).value().planner;
  EXPECT_EQ(adaptive.sigma, (std::vector<double>{0.02, 0.02}));
  const auto mpc = standard_parameters(**planners::find_controller("mpc", gripper), &gripper).value().planner;
  EXPECT_EQ(mpc.sigma, (std::vector<double>{0.01, 0.01, 0.0, 0.0}))
      << "axes that the file does not name are held still";
}

struct Case {
  const char *name, *text;
  std::vector<const char*> told;
};
void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

class BadParameters : public testing::TestWithParam<Case> {};

TEST_P(BadParameters, AreRefusedWithFileLineFieldGotAndWanted) {
  const auto result = parse_parameters(GetParam().text, "p.yaml");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kInvalidArgument);
  for (const char* words : GetParam().told) EXPECT_THAT(result.error().message, HasSubstr(words));
}

const std::vector<Case> kCases{
    {"NoScreening", "planner: {screening: 0}\n", {"planner.screening", "got 0", "1 to 10000"}},
    {"LongScreeningStep", "planner: {screening_time_step: 0.1}\n", {"planner.screening_time_step", "got 0.1", "0.02"}},
    {"OddScreeningStep",
     "planner: {screening: 2, screening_time_step: 0.007}\n",
     {"planner.screening_time_step", "0.007", "step_duration, 1 s"}},
    {"TooMuchToScreen",
     "planner: {screening: 10000, rollouts: 1000}\n",
     {"planner.rollouts", "planner.screening", "1000000"}},
    {"UnknownKey", "step_duration: 1\nsteps: 3\n", {"p.yaml:2", "steps", "unknown key", "min_steps"}},
    {"UnknownPlannerKey", "planner:\n  rollout: 3\n", {"p.yaml:2", "planner.rollout", "unknown key", "rollouts"}},
    {"UnknownObjectiveKey", "objective: {gaol: 3}\n", {"p.yaml:1", "objective.gaol", "unknown key", "goal"}},
    {"UnknownControlKey", "control: {timeouts: 3}\n", {"p.yaml:1", "control.timeouts", "unknown key", "timeout"}},
    {"UnknownUpdate", "planner: {update: best}\n", {"p.yaml:1", "planner.update", "'best'", "greedy or cost-weighted"}},
    {"WrongType", "planner:\n  rollouts: many\n", {"p.yaml:2", "planner.rollouts", "'many'", "a whole number"}},
    {"ThreeSigmas",
     "planner: {sigma: [1, 2, 3]}\n",
     {"p.yaml", "planner.sigma", "got 3 numbers", "4 of planner.limit", "one of each for every axis"}},
    {"LimitsOfAnotherRobot",
     "planner: {sigma: [1, 2]}\n",
     {"p.yaml", "planner.sigma", "got 2 numbers", "4 of planner.limit"}},
    {"NoHorizon", "mpc: {horizon: 0}\n", {"p.yaml", "mpc.horizon", "got 0", "1 to"}},
    {"FewerThanTheFewest",
     "adaptive: {least_actions: 5, most_actions: 4}\n",
     {"p.yaml: adaptive.least_actions", "got 5", "at most adaptive.most_actions, 4"}},
    {"NoActions", "mpc: {max_actions: 0}\n", {"p.yaml", "mpc.max_actions", "got 0", "1 to"}},
    {"UnknownMpcKey", "mpc: {steps: 3}\n", {"p.yaml:1", "mpc.steps", "unknown key", "horizon"}},
    {"NaNTimeout", "control: {timeout: .nan}\n", {"p.yaml:1", "control.timeout", "nan", "finite"}},
    {"NegativeBudget", "control: {max_rollouts: -3}\n", {"p.yaml:1", "control.max_rollouts", "got -3", "0 to"}},
    {"NegativeSigma",
     "planner:\n  sigma: [1, 1, -1, 1]\n",
     {"p.yaml:2", "planner.sigma", "[1, 1, -1, 1]", "at least 0"}},
    {"PersistenceOfOne", "planner: {persistence: 1}\n", {"p.yaml:1", "planner.persistence", "got 1", "less than 1"}},
    {"NoScales", "planner: {scales: []}\n", {"p.yaml", "planner.scales", "empty", "at least one"}},
    {"NegativeWeight", "objective:\n  goal: -1\n", {"p.yaml:2", "objective.goal", "got -1", "at least 0"}},
    {"NoSteps", "control: {initial_steps: 0}\n", {"p.yaml", "control.initial_steps", "got 0", "1 to"}},
    {"NoRollouts", "planner: {rollouts: 0}\n", {"p.yaml", "planner.rollouts", "got 0", "1 to"}},
    {"NotYaml", "planner: [\n", {"p.yaml:", "not YAML"}},
    {"NotAMapping", "fast\n", {"p.yaml:1", "wanted a mapping"}},
};

INSTANTIATE_TEST_SUITE_P(EveryKind, BadParameters, testing::ValuesIn(kCases),
                         [](const auto& param) { return std::string(param.param.name); });

TEST(Parameters, NameTheFileThatCannotBeRead) {
  const auto result = load_parameters("no/such/file.yaml");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kNotFound);
  EXPECT_THAT(result.error().message, HasSubstr("no/such/file.yaml"));
}

TEST(Parameters, AreLoadedFromAFile) {
  const auto file = std::filesystem::path(testing::TempDir()) / "jostle_parameters_test.yaml";
  std::ofstream(file) << "min_steps: 3\n";
  const auto result = load_parameters(file);
  std::filesystem::remove(file);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->planner.min_steps, 3);
}

// What a file leaves out keeps what it was before, not what the code has.
TEST(Parameters, ChangeOfABaseWhatTheyName) {
  const Parameters base = parsed("planner: {rollouts: 17, freeze: true}\nobjective: {edge_rate: 5}\n");
  const auto result = parse_parameters("planner: {rollouts: 4}\n", "p.yaml", base);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->planner.rollouts, 4);
  EXPECT_TRUE(result->planner.freeze);
  EXPECT_EQ(result->objective.value("edge", "rate"), 5);
}

TEST(Parameters, OfEveryControllerSurviveWritingAndReading) {
  for (const planners::ControllerKind* controller : planners::controllers()) {
    const auto standard = standard_parameters(*controller);
    ASSERT_TRUE(standard) << standard.error().message;
    const auto again = parse_parameters(to_yaml(*standard), "p.yaml");
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_TRUE(differences(*standard, *again).empty());
    EXPECT_EQ(to_yaml(*again), to_yaml(*standard));
  }
}

// Whatever a number is, its text reads back bit-equal.
TEST(Parameters, KeepEveryBit) {
  Parameters odd;
  odd.planner.lambda = 0.1 + 0.2;
  odd.planner.sigma[0] = 1e-17 / 3;
  const auto again = parse_parameters(to_yaml(odd), "p.yaml");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->planner.lambda, odd.planner.lambda);
  EXPECT_EQ(again->planner.sigma, odd.planner.sigma);
}

TEST(ParameterSettings, ChangeWhatTheyNameTheLastOneOfAKeyCounting) {
  const auto result = with_settings(
      {}, {"planner.rollouts=4", "planner.sigma=[1, 2]", "planner.limit=[3, 4]", "min_steps=5", "planner.rollouts=6"});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->planner.rollouts, 6);
  EXPECT_THAT(result->planner.sigma, testing::ElementsAre(1, 2));
  EXPECT_EQ(result->controller.control.min_steps, 5);
}

TEST(ParameterSettings, AreRefusedWithTheReason) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases{
      {"rollouts=4", {"--set", "'rollouts'", "planner.rollouts"}},
      {"planner.rolouts=4", {"--set planner.rolouts", "unknown key", "rollouts"}},
      {"planner.rollouts=0", {"--set planner.rollouts", "got 0", "1 to 1000000"}},
      {"planner.rollouts", {"--set", "'planner.rollouts'", "KEY=VALUE"}},
      {"planner.sigma=[1", {"--set planner.sigma", "'[1'", "[0.1, 0.1]"}},
      {"planner=4", {"--set planner", "'4'", "a mapping"}},
      {"nothing=4", {"--set nothing", "unknown key", "step_duration"}}};
  for (const auto& [setting, told] : cases) {
    const auto result = with_settings({}, {setting});
    ASSERT_FALSE(result) << setting;
    EXPECT_EQ(result.error().code, Code::kInvalidArgument);
    for (const std::string& words : told) EXPECT_THAT(result.error().message, HasSubstr(words));
  }
}

TEST(ParameterKeys, AreEachDocumentedAndWithinTheirOwnRange) {
  std::set<std::string> seen;
  for (const ParameterKey& key : parameter_keys()) {
    EXPECT_TRUE(seen.insert(key.path()).second) << key.path();
    EXPECT_GT(key.meaning.size(), 10u) << key.path();
    EXPECT_EQ(key.meaning.back(), '.') << key.path();
    EXPECT_FALSE(key.wanted().empty()) << key.path();
  }
}

// Setting a key changes this key and no other.
TEST(ParameterKeys, SetWhatTheyGet) {
  const Parameters standard;
  for (const ParameterKey& key : parameter_keys()) {
    ParameterValue value = key.get(standard);
    if (bool* flag = std::get_if<bool>(&value)) *flag = !*flag;
    if (std::int64_t* count = std::get_if<std::int64_t>(&value)) *count += 1;
    if (double* number = std::get_if<double>(&value)) *number += 0.25;
    if (auto* list = std::get_if<std::vector<double>>(&value)) list->front() += 1;
    if (std::string* text = std::get_if<std::string>(&value)) *text = key.words.back();
    Parameters changed;
    key.set(changed, value);
    const auto found = differences(standard, changed);
    ASSERT_EQ(found.size(), 1u) << key.path();
    EXPECT_EQ(found[0].key, key.path());
    EXPECT_EQ(found[0].after, value);
  }
}

}  // namespace
}  // namespace jostle::task
