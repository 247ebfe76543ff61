#include "planners/robustness/robust_control.hpp"

#include <gmock/gmock.h>

#include "tests/support/kinematic_world.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;
using namespace physics_pool;
using ::testing::HasSubstr;
using ::testing::SizeIs;

// A world in which everything happens as planned unless a test steps in; plans are straight lines to the target.
class RobustRun : public testing::Test {
 protected:
  RobustRun() {
    planner.change = [this](Plan& plan, int plans) {
      if (plans == 1 && !segments.empty()) plan.robustness = Robustness{.segments = segments};
    };
    objective["state"].weight = objective["pads"].weight = 1e4;
    setup.objective = objective;
  }

  Outcome run(const RobustControlOptions& method) {
    auto result = run_robust(setup, method);
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  double* object(std::size_t i) { return &x.q[static_cast<std::size_t>(geometry.layout.objects[i].q)]; }

  std::vector<double> wanted_state(std::size_t plan) const {
    return planner.problems[plan].objective.find("state")->values;
  }

  const Scene scene = three_objects();
  const TaskGeometry geometry{scene};
  State x = initial_state(scene);
  KinematicRobot robot{x};
  KinematicObjects objects{geometry.layout, x};
  KinematicPlanner planner;
  Objective objective = Objective::standard();
  ControlSetup setup{.planner = planner,
                     .robot = robot,
                     .objects = objects,
                     .geometry = geometry,
                     .objective = objective,
                     .world = hash_of("world"),
                     .seed = 11,
                     .make_feasible = {}};
  RobustControlOptions options;
  std::vector<Segment> segments;
};

TEST_F(RobustRun, OpenLoopExecutesItsPlanWithoutLooking) {
  robot.after_execute = [this](State&, int actions) {
    if (actions == 2) object(2)[1] += 0.05;  // nobody minds
  };
  for (const auto method : {open_loop, robust_open_loop, convergent}) {
    x = initial_state(scene);
    planner.problems.clear();
    const Outcome got = run(method(options));
    EXPECT_TRUE(got.success) << got.reason;
    EXPECT_EQ(got.actions, 5);
    EXPECT_EQ(got.open_loop_actions, 5);
    EXPECT_THAT(planner.problems, SizeIs(1));
  }
}

TEST_F(RobustRun, OpenLoopFailsWhereTheTargetHasGone) {
  robot.after_execute = [this](State&, int actions) {
    if (actions == 2) object(0)[1] += 0.1;
  };
  const Outcome got = run(open_loop(options));
  EXPECT_EQ(got.ending, Ending::kFailed);
  EXPECT_THAT(got.reason, HasSubstr("not reached after 5 actions"));
}

// Rows 1 and 2 of Fig. 4.7.
TEST_F(RobustRun, FailsWithAnotherObjectInTheHand) {
  robot.after_execute = [this](State&, int actions) {
    if (actions != 5) return;
    object(2)[0] = object(0)[0] - 0.01;
    object(2)[1] = object(0)[1];
  };
  const Outcome got = run(open_loop(options));
  EXPECT_EQ(got.ending, Ending::kFailed);
  EXPECT_THAT(got.reason, HasSubstr("1 other object in the hand"));
}

TEST_F(RobustRun, FailsWhereSomethingFalls) {
  robot.after_execute = [this](State&, int actions) {
    if (actions == 3) object(1)[2] -= 0.5;
  };
  segments = {{.from = 0, .to = 2, .is_robust = true}, {.from = 2, .to = 5}};
  const Outcome got = run(interleaved(options));
  EXPECT_THAT(got.reason, HasSubstr("dropped can"));
  EXPECT_EQ(got.actions, 3);
}

TEST_F(RobustRun, ClosedLoopPlansAgainAfterEveryAction) {
  const Outcome got = run(closed_loop(options));
  EXPECT_TRUE(got.success) << got.reason;
  EXPECT_EQ(got.open_loop_actions, 0);
  EXPECT_EQ(planner.problems.size(), static_cast<std::size_t>(got.actions));
  for (const Problem& problem : planner.problems) {
    EXPECT_FALSE(problem.weigh_robustness);
    EXPECT_EQ(problem.initial.steps(), options.horizon);  // it recedes
    EXPECT_EQ(problem.objective.weight("pads"), 1e4);
  }
  EXPECT_EQ(planner.problems.front().iterations, options.iterations);
  EXPECT_EQ(planner.problems.back().iterations, options.mpc_iterations);
}

TEST_F(RobustRun, ClosedLoopGivesUpAfterItsActions) {
  robot.after_execute = [this](State&, int) { object(0)[0] += 0.08; };  // it runs away
  options.max_actions = 7;
  const Outcome got = run(closed_loop(options));
  EXPECT_EQ(got.actions, 7);
  EXPECT_EQ(got.ending, Ending::kFailed);
}

TEST_F(RobustRun, InterleavedLooksWhereThePlanIsNotRobustOnly) {
  segments = {{.from = 0, .to = 2, .is_robust = true}, {.from = 2, .to = 4}, {.from = 4, .to = 5, .is_robust = true}};
  const Outcome got = run(interleaved(options));
  EXPECT_TRUE(got.success) << got.reason;
  EXPECT_EQ(got.actions, 5);
  EXPECT_EQ(got.open_loop_actions, 3);
  EXPECT_EQ(got.mismatches, 0);
  EXPECT_EQ(got.segments, segments);
  ASSERT_THAT(planner.problems, SizeIs(3));  // the robust one, and one for each action of the second segment
  EXPECT_TRUE(planner.problems[0].weigh_robustness);
  for (const std::size_t plan : {1u, 2u}) {
    EXPECT_FALSE(planner.problems[plan].weigh_robustness);
    EXPECT_EQ(wanted_state(plan), got.first_plan.states[4].q);  // Eq. 4.41
    EXPECT_EQ(planner.problems[plan].objective.weight("pads"), 0.0);
  }
  EXPECT_EQ(planner.problems[1].initial.steps(), 2);  // the segment's own controls
  EXPECT_EQ(planner.problems[2].initial.steps(), 1);  // and what is left of them
  EXPECT_THAT(wanted_state(0), SizeIs(0));
}

TEST_F(RobustRun, InterleavedDoesNotTrustARobustSegmentThatBeginsElsewhere) {
  segments = {{.from = 0, .to = 3, .is_robust = true}, {.from = 3, .to = 5, .is_robust = true}};
  robot.after_execute = [this](State&, int actions) {
    if (actions == 3) object(2)[1] += 0.05;
  };
  const Outcome got = run(interleaved(options));
  EXPECT_TRUE(got.success) << got.reason;
  EXPECT_EQ(got.mismatches, 1);
  EXPECT_EQ(got.open_loop_actions, 3);
  EXPECT_GT(planner.problems.size(), 1u);
}

TEST_F(RobustRun, InterleavedEndsASegmentThatDoesNotComeToItsEnd) {
  segments = {{.from = 0, .to = 2}, {.from = 2, .to = 5, .is_robust = true}};
  robot.after_execute = [this](State&, int) { object(2)[1] += 0.05; };  // never again where the plan has it
  options.max_actions = 3;
  const Outcome got = run(interleaved(options));
  // Twice the two actions of the first segment; the second begins elsewhere, and is the last.
  EXPECT_EQ(got.mismatches, 1);
  EXPECT_EQ(got.open_loop_actions, 0);
  EXPECT_LE(got.actions, 2 * 2 + 3);
  EXPECT_GE(got.actions, 2 * 2);
}

TEST_F(RobustRun, InterleavedIsClosedLoopWhereNobodyLookedForRobustness) {
  const Outcome got = run(interleaved(options));  // the planner says nothing of it
  EXPECT_TRUE(got.success) << got.reason;
  EXPECT_THAT(got.segments, SizeIs(1));
  EXPECT_EQ(got.open_loop_actions, 0);
}

TEST_F(RobustRun, PlansAreNotExecutedWhereOnlyPlansAreWanted) {
  options.plan_only = true;
  for (const auto method : {open_loop, robust_open_loop, convergent, closed_loop, interleaved}) {
    planner.problems.clear();
    const Outcome got = run(method(options));
    EXPECT_THAT(got.reason, HasSubstr("not executed"));
    EXPECT_THAT(planner.problems, SizeIs(1));
    EXPECT_EQ(got.actions, 0);
  }
}

TEST(RobustMethods, DifferInWhatTheyPlanWith) {
  const RobustControlOptions options;
  EXPECT_EQ(open_loop(options).planner.starts, 0);
  EXPECT_EQ(closed_loop(options).planner.starts, 0);
  EXPECT_EQ(convergent(options).planner.worlds, 0);
  EXPECT_EQ(convergent(options).planner.starts, 4);
  EXPECT_EQ(robust_open_loop(options).planner, options.planner);
  EXPECT_EQ(interleaved(options).planner, options.planner);
}

TEST(SegmentText, ShowsWhatIsUnderWay) {
  const std::vector<Segment> segments{{.from = 0, .to = 2, .is_robust = true}, {.from = 2, .to = 5}};
  EXPECT_EQ(to_text(segments, 1), "open 0-2, [closed 2-5]");
  EXPECT_EQ(to_text(segments, -1), "open 0-2, closed 2-5");
  EXPECT_EQ(to_text({}, 0), "");
}

}  // namespace
}  // namespace jostle::planners
