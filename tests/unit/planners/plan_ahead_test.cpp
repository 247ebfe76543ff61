#include "planners/execution/plan_ahead.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <future>
#include <thread>

#include "planners/adaptive/adaptive.hpp"
#include "planners/control/controller.hpp"
#include "planners/mpc/mpc.hpp"
#include "tests/support/kinematic_world.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;
using physics_pool::TaskGeometry;
using ::testing::Each;
using ::testing::ElementsAre;

constexpr std::chrono::seconds kPatience{60};

Problem problem_of(const State& x) {
  Problem problem;
  problem.x0 = x;
  return problem;
}

PlanAhead::Steps steps_to(double x1) {
  return {.predict = [x1](std::stop_token) -> Result<State> { return State{.q = {x1}, .v = {}}; },
          .ask = [](const State& x) -> Result<std::optional<Problem>> { return std::optional(problem_of(x)); },
          .plan = [](const Problem& problem, std::stop_token) -> Result<Plan> {
            *problem.rollouts_asked_for += 7;
            Plan plan;
            plan.cost = 10 * problem.x0.q.at(0);
            return plan;
          }};
}

TEST(PlanAhead, PlansFromWhatIsPredicted) {
  PlanAhead sut(steps_to(2.0), {});
  sut.wait_until_asked();
  EXPECT_THAT(sut.predicted()->q, ElementsAre(2.0));
  EXPECT_EQ(sut.take().value().cost, 20.0);
  EXPECT_EQ(sut.rollouts(), 7u);
}

TEST(PlanAhead, PlansNothingWhereNothingIsAskedForOrPredicted) {
  PlanAhead::Steps steps = steps_to(2.0);
  steps.ask = [](const State&) -> Result<std::optional<Problem>> { return std::optional<Problem>(); };
  PlanAhead not_asked(steps, {});
  not_asked.wait_until_asked();
  EXPECT_FALSE(not_asked.problem());
  EXPECT_FALSE(not_asked.take());
  steps.predict = [](std::stop_token) -> Result<State> { return Error{Code::kInvalidArgument, "diverged"}; };
  PlanAhead not_predicted(steps, {});
  not_predicted.wait_until_asked();
  EXPECT_FALSE(not_predicted.predicted());
  EXPECT_FALSE(not_predicted.problem());
}

// A plan that ends when it is told to, and not before.
PlanAhead::Steps endless(std::promise<void>& begun) {
  PlanAhead::Steps steps = steps_to(1.0);
  steps.plan = [&begun](const Problem& problem, std::stop_token stop) -> Result<Plan> {
    *problem.rollouts_asked_for += 3;
    std::promise<void> stopped;
    const std::stop_callback tell(stop, [&] { stopped.set_value(); });
    begun.set_value();
    stopped.get_future().wait();
    return Error{Code::kCancelled, "told to stop"};
  };
  return steps;
}

TEST(PlanAhead, IsGivenUpInTheMiddle) {
  std::promise<void> begun;
  PlanAhead sut(endless(begun), {});
  begun.get_future().wait();
  sut.give_up();
  EXPECT_EQ(sut.rollouts(), 3u);
}

TEST(PlanAhead, EndsWithItsRun) {
  std::promise<void> begun;
  std::stop_source stop;
  PlanAhead sut(endless(begun), stop.get_token());
  begun.get_future().wait();
  stop.request_stop();
  EXPECT_EQ(sut.take().error().code, Code::kCancelled);
}

// A controller in a world that does as it is told.
struct Subject {
  const char* name;
  physics_pool::Scene scene;
  int joints, axes;
  std::function<Result<Outcome>(const ControlSetup&, const OnEvent&, std::stop_token)> run;
  double rest = 0.0;  // s
  double pace = 1.0;  // of a plan's first action
};

std::ostream& operator<<(std::ostream& out, const Subject& subject) { return out << subject.name; }

struct TakenUp {
  Problem problem;
  PlanOrigin origin;
};

// Fails, if asked to, on every thread but its own.
class Front final : public Planner {
 public:
  explicit Front(Planner& planner) : planner_(planner) {}

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop) override {
    if (!error_ahead || std::this_thread::get_id() == own_) return planner_.plan(problem, deadline, std::move(stop));
    *problem.rollouts_asked_for += 5;
    return *error_ahead;
  }

  std::optional<Error> error_ahead;

 private:
  Planner& planner_;
  const std::thread::id own_ = std::this_thread::get_id();
};

struct Ride {
  explicit Ride(const Subject& its_subject) : subject(its_subject) {
    // Every plan is another, and none is good enough to be kept.
    planner.predicts_goal = false;
    planner.change = [this](Plan& plan, int) {
      if (plan.controls.steps() == 0) {  // of a planner that makes its own
        plan.controls = {.nu = subject.axes};
        std::vector<double> u(static_cast<std::size_t>(subject.axes), 0.0);
        u[kControlX] = 0.01;
        for (int t = 0; t < 3; ++t) plan.controls.append(u);
        for (int t = 0; t < 3; ++t) plan.states.push_back(moved(plan.states.back(), u, 1.0));
      }
      plan.controls.step(0)[kControlX] *= subject.pace;
      plan.controls.step(0)[kControlY] = 0.0005 * (1.0 + planner.problems.back().stream % 7);
    };
    setup.predict = [this](const ActionAhead& action, TimePoint, std::stop_token) -> Result<State> {
      rest = action.rest;
      return moved(action.x, action.u.step(0), action.duration);
    };
    setup.on_plan = [this](const Problem& problem, const Plan&, const PlanOrigin& origin) {
      EXPECT_EQ(std::this_thread::get_id(), thread);
      plans.push_back({.problem = problem, .origin = origin});
    };
  }

  Outcome outcome() {
    auto result = subject.run(setup, {}, {});
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  std::vector<bool> taken() const {
    std::vector<bool> result;
    for (const TakenUp& plan : plans) result.push_back(plan.origin.while_acting);
    return result;
  }

  const Subject& subject;
  const TaskGeometry geometry{subject.scene};
  State x = initial_state(subject.scene);
  KinematicRobot robot{x, subject.joints, subject.axes};
  KinematicObjects objects{geometry.layout, x};
  KinematicPlanner planner;
  Front front{planner};
  ControlSetup setup{.planner = front,
                     .robot = robot,
                     .objects = objects,
                     .geometry = geometry,
                     .objective = physics_pool::Objective::standard(),
                     .world = hash_of("world"),
                     .seed = 11,
                     .make_feasible = {}};
  const std::thread::id thread = std::this_thread::get_id();
  std::vector<TakenUp> plans;
  double rest = -1.0;
};

class ActingController : public testing::TestWithParam<Subject> {
 protected:
  static void expect_same_decisions(const Ride& a, const Ride& b) {
    EXPECT_EQ(a.robot.executed, b.robot.executed);
    ASSERT_EQ(a.plans.size(), b.plans.size());
    for (std::size_t i = 0; i < a.plans.size(); ++i) {
      const Problem &p = a.plans[i].problem, &q = b.plans[i].problem;
      EXPECT_EQ(p.x0, q.x0) << i;
      EXPECT_EQ(p.initial, q.initial) << i;
      EXPECT_EQ(p.u_before, q.u_before) << i;
      EXPECT_EQ(p.iterations, q.iterations) << i;
      EXPECT_EQ(p.stream, q.stream) << i;
      EXPECT_EQ(p.objective, q.objective) << i;
    }
  }

  Ride waits{GetParam()}, foresees{GetParam()};
};

TEST_P(ActingController, DecidesTheSameWhereTheWorldIsAsPredicted) {
  foresees.setup.plan_while_acting = 1e-9;
  const Outcome before = waits.outcome(), after = foresees.outcome();
  ASSERT_GE(before.actions, 3);
  expect_same_decisions(waits, foresees);
  EXPECT_THAT(waits.taken(), Each(false));
  EXPECT_GE(after.taken_ahead, before.replans);  // OR and NR plan once before they close the hand
  EXPECT_EQ(after.taken_ahead, after.plans_ahead);
  EXPECT_EQ(after.abandoned_rollouts, 0u);
  EXPECT_EQ(after.replans, before.replans);
  EXPECT_EQ(after.rollouts, before.rollouts + std::uint64_t(after.actions));  // one for each prediction
  EXPECT_EQ(foresees.rest, GetParam().rest);
}

TEST_P(ActingController, DecidesTheSameWhereNoPlanIsTaken) {
  for (Ride* ride : {&waits, &foresees}) {
    ride->robot.after_execute = [](State& state, int) { state.q[kJointY] += 0.0005; };
  }
  foresees.setup.plan_while_acting = 1e-9;
  const Outcome before = waits.outcome(), after = foresees.outcome();
  ASSERT_GE(before.actions, 3);
  expect_same_decisions(waits, foresees);
  EXPECT_EQ(after.taken_ahead, 0);
  EXPECT_GE(after.plans_ahead, before.replans);
  EXPECT_THAT(foresees.taken(), Each(false));
  for (std::size_t i = 1; i < foresees.plans.size(); ++i) EXPECT_GE(*foresees.plans[i].origin.deviation, 0.0005);
}

TEST_P(ActingController, ActsOnAPlanForAStateNearBy) {
  foresees.robot.after_execute = [](State& state, int) { state.q[kJointY] += 0.0005; };
  foresees.setup.plan_while_acting = 0.01;
  const Outcome outcome = foresees.outcome();
  ASSERT_GE(outcome.taken_ahead, 2);
  EXPECT_FALSE(foresees.plans[0].origin.deviation);
  for (std::size_t i = 1; i < foresees.plans.size(); ++i) {
    const PlanOrigin& origin = foresees.plans[i].origin;
    EXPECT_TRUE(origin.while_acting);
    // Predictions begin with what was observed: deviations do not add up.
    EXPECT_NEAR(*origin.deviation, GetParam().rest > 0 ? 0.001 : 0.0005, 1e-12);
  }
}

TEST_P(ActingController, PlansWhileTheActionIsAtWork) {
  std::promise<void> planned;
  auto change = foresees.planner.change;
  foresees.planner.change = [&](Plan& plan, int plans) {
    change(plan, plans);
    if (plans == 2) planned.set_value();
  };
  foresees.robot.after_execute = [&](State&, int executed) {
    if (executed > 1) return;
    EXPECT_EQ(planned.get_future().wait_for(kPatience), std::future_status::ready);
  };
  foresees.setup.plan_while_acting = 1e-9;
  EXPECT_GE(foresees.outcome().taken_ahead, 1);
}

TEST_P(ActingController, MakesAPlanAnewThatCameToNothing) {
  foresees.setup.plan_while_acting = 1e-9;
  foresees.front.error_ahead = Error{Code::kInvalidArgument, "told to diverge"};
  const Outcome before = waits.outcome(), after = foresees.outcome();
  expect_same_decisions(waits, foresees);
  EXPECT_GE(after.plans_ahead, before.replans);
  EXPECT_EQ(after.taken_ahead, 0);
  EXPECT_EQ(after.abandoned_rollouts, 5u * std::uint64_t(after.plans_ahead));
}

TEST_P(ActingController, PlansNothingAheadWithoutBeingAskedTo) {
  waits.setup.plan_while_acting = 0.0;
  const Outcome outcome = waits.outcome();
  EXPECT_EQ(outcome.plans_ahead, 0);
  EXPECT_EQ(waits.rest, -1.0);
  for (const TakenUp& plan : waits.plans) EXPECT_FALSE(plan.origin.deviation);
}

TEST_P(ActingController, SaysHowLongTheRobotStood) {
  const Outcome outcome = waits.outcome();
  EXPECT_EQ(outcome.idle.size(), static_cast<std::size_t>(outcome.actions));
  EXPECT_THAT(outcome.idle, Each(testing::Ge(0.0)));
  EXPECT_EQ(idle_between(outcome).size(), outcome.idle.size() - 1);
}

std::vector<Subject> subjects() {
  const auto grasp = [](ControlOptions::Method method) {
    return [method](const ControlSetup& setup, const OnEvent& on_event, std::stop_token stop) {
      ControlOptions options;
      options.method = method;
      options.close_hand = false;
      options.initial_steps = method == ControlOptions::Method::kNaive ? 1 : 6;
      options.deviation_threshold = 0.0;
      return run_controller(setup, options, on_event, std::move(stop));
    };
  };
  return {{.name = "mpc",
           .scene = push_around(),
           .joints = 2,
           .axes = kPusherControls,
           .run =
               [](const ControlSetup& setup, const OnEvent& on_event, std::stop_token stop) {
                 MpcOptions options;
                 options.max_actions = 6;
                 options.straight_speed = 0.02;
                 return run_mpc(setup, options, on_event, std::move(stop));
               }},
          {.name = "tampc",
           .scene = push_ahead(),
           .joints = 2,
           .axes = kPusherControls,
           .run =
               [](const ControlSetup& setup, const OnEvent& on_event, std::stop_token stop) {
                 AdaptiveOptions options;
                 options.rest = 0.25;
                 options.max_actions = 5;
                 return run_adaptive(setup, options, on_event, std::move(stop));
               },
           .rest = 0.25},
          {.name = "or",
           .scene = three_objects(),
           .joints = 5,
           .axes = kGripperControls,
           .run = grasp(ControlOptions::Method::kOnline)},
          {.name = "nr",
           .scene = three_objects(),
           .joints = 5,
           .axes = kGripperControls,
           .run = grasp(ControlOptions::Method::kNaive),
           .pace = 0.3}};
}

INSTANTIATE_TEST_SUITE_P(PlanAhead, ActingController, testing::ValuesIn(subjects()),
                         [](const auto& subject) { return std::string(subject.param.name); });

}  // namespace
}  // namespace jostle::planners
