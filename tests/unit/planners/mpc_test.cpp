#include "planners/mpc/mpc.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/kinematic_world.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;

using testing::HasSubstr;

class MpcTest : public testing::Test {
 protected:
  MpcTest() {
    options.max_actions = 6;
    options.straight_speed = 0.02;  // six actions stay clear of the obstacle
  }

  Outcome outcome() {
    auto result = run_mpc(setup, options, [this](const ControlEvent& event) { phases.push_back(event.phase); });
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  Error error() {
    auto result = run_mpc(setup, options);
    if (result) {
      ADD_FAILURE() << "no error but: " << result->reason;
      return {};
    }
    return result.error();
  }

  double* object(State& state, int i) {
    return &state.q[static_cast<std::size_t>(geometry.layout.objects[std::size_t(i)].q)];
  }

  // Puts object i at (px, py) once `at` actions are done.
  void put_after(int at, int i, double px, double py, double dz = 0.0) {
    robot.after_execute = [=, this](State& state, int actions) {
      if (actions != at) return;
      object(state, i)[0] = px;
      object(state, i)[1] = py;
      object(state, i)[2] += dz;
    };
  }

  const physics_pool::Scene scene = tests::push_around();  // target, other; goal at (0.2, 0)
  const physics_pool::TaskGeometry geometry{scene};
  State x = initial_state(scene);
  tests::KinematicRobot robot{x, 2, kPusherControls};
  tests::KinematicObjects objects{geometry.layout, x};
  tests::KinematicPlanner planner;
  ControlSetup setup{.planner = planner,
                     .robot = robot,
                     .objects = objects,
                     .geometry = geometry,
                     .objective = physics_pool::Objective::standard(),
                     .world = hash_of("world"),
                     .seed = 11,
                     .make_feasible = {}};
  MpcOptions options;
  std::vector<Phase> phases;
};

TEST_F(MpcTest, PlansFirstAroundTheStraightPush) {
  outcome();
  ASSERT_GE(planner.problems.size(), 1u);
  const Problem& first = planner.problems[0];
  EXPECT_EQ(first.initial,
            straight_push(geometry, first.x0, options.horizon, options.step_duration, options.straight_speed));
  EXPECT_EQ(first.iterations, options.first_iterations);
  EXPECT_EQ(first.x0, initial_state(scene));
  EXPECT_EQ(first.world, hash_of("world"));
  EXPECT_EQ(first.seed, 11u);
  EXPECT_EQ(first.stream, 0u);
  EXPECT_THAT(first.u_before, testing::IsEmpty());
}

TEST_F(MpcTest, ExecutesOneActionOfEachPlan) {
  planner.change = [](Plan& plan, int plans) { plan.controls.step(0)[kControlY] = 0.001 * plans; };
  const Outcome result = outcome();
  EXPECT_EQ(result.actions, 6);
  EXPECT_EQ(result.replans, 5);
  ASSERT_EQ(planner.problems.size(), 6u);
  ASSERT_EQ(robot.executed.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_DOUBLE_EQ(robot.executed[i][kControlY], 0.001 * double(i + 1));
  EXPECT_THAT(robot.durations, testing::Each(options.step_duration));
  EXPECT_EQ(result.observed.size(), 7u);
  EXPECT_EQ(result.iterations, options.first_iterations + 5 * options.iterations);
  EXPECT_EQ(result.rollouts, 60u);
  EXPECT_EQ(phases.back(), Phase::kDone);
}

TEST_F(MpcTest, PlansFromWhatItObserves) {
  put_after(1, 0, -0.1, 0.05);
  outcome();
  ASSERT_GE(planner.problems.size(), 2u);
  EXPECT_EQ(object(planner.problems[1].x0, 0)[0], -0.1);
  EXPECT_EQ(object(planner.problems[1].x0, 0)[1], 0.05);
  EXPECT_DOUBLE_EQ(planner.problems[1].x0.q[kJointX], scene.robot.q[0] + robot.executed[0][kControlX]);
}

TEST_F(MpcTest, StartsWarmWithTheShiftedPlanAndAStraightPush) {
  options.straight_speed = 0.1;
  planner.change = [](Plan& plan, int) {
    for (int t = 0; t < plan.controls.steps(); ++t) plan.controls.step(t)[kControlY] = 0.01 * (t + 1);
    // The pusher stays behind it.
    plan.states.back().q[kJointX] = 0.1;
    plan.states.back().q[kJointY] = -0.14;
    const auto target = plan.states.back().q.begin() + 2;
    target[0] = 0.2 - 0.03;  // predicted 5 cm before the goal, 3-4-5
    target[1] = -0.04;
  };
  outcome();
  ASSERT_GE(planner.problems.size(), 2u);
  const Problem& second = planner.problems[1];
  ASSERT_EQ(second.initial.steps(), options.horizon);
  for (int t = 0; t + 1 < options.horizon; ++t) EXPECT_DOUBLE_EQ(second.initial.step(t)[kControlY], 0.01 * (t + 2));
  EXPECT_NEAR(second.initial.step(options.horizon - 1)[kControlX], 0.03, 1e-12);
  EXPECT_NEAR(second.initial.step(options.horizon - 1)[kControlY], 0.04, 1e-12);
  EXPECT_EQ(second.iterations, options.iterations);
}

TEST_F(MpcTest, FillsUpPlansThatSucceedEarly) {
  planner.change = [](Plan& plan, int) {
    plan.controls.truncate(1);
    plan.states.resize(2);
  };
  outcome();
  for (const Problem& problem : planner.problems) EXPECT_EQ(problem.initial.steps(), options.horizon);
}

TEST_F(MpcTest, TellsThePlannerWhatTheRobotIsDoing) {
  outcome();
  for (std::size_t i = 1; i < planner.problems.size(); ++i)
    EXPECT_EQ(planner.problems[i].u_before, robot.executed[i - 1]);
}

TEST_F(MpcTest, DrawsFreshNoiseForEveryPlan) {
  outcome();
  std::uint32_t stream = 0;
  for (const Problem& problem : planner.problems) {
    EXPECT_EQ(problem.stream, stream);
    stream += static_cast<std::uint32_t>(problem.iterations);
  }
}

TEST_F(MpcTest, MakesObservationsFeasibleWhenToldHow) {
  setup.make_feasible = [](State state) {
    state.q[kJointY] += 0.5;
    return state;
  };
  outcome();
  EXPECT_DOUBLE_EQ(planner.problems[0].x0.q[kJointY], 0.5);
}

TEST_F(MpcTest, EndsWhenTheTargetIsInTheGoalRegion) {
  put_after(3, 0, 0.21, 0.02);
  const Outcome result = outcome();
  EXPECT_TRUE(result.success);
  EXPECT_EQ(result.ending, Ending::kSucceeded);
  EXPECT_EQ(result.reason, "target in the goal region");
  EXPECT_EQ(result.actions, 3);
}

TEST_F(MpcTest, PlansNothingWhenTheTargetIsThereAlready) {
  object(x, 0)[0] = 0.2;
  EXPECT_TRUE(outcome().success);
  EXPECT_THAT(planner.problems, testing::IsEmpty());
}

TEST_F(MpcTest, EndsWhenTheTargetHitsTheObstacle) {
  put_after(2, 0, -0.09, 0.0);
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kFailed);
  EXPECT_EQ(result.reason, "target hit the obstacle");
  EXPECT_EQ(result.actions, 2);
}

TEST_F(MpcTest, EndsWhenThePusherHitsTheObstacle) {
  robot.after_execute = [](State& state, int) { state.q[kJointX] = 0.05; };
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kFailed);
  EXPECT_EQ(result.reason, "pusher hit the obstacle");
  EXPECT_EQ(result.actions, 1);
}

TEST_F(MpcTest, EndsWithTheNameOfWhatWasDropped) {
  put_after(2, 1, 0.0, 0.25, -0.5);
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kFailed);
  EXPECT_EQ(result.reason, "dropped other");
  EXPECT_THAT(result.dropped, testing::ElementsAre("other"));
}

TEST_F(MpcTest, EndsWithTheNameOfWhatIsInTheGoalRegion) {
  put_after(2, 1, 0.2, 0.03);
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kFailed);
  EXPECT_EQ(result.reason, "other in the goal region");
}

TEST_F(MpcTest, GivesUpAfterTheLastAction) {
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kFailed);
  EXPECT_EQ(result.reason, "not there after 6 actions");
  EXPECT_EQ(planner.problems.size(), 6u);
}

TEST_F(MpcTest, SucceedsWithTheLastAction) {
  put_after(6, 0, 0.2, 0.0);
  EXPECT_TRUE(outcome().success);
}

TEST_F(MpcTest, MovesNothingWhenOnlyAPlanIsWanted) {
  options.plan_only = true;
  Outcome result = outcome();
  EXPECT_TRUE(result.success);
  EXPECT_EQ(result.ending, Ending::kSucceeded);
  EXPECT_EQ(result.reason, "plan reaches the goal region; not executed");
  EXPECT_EQ(result.first_plan.controls, planner.problems[0].initial);
  EXPECT_THAT(robot.executed, testing::IsEmpty());
  planner.predicts_goal = false;
  result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kFailed);
  EXPECT_EQ(result.reason, "plan does not reach the goal region; not executed");
}

TEST_F(MpcTest, ReportsATimeoutAsAnOutcome) {
  planner.error = Error{Code::kDeadline, "too late"};
  EXPECT_EQ(outcome().ending, Ending::kTimedOut);
  EXPECT_THAT(outcome().reason, HasSubstr("timeout"));
  planner.error.reset();
  setup.limits.timeout = std::chrono::milliseconds(0);
  EXPECT_EQ(outcome().ending, Ending::kTimedOut);
  EXPECT_THAT(robot.executed, testing::IsEmpty());
}

TEST_F(MpcTest, PassesOnTheErrorsOfItsParts) {
  planner.error = Error{Code::kUnavailable, "no workers"};
  EXPECT_EQ(error().message, "no workers");
  planner.error.reset();
  robot.execute_error = Error{Code::kUnavailable, "robot gone"};
  EXPECT_EQ(error().message, "robot gone");
  robot.read_error = Error{Code::kUnavailable, "robot silent"};
  EXPECT_EQ(error().message, "robot silent");
  robot.read_error.reset();
  objects.hidden = "other";
  EXPECT_THAT(error().message, HasSubstr("no measurement of 'other'"));
}

TEST_F(MpcTest, EndsWhenCancelled) {
  std::stop_source stop;
  robot.after_execute = [&](State&, int actions) {
    if (actions == 2) stop.request_stop();
  };
  const auto result = run_mpc(setup, options, {}, stop.get_token());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kCancelled);
  EXPECT_EQ(robot.executed.size(), 2u);
}

TEST_F(MpcTest, StraightPushEndsAtTheGoalAndKeepsToTheSpeed) {
  const ControlSequence fast = straight_push(geometry, x, 8, 1.0, 0.1);  // 0.4 m in 8 s
  ASSERT_EQ(fast.steps(), 8);
  ASSERT_EQ(fast.nu, kPusherControls);
  EXPECT_NEAR(fast.step(7)[kControlX], 0.05, 1e-12);
  EXPECT_NEAR(fast.step(7)[kControlY], 0.0, 1e-12);
  object(x, 0)[1] = -0.3;  // 3-4-5
  x.q[kJointX] = -0.2 - 0.08;
  x.q[kJointY] = -0.3 - 0.06;
  const ControlSequence slow = straight_push(geometry, x, 2, 1.0, 0.1);
  EXPECT_NEAR(slow.step(0)[kControlX], 0.08, 1e-12);
  EXPECT_NEAR(slow.step(0)[kControlY], 0.06, 1e-12);
  object(x, 0)[0] = 0.2;
  object(x, 0)[1] = 0.0;
  x.q[kJointX] = 0.1;
  x.q[kJointY] = 0.0;
  EXPECT_THAT(straight_push(geometry, x, 1, 1.0, 0.1).values, testing::ElementsAre(0.0, 0.0));
}

// From in front of the target: round it on the nearer side, then forward again.
TEST_F(MpcTest, StraightPushGoesBehindTheTargetFirst) {
  for (const double side : {-1.0, 1.0}) {
    x.q[kJointX] = object(x, 0)[0] + 0.08;
    x.q[kJointY] = side * 0.02;
    const ControlSequence controls = straight_push(geometry, x, 8, 1.0, 0.1);
    State at = x;
    double widest = 0.0;
    for (int t = 0; t < 8; ++t) {
      EXPECT_LE(std::hypot(controls.step(t)[kControlX], controls.step(t)[kControlY]), 0.1 + 1e-12);
      at = tests::moved(at, controls.step(t), 1.0);
      widest = std::max(widest, side * at.q[kJointY]);
    }
    EXPECT_GT(widest, 0.0654);  // the two radii
    EXPECT_GT(controls.step(7)[kControlX], 0.0);
    EXPECT_NEAR(controls.step(7)[kControlY], 0.0, 1e-12);
  }
}

TEST_F(MpcTest, BeginsAnewWhenThePlanHasLostTheTarget) {
  planner.change = [](Plan& plan, int) {  // sails past, the target stays
    for (int t = 0; t < plan.controls.steps(); ++t) plan.controls.step(t)[kControlY] = 0.07;
  };
  outcome();
  ASSERT_GE(planner.problems.size(), 2u);
  for (const Problem& problem : planner.problems) {
    EXPECT_EQ(problem.initial,
              straight_push(geometry, problem.x0, options.horizon, options.step_duration, options.straight_speed));
  }
}

}  // namespace
}  // namespace jostle::planners
