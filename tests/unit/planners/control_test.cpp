#include "planners/control/controller.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/kinematic_world.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;

using testing::HasSubstr;
using Method = ControlOptions::Method;

class ControllerTest : public testing::Test {
 protected:
  ControllerTest() { options.close_hand = false; }

  Outcome outcome() {
    auto result = run_controller(setup, options, [this](const ControlEvent& event) { phases.push_back(event.phase); });
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  Error error() {
    auto result = run_controller(setup, options);
    if (result) {
      ADD_FAILURE() << "no error but: " << result->reason;
      return {};
    }
    return result.error();
  }

  double* object(int i) { return &x.q[static_cast<std::size_t>(geometry.layout.objects[std::size_t(i)].q)]; }

  const physics_pool::Scene scene = tests::three_objects();
  const physics_pool::TaskGeometry geometry{scene};
  State x = initial_state(scene);
  tests::KinematicRobot robot{x};
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
  ControlOptions options;
  std::vector<Phase> phases;
};

class EitherController : public ControllerTest, public testing::WithParamInterface<Method> {
 protected:
  EitherController() { options.method = GetParam(); }
};

TEST_P(EitherController, GraspsAlongTheStraightLineWhenTheWorldIsAsPredicted) {
  const Outcome result = outcome();
  EXPECT_TRUE(result.success);
  EXPECT_EQ(result.ending, Ending::kSucceeded);
  EXPECT_EQ(result.reason, "target grasped");
  EXPECT_THAT(result.dropped, testing::IsEmpty());
  // It stops as soon as the target is in the hand (OR) or the plan is over (NR).
  EXPECT_LE(result.actions, options.initial_steps);
  EXPECT_GE(result.actions, 1);
  EXPECT_EQ(result.actions, int(robot.executed.size()));
  EXPECT_EQ(result.observed.size(), robot.executed.size() + 1);
  EXPECT_EQ(result.observed.front(), initial_state(scene));
  EXPECT_EQ(phases.back(), Phase::kDone);
  EXPECT_THAT(robot.durations, testing::Each(options.step_duration));
}

TEST_P(EitherController, PlansFirstWithManyIterationsFromTheObservedState) {
  const Outcome result = outcome();
  ASSERT_GE(planner.problems.size(), 1u);
  const Problem& first = planner.problems[0];
  EXPECT_EQ(first.iterations, options.many_iterations);
  EXPECT_EQ(first.x0, initial_state(scene));
  EXPECT_EQ(first.world, hash_of("world"));
  EXPECT_EQ(first.seed, 11u);
  EXPECT_EQ(first.stream, 0u);
  EXPECT_EQ(first.initial, straight_line(geometry, first.x0, options.initial_steps, options.step_duration));
  EXPECT_EQ(result.first_plan.controls, first.initial);
}

TEST_P(EitherController, EndsWithTheNameOfWhatWasDropped) {
  robot.after_execute = [this](State&, int actions) {
    if (actions == 2) object(1)[2] = -0.5;
  };
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kFailed);
  EXPECT_THAT(result.reason, HasSubstr("dropped can"));
  EXPECT_THAT(result.dropped, testing::ElementsAre("can"));
  if (GetParam() == Method::kOnline) {
    EXPECT_EQ(result.actions, 2);
  }
  EXPECT_EQ(planner.problems.size(), 1u);
}

TEST_P(EitherController, NamesEverythingThatWasDropped) {
  robot.after_execute = [this](State&, int) { object(0)[2] = object(2)[2] = -0.5; };
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_THAT(result.dropped, testing::ElementsAre("target", "carton"));
}

TEST_P(EitherController, ReportsATimeoutOfThePlannerAsAnOutcome) {
  planner.error = Error{Code::kDeadline, "too late"};
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kTimedOut);
  EXPECT_THAT(result.reason, HasSubstr("timeout"));
  EXPECT_THAT(robot.executed, testing::IsEmpty());
}

TEST_P(EitherController, CountsWhatAPlanSpentThatRanOutOfTime) {
  planner.error = Error{Code::kDeadline, "too late"};
  planner.rollouts_before_error = 33;
  const Outcome result = outcome();
  EXPECT_EQ(result.rollouts, 33u);
  EXPECT_GT(result.planning_time.count(), 0.0);
  EXPECT_EQ(result.plan_time.count(), 0.0);
  EXPECT_EQ(result.iterations, 0);
}

TEST_P(EitherController, TimeThatRunsOutIsNotRolloutsThatAreSpent) {
  planner.error = Error{Code::kDeadline, "too late"};
  planner.rollouts_before_error = 33;
  setup.limits.rollouts = 25;
  EXPECT_THAT(outcome().reason, HasSubstr("timeout after"));
}

TEST_P(EitherController, ReportsATimeoutBeforeAnActionAsAnOutcome) {
  setup.limits.timeout = std::chrono::milliseconds(0);
  const Outcome result = outcome();
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.ending, Ending::kTimedOut);
  EXPECT_THAT(result.reason, HasSubstr("timeout"));
  EXPECT_THAT(robot.executed, testing::IsEmpty());
}

TEST_P(EitherController, EndsWhenItsRolloutsAreSpent) {
  setup.limits.rollouts = 25;
  planner.predicts_goal = false;
  robot.object_in_hand = false;  // whatever it does
  planner.change = [](Plan& plan, int) { plan.rollouts = 10; };
  const Outcome result = outcome();
  EXPECT_EQ(result.ending, Ending::kTimedOut);
  EXPECT_EQ(result.reason, "all 25 rollouts are spent");
  std::vector<std::uint64_t> left;
  for (const Problem& problem : planner.problems) left.push_back(problem.rollouts);
  EXPECT_THAT(left, testing::ElementsAre(25, 15, 5));
}

TEST_P(EitherController, GivesThePlannerTheDeadlineOfTheWholeTask) {
  setup.limits.timeout = std::chrono::hours(3);
  const auto before = std::chrono::steady_clock::now();
  (void)outcome();
  const auto after = std::chrono::steady_clock::now();
  for (const auto deadline : planner.deadlines) {
    EXPECT_GE(deadline, before + setup.limits.timeout);
    EXPECT_LE(deadline, after + setup.limits.timeout);
  }
}

TEST_P(EitherController, PassesErrorsOfItsPartsOn) {
  const Error failure{Code::kUnavailable, "silent since 3 s"};
  const auto expect_passed_on = [&](std::optional<Error>& part) {
    part = failure;
    EXPECT_EQ(error().code, failure.code);
    EXPECT_EQ(error().message, failure.message);
    part.reset();
  };
  expect_passed_on(robot.read_error);
  expect_passed_on(robot.execute_error);
  expect_passed_on(objects.error);
  expect_passed_on(planner.error);
}

TEST_P(EitherController, NamesTheObjectThatNobodySees) {
  objects.hidden = "carton";
  const Error problem = error();
  EXPECT_EQ(problem.code, Code::kInvalidArgument);
  EXPECT_THAT(problem.message, HasSubstr("'carton'"));
}

TEST_P(EitherController, IsCancelledByAStopRequest) {
  std::stop_source stop;
  stop.request_stop();
  const auto result = run_controller(setup, options, {}, stop.get_token());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kCancelled);
  EXPECT_THAT(robot.executed, testing::IsEmpty());
}

TEST_P(EitherController, ExecutesNothingWhenOnlyPlanning) {
  options.plan_only = true;
  for (const bool grasps : {true, false}) {
    planner.problems.clear();
    planner.predicts_goal = grasps;
    const Outcome result = outcome();
    EXPECT_EQ(result.success, grasps);
    EXPECT_EQ(result.ending, grasps ? Ending::kSucceeded : Ending::kFailed);
    EXPECT_THAT(result.reason, HasSubstr("not executed"));
    EXPECT_EQ(planner.problems.size(), 1u);
    EXPECT_EQ(result.first_plan.controls.steps(), options.initial_steps);
    EXPECT_EQ(result.actions, 0);
  }
  EXPECT_THAT(robot.executed, testing::IsEmpty());
}

TEST_P(EitherController, ClosesTheHandAtTheEndWhenAsked) {
  options.close_hand = true;
  const Outcome result = outcome();
  EXPECT_TRUE(result.success);
  ASSERT_EQ(int(robot.executed.size()), result.actions + 1);
  const std::vector<double>& last = robot.executed.back();
  EXPECT_EQ(last[kControlX], 0.0);
  EXPECT_EQ(last[kControlY], 0.0);
  EXPECT_EQ(last[kControlRotation], 0.0);
  EXPECT_LT(last[kControlOpening], 0.0);
  EXPECT_THAT(phases, testing::Contains(Phase::kClosing));
}

TEST_P(EitherController, OpensTheHandAndTriesAgainWhenTheTargetSlipsOut) {
  options.close_hand = true;
  int closings = 0, openings = 0;
  robot.object_in_hand = false;
  robot.after_execute = [&](State&, int) {
    const double fingers = robot.executed.back()[kControlOpening];
    if (fingers < -0.05) {
      robot.object_in_hand = ++closings > 1;  // the first time it slips
    } else if (fingers > 0.05 && closings == 1 && openings == 0) {
      ++openings;
    } else {
      robot.object_in_hand = true;
    }
  };
  EXPECT_TRUE(outcome().success);
  EXPECT_EQ(closings, 2);
  EXPECT_EQ(openings, 1);
}

TEST_P(EitherController, DoesNotCloseTheHandAfterAFailure) {
  options.close_hand = true;
  robot.after_execute = [this](State&, int) { object(1)[2] = -0.5; };
  EXPECT_FALSE(outcome().success);
  EXPECT_THAT(phases, testing::Not(testing::Contains(Phase::kClosing)));
}

// A gripper that feels the object knows better than a camera.
TEST_P(EitherController, BelievesTheGripper) {
  robot.object_in_hand = false;
  robot.after_execute = [this](State&, int actions) { robot.object_in_hand = actions >= 14; };
  const Outcome result = outcome();
  EXPECT_TRUE(result.success);
  EXPECT_GE(result.actions, 14);
}

TEST_P(EitherController, PlansFromWhatIsFeasible) {
  setup.make_feasible = [](const State& seen) {
    State result = seen;
    result.q[5] += 0.001;
    return result;
  };
  (void)outcome();
  EXPECT_EQ(planner.problems[0].x0.q[5], initial_state(scene).q[5] + 0.001);
}

TEST_P(EitherController, AddsUpRolloutsAndIterations) {
  robot.object_in_hand = false;
  robot.after_execute = [this](State&, int actions) { robot.object_in_hand = actions >= 13; };
  const Outcome result = outcome();
  ASSERT_GT(planner.problems.size(), 1u);
  int iterations = 0;
  std::uint32_t stream = 0;
  for (const Problem& p : planner.problems) {
    EXPECT_EQ(p.stream, stream);  // no noise is used twice
    stream += static_cast<std::uint32_t>(p.iterations);
    iterations += p.iterations;
  }
  EXPECT_EQ(result.iterations, iterations);
  EXPECT_EQ(result.rollouts, 10 * planner.problems.size());
  EXPECT_EQ(result.replans, int(planner.problems.size()) - 1);
}

INSTANTIATE_TEST_SUITE_P(Methods, EitherController, testing::Values(Method::kOnline, Method::kNaive),
                         [](const auto& method) { return method.param == Method::kOnline ? "OR" : "NR"; });

class OnlineReplanning : public ControllerTest {
 protected:
  OnlineReplanning() {
    options.method = Method::kOnline;
    robot.object_in_hand = false;
  }
  void grasp_after(int actions, std::function<void(int)> also = {}) {
    robot.after_execute = [this, actions, also](State&, int done) {
      robot.object_in_hand = done >= actions;
      if (also) also(done);
    };
  }
};

TEST_F(OnlineReplanning, DoesNotReplanWhileAllGoesAsPredicted) {
  grasp_after(options.initial_steps - options.min_steps);
  const Outcome result = outcome();
  EXPECT_EQ(result.replans, 0);
  EXPECT_EQ(planner.problems.size(), 1u);
  EXPECT_EQ(result.actions, options.initial_steps - options.min_steps);
}

TEST_F(OnlineReplanning, ReplansAfterEveryActionWhileNoGraspIsPredicted) {
  planner.predicts_goal = false;
  grasp_after(4);
  const Outcome result = outcome();
  EXPECT_EQ(result.actions, 4);
  EXPECT_EQ(result.replans, 3);  // none before the first action, none after the last
}

TEST_F(OnlineReplanning, IsUrgentOnceTheRobotHasMoved) {
  planner.predicts_goal = false;
  grasp_after(3);
  (void)outcome();
  using physics_pool::Priority;
  std::vector<Priority> priorities;
  for (const Problem& problem : planner.problems) priorities.push_back(problem.priority);
  EXPECT_THAT(priorities, testing::ElementsAre(Priority::kNormal, Priority::kUrgent, Priority::kUrgent));
}

TEST_F(OnlineReplanning, IteratesMoreWhileReplansFallShort) {
  planner.predicts_goal = false;
  options.few_iterations_max = 6;
  grasp_after(6);
  (void)outcome();
  std::vector<int> iterations;
  for (const Problem& problem : planner.problems) iterations.push_back(problem.iterations);
  EXPECT_THAT(iterations, testing::ElementsAre(options.many_iterations, 1, 2, 4, 6, 6));
}

TEST_F(OnlineReplanning, FillsTheHorizonUpWhileReplansFallShort) {
  planner.predicts_goal = false;
  grasp_after(3);
  (void)outcome();
  for (const Problem& problem : planner.problems) EXPECT_EQ(problem.initial.steps(), options.initial_steps);
}

TEST_F(OnlineReplanning, DemandsAClearHandOnlyAfterPatienceAndWithSomethingInIt) {
  planner.predicts_goal = false;
  options.obstruction_patience = 2;
  grasp_after(7, [this](int done) {  // from the fourth action on, the can goes along in the hand
    object(1)[0] = done >= 4 ? x.q[kJointX] + 0.03 : 5.0;
    object(1)[1] = x.q[kJointY];
  });
  (void)outcome();
  std::vector<bool> clear;
  for (const Problem& problem : planner.problems) clear.push_back(problem.objective.weight("obstruction") > 0);
  EXPECT_THAT(clear, testing::ElementsAre(false, false, false, false, true, true, true));
}

TEST_F(OnlineReplanning, BacksOffByAFingersLengthWhenThePlanDropsAnObject) {
  planner.predicts_goal = false;
  planner.change = [this](Plan& plan, int) { plan.cost = setup.objective.weight("drop"); };
  grasp_after(2);
  (void)outcome();
  ASSERT_EQ(planner.problems.size(), 2u);
  const Problem& way_out = planner.problems[1];
  double back = 0.0;
  for (int t = 0; t < way_out.initial.steps(); ++t) back += std::min(way_out.initial.step(t)[kControlX], 0.0);
  EXPECT_NEAR(back, -kHand.finger_length, 1e-12);
  EXPECT_EQ(way_out.initial.steps(), options.initial_steps);
  // and forward again, to where the hand would have gone
  State x1 = way_out.x0;
  for (int t = 0; t < way_out.initial.steps(); ++t) x1 = tests::moved(x1, way_out.initial.step(t), 1.0);
  EXPECT_NEAR(physics_pool::target_bearing(geometry, x1).distance, kHand.depth, 1e-12);
}

TEST_F(OnlineReplanning, ReplansOnceTooFewControlsAreLeft) {
  const int left_when_enough = options.initial_steps - options.min_steps;
  grasp_after(left_when_enough + 2);
  const Outcome result = outcome();
  // The next action leaves min_steps - 1; each re-plan adds one straight step.
  EXPECT_EQ(result.replans, 1);
  ASSERT_EQ(planner.problems.size(), 2u);
  EXPECT_EQ(planner.problems[1].initial.steps(), options.min_steps);
  EXPECT_EQ(planner.problems[1].iterations, options.few_iterations);
}

TEST_F(OnlineReplanning, ReplansWhenTheDeviationExceedsTheThreshold) {
  options.deviation_threshold = 0.02;
  grasp_after(4, [this](int actions) {
    if (actions == 2) object(2)[0] += 0.021;
  });
  EXPECT_EQ(outcome().replans, 1);
}

TEST_F(OnlineReplanning, DoesNotReplanWhenTheDeviationStaysBelowTheThreshold) {
  options.deviation_threshold = 0.02;
  grasp_after(4, [this](int actions) {
    if (actions == 2) object(2)[0] += 0.019;
  });
  EXPECT_EQ(outcome().replans, 0);
}

TEST_F(OnlineReplanning, WarmStartsWithTheRestOfThePlanAndOneStraightStep) {
  planner.predicts_goal = false;
  planner.change = [](Plan& plan, int) {
    for (int t = 0; t < plan.controls.steps(); ++t) plan.controls.step(t)[kControlRotation] = 0.01 * (t + 1);
  };
  grasp_after(2);
  (void)outcome();
  ASSERT_EQ(planner.problems.size(), 2u);
  const ControlSequence& warm = planner.problems[1].initial;
  ASSERT_EQ(warm.steps(), options.initial_steps);
  for (int t = 0; t + 1 < warm.steps(); ++t) EXPECT_DOUBLE_EQ(warm.step(t)[kControlRotation], 0.01 * (t + 2));
  const auto last = warm.step(warm.steps() - 1);
  EXPECT_LE(std::hypot(last[kControlX], last[kControlY]), options.straight_speed + 1e-12);
  EXPECT_EQ(planner.problems[1].x0, tests::moved(initial_state(scene), robot.executed[0], 1.0));
}

TEST_F(OnlineReplanning, AddsAStraightStepAtStraightSpeedTowardsTheTarget) {
  planner.predicts_goal = false;
  // A plan that leads nowhere: predicted and observed hand stay where they are.
  planner.change = [this](Plan& plan, int) {
    std::fill(plan.controls.values.begin(), plan.controls.values.end(), 0.0);
    std::fill(plan.states.begin(), plan.states.end(), initial_state(scene));
  };
  grasp_after(2);
  (void)outcome();
  const ControlSequence& warm = planner.problems.at(1).initial;
  const auto last = warm.step(warm.steps() - 1);
  const double dx = initial_state(scene).q[5] - scene.robot.q[0], dy = initial_state(scene).q[6] - scene.robot.q[1];
  EXPECT_NEAR(last[kControlX], options.straight_speed * dx / std::hypot(dx, dy), 1e-12);
  EXPECT_NEAR(last[kControlY], options.straight_speed * dy / std::hypot(dx, dy), 1e-12);
  EXPECT_EQ(last[kControlOpening], 0.0);
}

TEST_F(OnlineReplanning, NeverRunsOutOfControls) {
  options.min_steps = 0;
  grasp_after(options.initial_steps + 3);
  const Outcome result = outcome();
  EXPECT_TRUE(result.success);
  EXPECT_EQ(result.actions, options.initial_steps + 3);
}

TEST_F(OnlineReplanning, StopsAsSoonAsTheTargetIsInTheHand) {
  grasp_after(1);
  EXPECT_EQ(outcome().actions, 1);
}

class NaiveReplanning : public ControllerTest {
 protected:
  NaiveReplanning() {
    options.method = Method::kNaive;
    robot.object_in_hand = false;
  }
};

TEST_F(NaiveReplanning, ExecutesTheWholePlanBeforeItLooksForTheGrasp) {
  robot.after_execute = [this](State&, int) { robot.object_in_hand = true; };
  const Outcome result = outcome();
  EXPECT_TRUE(result.success);
  EXPECT_EQ(result.actions, options.initial_steps);
  EXPECT_EQ(result.replans, 0);
}

TEST_F(NaiveReplanning, PlansAnewFromWhereThePlanEnded) {
  robot.after_execute = [this](State&, int actions) { robot.object_in_hand = actions >= 2 * options.initial_steps; };
  const Outcome result = outcome();
  EXPECT_TRUE(result.success);
  EXPECT_EQ(result.replans, 1);
  EXPECT_EQ(result.actions, 2 * options.initial_steps);
  ASSERT_EQ(planner.problems.size(), 2u);
  EXPECT_EQ(planner.problems[1].iterations, options.many_iterations);
  EXPECT_EQ(planner.problems[1].x0, result.observed[std::size_t(options.initial_steps)]);
  EXPECT_EQ(planner.problems[1].initial,
            straight_line(geometry, planner.problems[1].x0, options.initial_steps, options.step_duration));
}

TEST_F(NaiveReplanning, IgnoresDeviations) {
  options.deviation_threshold = 1e-6;
  robot.after_execute = [this](State&, int actions) {
    object(2)[0] += 0.01;
    robot.object_in_hand = actions >= options.initial_steps;
  };
  EXPECT_EQ(outcome().replans, 0);
}

class StraightLine : public ControllerTest {};

TEST_F(StraightLine, ReachesThePregraspDistanceInItsTime) {
  for (const auto& [px, py] : {std::pair{0.1, 0.0}, {0.1, 0.2}, {-0.2, -0.25}}) {
    object(0)[0] = px;
    object(0)[1] = py;
    State reached = x;
    const ControlSequence controls = straight_line(geometry, x, 6, 0.5);
    ASSERT_EQ(controls.steps(), 6);
    for (int t = 0; t < 6; ++t) reached = tests::moved(reached, controls.step(t), 0.5);
    const double dx = px - reached.q[kJointX], dy = py - reached.q[kJointY];
    EXPECT_NEAR(std::hypot(dx, dy), kHand.depth, 1e-12);
    // On the straight line from the start to the target.
    EXPECT_NEAR(dx * (py - scene.robot.q[1]), dy * (px - scene.robot.q[0]), 1e-12);
  }
}

TEST_F(StraightLine, BacksOffFromATargetThatIsTooClose) {
  x.q[kJointX] = object(0)[0] - 0.01;
  const ControlSequence controls = straight_line(geometry, x, 1, 1.0);
  EXPECT_NEAR(controls.step(0)[kControlX], 0.01 - kHand.depth, 1e-12);
}

TEST_F(StraightLine, StandsStillOnTopOfTheTarget) {
  x.q[kJointX] = object(0)[0];
  x.q[kJointY] = object(0)[1];
  EXPECT_THAT(straight_line(geometry, x, 2, 1.0).values, testing::Each(0.0));
}

class Deviation : public ControllerTest {};

TEST_F(Deviation, IsTheEuclideanDistanceOfJointsAndPoses) {
  State y = x;
  EXPECT_NEAR(state_deviation(geometry.layout, x, y), 0.0, 1e-7);  // acos(1 - eps)
  y.q[kJointX] += 0.3;
  y.q[5 + 7] += 0.4;
  EXPECT_NEAR(state_deviation(geometry.layout, x, y), 0.5, 1e-12);
  y = x;
  // A turn of 0.2 rad about z, and the same turn with the other sign.
  const std::array turned{std::cos(0.1), 0.0, 0.0, std::sin(0.1)};
  for (const double sign : {1.0, -1.0}) {
    for (std::size_t i = 0; i < 4; ++i) y.q[8 + i] = sign * turned[i];
    EXPECT_NEAR(state_deviation(geometry.layout, x, y), 0.2, 1e-9);
    EXPECT_NEAR(state_deviation(geometry.layout, y, x), 0.2, 1e-9);
  }
}

TEST_F(Deviation, IgnoresVelocities) {
  State y = x;
  y.v.assign(y.v.size(), 3.0);
  EXPECT_EQ(state_deviation(geometry.layout, x, y), state_deviation(geometry.layout, x, x));
}

class AssembleState : public ControllerTest {};

TEST_F(AssembleState, PutsReadingsInTheOrderOfTheLayout) {
  for (std::size_t i = 0; i < x.v.size(); ++i) x.v[i] = double(i);
  auto reading = robot.read();
  ASSERT_TRUE(reading);
  reading->v.assign(x.v.begin(), x.v.begin() + 5);
  const auto state = assemble_state(geometry.layout, *reading, *objects.read());
  ASSERT_TRUE(state) << state.error().message;
  EXPECT_EQ(*state, x);
}

TEST_F(AssembleState, IgnoresObjectsItDoesNotKnow) {
  auto readings = objects.read();
  readings->push_back({.name = "stranger"});
  const auto state = assemble_state(geometry.layout, *robot.read(), *readings);
  ASSERT_TRUE(state);
  EXPECT_EQ(*state, x);
}

TEST_F(AssembleState, NamesTheMissingObject) {
  objects.hidden = "can";
  const auto state = assemble_state(geometry.layout, *robot.read(), *objects.read());
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().code, Code::kInvalidArgument);
  EXPECT_THAT(state.error().message, testing::AllOf(HasSubstr("'can'"), HasSubstr("wanted all 3")));
}

TEST_F(AssembleState, RefusesARobotOfOtherJoints) {
  auto reading = robot.read();
  reading->q.pop_back();
  const auto state = assemble_state(geometry.layout, *reading, *objects.read());
  ASSERT_FALSE(state);
  EXPECT_THAT(state.error().message, testing::AllOf(HasSubstr("got 4 positions"), HasSubstr("wanted 5 joints")));
}

}  // namespace
}  // namespace jostle::planners
