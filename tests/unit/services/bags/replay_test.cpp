// A run recorded in this process, decided again: equal while nothing changed, and a
// report of where and why it parts where something did.

#include "services/bags/replay/replay.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "physics_pool/local/thread_pool.hpp"
#include "services/bags/replay/report.hpp"
#include "services/task/session/task.hpp"
#include "services/world/in_process/in_process_world.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::bags {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr std::uint64_t kSeed = 3;

class Replay : public testing::Test {
 protected:
  // A grasp in a world that is a little different from what is believed, re-planned after
  // every action; no plan is good enough, so every iteration is made.
  static jostle_msgs::msg::Goal grasp() {
    const physics_pool::Scene scene = tests::three_objects();
    jostle_msgs::msg::Goal goal;
    goal.goal_id("grasp");
    goal.execution_scene(physics_pool::to_yaml(scene));
    goal.planning_scene(physics_pool::to_yaml(physics_pool::perturb(scene, physics_pool::Uncertainty::kLow, kSeed)));
    goal.parameters(
        "planner: {rollouts: 2}\nobjective: {success_cost: 1.0e-9}\n"
        "control: {many_iterations: 4, few_iterations: 2, few_iterations_max: 2, deviation_threshold: 0, timeout: "
        "60}\n");
    goal.controller("or");
    goal.predictor("fine");
    goal.seed(kSeed);
    return goal;
  }

  static const RecordedRun& recorded_grasp() {  // made once: it takes longest
    static const RecordedRun recorded = record(grasp());
    return recorded;
  }

  static jostle_msgs::msg::Goal push() {
    const std::string scene = physics_pool::to_yaml(tests::push_ahead());
    jostle_msgs::msg::Goal goal;
    goal.goal_id("push");
    goal.execution_scene(scene);
    goal.planning_scene(scene);
    goal.parameters("planner: {rollouts: 4, sigma: [0.01, 0.01], limit: [0.1, 0.1]}\n");
    goal.controller("mpc");
    goal.predictor("parareal:1,planar");
    goal.seed(kSeed);
    return goal;
  }

  static RecordedRun record(const jostle_msgs::msg::Goal& goal) {
    RecordedRun recorded{.run = task::describe_run(goal)};
    physics_pool::ThreadPool pool(1);
    task::Task task = std::move(task::Task::prepare(goal, pool)).value();
    auto world = physics_pool::World::compile(task.execution_scene()).value();
    physics_pool::ExecutionWorld execution(world);
    world::SimulatedRobot robot(execution);
    world::SimulatedObjects objects(execution, task.execution_scene());
    const task::Task::Watch watch{
        .journal = {.on_observation =
                        [&](const auto& seen) {
                          recorded.observations.push_back(seen);
                          recorded.observed.push_back(static_cast<Time>(recorded.observed.size()) * 20'000'000);
                        },
                    .on_plan = [&](const auto& plan) { recorded.plans.push_back(plan); }},
        .time = [&] { return execution.time(); }};
    const auto outcome_result = task.perform(robot, objects, watch, {});
    if (!outcome_result) throw std::runtime_error(outcome_result.error().message);
    recorded.result.emplace();
    recorded.result->success(outcome_result->success);
    recorded.result->ending(static_cast<std::uint8_t>(outcome_result->ending));
    recorded.result->reason(outcome_result->reason);
    return recorded;
  }

  ReplayReport again(const RecordedRun& recorded, std::vector<std::string> settings = {}) {
    auto report_result = replay(recorded, {.settings = std::move(settings)}, pool);
    if (!report_result) throw std::runtime_error(report_result.error().message);
    return std::move(report_result).value();
  }

  physics_pool::ThreadPool pool{2};
};

TEST_F(Replay, DecidesTheSameToTheLastBit) {
  for (const RecordedRun& recorded : {recorded_grasp(), record(push())}) {
    SCOPED_TRACE(recorded.run.goal().goal_id());
    ASSERT_GE(recorded.plans.size(), 3u);

    const ReplayReport report = again(recorded);

    EXPECT_TRUE(report.comparison.bit_equal()) << verdict(recorded, report);
    EXPECT_EQ(report.comparison.equal_plans, recorded.plans.size());
    EXPECT_EQ(report.comparison.equal_actions, recorded.observations.size() - 1);
    EXPECT_EQ(report.decisions.plans.size(), recorded.plans.size());
    EXPECT_THAT(verdict(recorded, report), HasSubstr("BIT-EQUAL"));
  }
}

// From a prediction, on a thread beside the one that acts; on two threads here, and on one there.
TEST_F(Replay, MakesPlansAgainThatWereMadeWhileActing) {
  jostle_msgs::msg::Goal restless = grasp();
  std::string parameters = restless.parameters();
  parameters.replace(parameters.find("timeout"), 0, "plan_while_acting: 0.004, ");
  restless.parameters(parameters);
  jostle_msgs::msg::Goal foresees = push();
  foresees.parameters(foresees.parameters() + "control: {plan_while_acting: 0.004}\n");
  for (const RecordedRun& recorded : {record(restless), record(foresees)}) {
    SCOPED_TRACE(recorded.run.goal().goal_id());
    const auto taken = std::ranges::count_if(recorded.plans, [](const auto& plan) { return plan.while_acting(); });
    EXPECT_GE(taken, 1);
    EXPECT_LT(recorded.plans.front().deviation(), 0.0);

    const ReplayReport report = again(recorded);

    EXPECT_TRUE(report.comparison.bit_equal()) << verdict(recorded, report);
    EXPECT_EQ(report.comparison.equal_plans, recorded.plans.size());

    const ReplayReport otherwise = again(recorded, {"control.plan_while_acting=0"});
    ASSERT_FALSE(otherwise.comparison.bit_equal());
    EXPECT_THAT(verdict(recorded, otherwise), HasSubstr("control.plan_while_acting: recorded 0.004, replayed 0"));
  }
}

TEST_F(Replay, TakesItsTimeIfAsked) {
  const RecordedRun recorded = record(push());
  const auto start = std::chrono::steady_clock::now();
  const auto report_result = replay(recorded, {.rate = 0.5}, pool);
  const auto took = std::chrono::steady_clock::now() - start;

  ASSERT_TRUE(report_result);
  EXPECT_TRUE(report_result->comparison.bit_equal());
  EXPECT_GE(took, std::chrono::nanoseconds(2 * recorded.observed.back()));
}

TEST_F(Replay, NamesTheFirstDecisionThatAnOptionChanged) {
  const RecordedRun& recorded = recorded_grasp();

  const ReplayReport report = again(recorded, {"planner.rollouts=3"});

  ASSERT_FALSE(report.comparison.bit_equal());
  EXPECT_THAT(report.comparison.first->decision, HasSubstr("plan 0"));
  EXPECT_THAT(verdict(recorded, report), HasSubstr("why        planner.rollouts: recorded 2, replayed 3"));
  EXPECT_THAT(report.comparison.first->given, HasSubstr("start state"));
}

TEST_F(Replay, AnOptionThatActsLateIsNoticedWhereItActs) {
  const RecordedRun& recorded = recorded_grasp();

  const ReplayReport report = again(recorded, {"control.few_iterations=1", "control.few_iterations_max=1"});

  ASSERT_FALSE(report.comparison.bit_equal());
  EXPECT_GE(report.comparison.equal_plans, 1u);
  EXPECT_THAT(report.comparison.first->decision, HasSubstr("plan 1"));
  EXPECT_EQ(report.comparison.first->field, "iterations allowed");
  EXPECT_EQ(report.comparison.first->recorded, "2");
  EXPECT_EQ(report.comparison.first->replayed, "1");
}

TEST_F(Replay, AnotherControllerPartsWhereItWouldHaveDoneSomethingElse) {
  const RecordedRun& recorded = recorded_grasp();

  const ReplayReport report = again(recorded, {"controller=nr"});

  ASSERT_FALSE(report.comparison.bit_equal());
  EXPECT_GE(report.comparison.equal_plans, 1u);  // the first plan is the same
  EXPECT_THAT(report.reasons(), testing::Contains("controller: recorded or, replayed nr"));
}

TEST_F(Replay, AnotherBuildIsAReason) {
  RecordedRun recorded = record(push());
  recorded.run.engine("MuJoCo 3.9");
  recorded.plans[1].controls()[2] += 1e-15;

  const ReplayReport report = again(recorded);

  ASSERT_FALSE(report.comparison.bit_equal());
  EXPECT_EQ(report.comparison.first->field, "controls, step 1, x");
  EXPECT_THAT(report.reasons(), testing::ElementsAre(HasSubstr("another physics engine: recorded MuJoCo 3.9")));
}

TEST_F(Replay, ARunThatWasInterruptedIsEqualAsFarAsItGoes) {
  RecordedRun recorded = recorded_grasp();
  recorded.observations.resize(2);
  recorded.observed.resize(2);
  std::erase_if(recorded.plans, [](const auto& plan) { return plan.observation() >= 1; });
  recorded.result.reset();

  EXPECT_TRUE(again(recorded).comparison.bit_equal());

  recorded.result.emplace();  // it says that it was over: then nothing may follow
  recorded.result->ending(static_cast<std::uint8_t>(planners::Ending::kSucceeded));
  const ReplayReport report = again(recorded);
  ASSERT_FALSE(report.comparison.bit_equal());
  EXPECT_EQ(report.comparison.first->field, "what comes next");
}

TEST_F(Replay, RefusesSettingsThatMakeNoSense) {
  const RecordedRun recorded = record(push());
  for (const auto& [setting, complaint] :
       {std::pair{"rollouts", "KEY=VALUE"}, std::pair{"planner.rolouts=3", "rolouts"},
        std::pair{"seed=many", "whole number"}, std::pair{"controller=or", "wanted mpc"},
        std::pair{"planner.rollouts=[", "a value as in a file"}}) {
    SCOPED_TRACE(setting);
    const auto report_result = replay(recorded, {.settings = {setting}}, pool);
    ASSERT_FALSE(report_result);
    EXPECT_EQ(report_result.error().code, Code::kInvalidArgument);
    EXPECT_THAT(report_result.error().message, HasSubstr(complaint));
  }
}

TEST_F(Replay, AChangeThatChangesNothingIsStillTold) {
  const RecordedRun recorded = record(push());
  const ReplayReport report = again(recorded, {"control.many_iterations=7"});  // of grasping only
  EXPECT_TRUE(report.comparison.bit_equal());
  EXPECT_THAT(verdict(recorded, report), HasSubstr("control.many_iterations: recorded 50, replayed 7"));
}

}  // namespace
}  // namespace jostle::bags
