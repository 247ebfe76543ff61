// What every Robot promises, asked of every implementation.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <future>
#include <latch>

#include "robot_bridge/safety/command_check.hpp"
#include "tests/support/arm_rig.hpp"
#include "tests/support/world_rigs.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using robot_bridge::RobotReading;
using ::testing::HasSubstr;

constexpr auto kPatience = 60s;  // for what should take well under a second
constexpr double kLag = 0.25;    // of the way: motors take their time to reach a velocity
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

class RobotContract : public ::testing::TestWithParam<WorldCase> {
 protected:
  RobotReading read() {
    auto reading_result = sut.read();
    if (!reading_result) throw std::runtime_error(reading_result.error().message);
    return std::move(reading_result).value();
  }

  std::vector<double> still() const { return std::vector<double>(axes, 0.0); }

  // That the robot stands where it stood.
  void expect_same_place(const RobotReading& now, const RobotReading& before) const {
    ASSERT_EQ(now.q.size(), before.q.size());
    for (std::size_t i = 0; i < now.q.size(); ++i) {
      EXPECT_NEAR(now.q[i], before.q[i], rig->play()) << rig->layout.joints[i];
    }
  }
  // That no time went by, where it goes by in actions only.
  void expect_same_time(double now, double before) const {
    EXPECT_GE(now, before);
    if (!rig->time_goes_on()) EXPECT_LE(now, before);
  }
  // That an action of a duration took its time.
  void expect_passed(double passed, double duration) const {
    const bool exact = !rig->time_goes_on();
    EXPECT_GT(passed, duration - (exact ? 1e-6 : 0.05));  // a sample may come late, and the next one in time
    EXPECT_LT(passed, exact ? duration + 1e-6 : 30.0);
  }

  // Away from everything else, sideways.
  std::vector<double> away() const {
    std::vector<double> u = still();
    u[kControlX] = -0.05;
    u[kControlY] = 0.02;
    if (scene.robot.model.hand) u[kControlRotation] = 0.1;
    return u;
  }

  const std::unique_ptr<WorldRig> rig = GetParam().make();
  const physics_pool::Scene& scene = rig->scene;
  robot_bridge::Robot& sut = rig->robot();
  const std::size_t joints = rig->layout.joints.size();
  const std::size_t axes = static_cast<std::size_t>(rig->layout.nu);
};

TEST_P(RobotContract, ReadingHasTheScenesJointsAndFiniteNumbers) {
  for (int action = 0; action < 3; ++action) {
    const RobotReading reading = read();

    ASSERT_EQ(reading.q.size(), joints);
    ASSERT_EQ(reading.v.size(), joints);
    for (std::size_t i = 0; i < joints; ++i) {
      EXPECT_TRUE(std::isfinite(reading.q[i])) << "q of " << rig->layout.joints[i];
      EXPECT_TRUE(std::isfinite(reading.v[i])) << "v of " << rig->layout.joints[i];
    }
    ASSERT_TRUE(rig->act(away(), 0.2));
  }
}

TEST_P(RobotContract, FirstReadingIsTheScenesStart) {
  const State start = physics_pool::initial_state(scene);
  const RobotReading reading = read();
  for (std::size_t i = 0; i < joints; ++i)
    EXPECT_NEAR(reading.q[i], start.q[i], 1e-9 + rig->play()) << rig->layout.joints[i];
}

TEST_P(RobotContract, ReadingMovesNothing) {
  ASSERT_TRUE(rig->act(away(), 0.2));
  const RobotReading first = read();
  const double time = rig->time();

  const RobotReading second = read();

  expect_same_place(second, first);
  if (!rig->time_goes_on()) {
    EXPECT_EQ(second.v, first.v);
  }
  EXPECT_EQ(second.object_in_hand, first.object_in_hand);
  expect_same_time(rig->time(), time);
}

// Robots whose truth a test knows.
class KnownRobotContract : public RobotContract {};

TEST_P(KnownRobotContract, ReadingIsNoOlderThanTheLastAction) {
  for (int action = 0; action < 4; ++action) {
    ASSERT_TRUE(rig->act(away(), 0.2));

    const RobotReading reading = read();

    const State truth = rig->truth();
    for (std::size_t i = 0; i < joints; ++i) {
      EXPECT_NEAR(reading.q[i], truth.q[i], 1e-9) << rig->layout.joints[i] << " after action " << action;
      EXPECT_NEAR(reading.v[i], truth.v[i], 1e-9) << rig->layout.joints[i] << " after action " << action;
    }
  }
}

TEST_P(RobotContract, ActionReturnsWhenItsTimeIsOver) {
  (void)read();
  for (int action = 0; action < 4; ++action) {
    const double before = rig->time();

    ASSERT_TRUE(rig->act(away(), 0.2));

    (void)read();
    expect_passed(rig->time() - before, 0.2);
  }
}

TEST_P(RobotContract, BadCommandIsRefusedByFieldAndMovesNothing) {
  const std::string all = fmt::format("wanted {}", axes);
  const auto with = [&](std::size_t axis, double value) {
    std::vector<double> u = still();
    u[axis] = value;
    return u;
  };
  struct Case {
    std::string got, wanted;
    std::vector<double> u;
    double duration;
  };
  const std::vector<double> limits = rig->limits();
  const double too_fast = std::nextafter(limits[1], kInf);
  const auto within = [&](std::size_t axis) { return fmt::format("wanted -{0} to {0}", limits[axis]); };
  const std::vector<Case> cases{
      {"velocities: got 0 values", all, {}, 0.2},
      {fmt::format("velocities: got {} values", axes - 1), all, std::vector<double>(axes - 1, 0.0), 0.2},
      {fmt::format("velocities: got {} values", axes + 1), all, std::vector<double>(axes + 1, 0.0), 0.2},
      {"velocities: got 1000 values", "wanted", std::vector<double>(1000, 0.0), 0.2},
      {"velocities[0]: got nan", within(0), with(0, kNaN), 0.2},
      {"velocities[1]: got inf", within(1), with(1, kInf), 0.2},
      {"velocities[0]: got -inf", within(0), with(0, -kInf), 0.2},
      {fmt::format("velocities[1]: got {}", too_fast), within(1), with(1, too_fast), 0.2},
      {"velocities[0]: got -1e+300", within(0), with(0, -1e300), 0.2},
      {"duration: got 0 s", "wanted more than 0", away(), 0.0},
      {"duration: got -0.2 s", "wanted more than 0", away(), -0.2},
      {"duration: got nan s", "wanted more than 0", away(), kNaN},
      {"duration: got inf s", "wanted more than 0", away(), kInf},
      {"duration: got 61 s", "at most 60 s", away(), 61.0},
  };
  const RobotReading before = read();
  const double time = rig->time();
  for (const Case& bad : cases) {
    SCOPED_TRACE(bad.got);

    const auto ok = sut.execute(bad.u, bad.duration);

    ASSERT_FALSE(ok);
    EXPECT_EQ(ok.error().code, Code::kInvalidArgument);
    EXPECT_THAT(ok.error().message, HasSubstr(bad.got));
    EXPECT_THAT(ok.error().message, HasSubstr(bad.wanted));
    expect_same_place(read(), before);
    expect_same_time(rig->time(), time);
  }
}

TEST_P(RobotContract, GoodCommandAfterABadOneIsObeyed) {
  for (int i = 0; i < 3; ++i) {
    (void)read();
    const double before = rig->time();
    ASSERT_FALSE(sut.execute(std::vector<double>(axes + 1, 0.0), 0.2));

    const auto ok = rig->act(away(), 0.2);

    ASSERT_TRUE(ok) << ok.error().message;
    (void)read();
    expect_passed(rig->time() - before, 0.2);
  }
}

TEST_P(RobotContract, StartedActionIsOverWhenItsTimeIs) {
  const double before = read().stamp;
  EXPECT_TRUE(sut.advance().value());  // none is at work

  ASSERT_TRUE(sut.start(away(), 0.2));
  const auto during = sut.read();
  ASSERT_TRUE(during) << during.error().message;
  const auto ok = sut.wait();

  ASSERT_TRUE(ok) << ok.error().message;
  const double after = read().stamp;
  EXPECT_GE(during->stamp, before);
  EXPECT_LE(during->stamp, after);
  expect_passed(after - before, 0.2);
  EXPECT_TRUE(sut.advance().value());
}

TEST_P(RobotContract, SecondActionIsRefusedWhileOneIsAtWork) {
  const double before = read().stamp;
  ASSERT_TRUE(sut.start(away(), 0.2));

  const auto second = sut.start(still(), 0.2);

  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Code::kInvalidArgument);
  EXPECT_THAT(second.error().message, HasSubstr("at work already"));
  EXPECT_TRUE(sut.wait());
  expect_passed(read().stamp - before, 0.2);
}

TEST_P(RobotContract, StampIsTheTimeOfTheReading) {
  for (int action = 0; action < 3; ++action) {
    const RobotReading reading = read();
    EXPECT_NEAR(reading.stamp, rig->time(), rig->time_goes_on() ? 10.0 : 1e-6);
    ASSERT_TRUE(rig->act(away(), 0.2));
  }
}

TEST_P(RobotContract, ReadingIsCancelledByAStopRequest) {
  std::stop_source stop;
  stop.request_stop();

  const auto reading_result = sut.read(stop.get_token());

  ASSERT_FALSE(reading_result);
  EXPECT_EQ(reading_result.error().code, Code::kCancelled);
}

TEST_P(RobotContract, StopRequestEndsAStartedAction) {
  (void)read();
  ASSERT_TRUE(sut.start(away(), 0.2));
  std::stop_source stop;
  stop.request_stop();

  const auto over = sut.advance(stop.get_token());

  ASSERT_FALSE(over);
  EXPECT_EQ(over.error().code, Code::kCancelled);
  EXPECT_TRUE(sut.advance().value());  // none is at work
  const RobotReading stopped = read();
  expect_same_place(read(), stopped);
}

TEST_P(RobotContract, StopRequestedBeforehandMovesNothing) {
  const RobotReading before = read();
  const double time = rig->time();
  std::stop_source stop;
  stop.request_stop();

  const auto ok = sut.execute(away(), 0.2, stop.get_token());

  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kCancelled);
  expect_same_place(read(), before);
  expect_same_time(rig->time(), time);
  EXPECT_TRUE(rig->act(away(), 0.2));
}

// Robots that do what they are told, not what they once did.
class ObedientRobotContract : public RobotContract {};

TEST_P(ObedientRobotContract, MovesByVelocityTimesDuration) {
  const RobotReading before = read();

  ASSERT_TRUE(sut.execute(away(), 0.4));

  const RobotReading after = read();
  const std::size_t moving = scene.robot.model.hand ? 3 : 2;  // x, y, and a gripper's rotation
  for (std::size_t i = 0; i < moving; ++i) {
    const double wanted = away()[i] * 0.4;
    EXPECT_NEAR(after.q[i] - before.q[i], wanted, kLag * std::abs(wanted)) << rig->layout.joints[i];
  }
  for (std::size_t i = moving; i < joints; ++i) {
    EXPECT_NEAR(after.q[i], before.q[i], 1e-3 + rig->play()) << rig->layout.joints[i];
  }
}

TEST_P(ObedientRobotContract, ZeroCommandKeepsThePose) {
  const RobotReading before = read();

  ASSERT_TRUE(sut.execute(still(), 1.0));

  const RobotReading after = read();
  for (std::size_t i = 0; i < joints; ++i)
    EXPECT_NEAR(after.q[i], before.q[i], 1e-4 + rig->play()) << rig->layout.joints[i];
}

TEST_P(ObedientRobotContract, ZeroCommandBrakes) {
  ASSERT_TRUE(sut.execute(away(), 0.4));
  ASSERT_TRUE(sut.execute(still(), 1.0));
  const RobotReading before = read();

  ASSERT_TRUE(sut.execute(still(), 1.0));

  const RobotReading after = read();
  for (std::size_t i = 0; i < joints; ++i)
    EXPECT_NEAR(after.q[i], before.q[i], 1e-4 + rig->play()) << rig->layout.joints[i];
}

class GripperContract : public RobotContract {};

TEST_P(GripperContract, OpeningGrowsByVelocityTimesDuration) {
  const RobotReading before = read();
  std::vector<double> u = still();
  u[kControlOpening] = -0.02;

  ASSERT_TRUE(sut.execute(u, 0.5));

  const RobotReading after = read();
  const auto opening = [](const RobotReading& reading) { return reading.q[kJointLeft] + reading.q[kJointRight]; };
  EXPECT_NEAR(opening(after) - opening(before), -0.01, kLag * 0.01);
}

// Robots whose actions take time.
class InterruptibleRobotContract : public RobotContract {
 protected:
  // Ends an action of a minute soon after its begin, if all is well.
  Result<void> interrupted_action() {
    std::vector<double> u = still();
    u[kControlX] = -0.002;  // 12 cm in a minute
    std::stop_source stop;
    std::latch begins(2);
    auto action = std::async(std::launch::async, [&] {
      begins.arrive_and_wait();
      return sut.execute(u, robot_bridge::kLongestAction, stop.get_token());
    });
    begins.arrive_and_wait();
    rig->wait_until_busy();
    stop.request_stop();
    EXPECT_EQ(action.wait_for(kPatience), std::future_status::ready);
    return action.get();
  }
};

TEST_P(InterruptibleRobotContract, StopRequestEndsAnActionEarlyAndTheRobotStandsStill) {
  (void)read();
  const double before = rig->time();

  const auto ok = interrupted_action();

  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kCancelled);
  const RobotReading stopped = read();
  const double time = rig->time();
  EXPECT_LT(time - before, robot_bridge::kLongestAction / 2);
  expect_same_place(read(), stopped);
  expect_same_time(rig->time(), time);
}

// Of those the ones that an action can be asked of again at once.
class ResumableRobotContract : public InterruptibleRobotContract {};

TEST_P(ResumableRobotContract, ObeysAgainAfterAStop) {
  for (int i = 0; i < 2; ++i) {
    ASSERT_FALSE(interrupted_action());
    (void)read();
    const double before = rig->time();

    const auto ok = sut.execute(still(), 0.2);

    ASSERT_TRUE(ok) << ok.error().message;
    (void)read();
    expect_passed(rig->time() - before, 0.2);
  }
}

INSTANTIATE_TEST_SUITE_P(InProcess, RobotContract, in_both_scenes<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(InProcess, KnownRobotContract, in_both_scenes<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(InProcess, ObedientRobotContract, in_both_scenes<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(InProcess, GripperContract, with_gripper<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(InProcess, InterruptibleRobotContract, in_both_scenes<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(InProcess, ResumableRobotContract, in_both_scenes<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Guarded, RobotContract, in_both_scenes<GuardedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Guarded, KnownRobotContract, in_both_scenes<GuardedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Guarded, ObedientRobotContract, in_both_scenes<GuardedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Guarded, GripperContract, with_gripper<GuardedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Guarded, InterruptibleRobotContract, in_both_scenes<GuardedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Guarded, ResumableRobotContract, in_both_scenes<GuardedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, RobotContract, in_both_scenes<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, KnownRobotContract, in_both_scenes<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, ObedientRobotContract, in_both_scenes<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, GripperContract, with_gripper<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, InterruptibleRobotContract, in_both_scenes<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, ResumableRobotContract, in_both_scenes<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Recorded, RobotContract, in_both_scenes<RecordedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Recorded, KnownRobotContract, in_both_scenes<RecordedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Recorded, InterruptibleRobotContract, in_both_scenes<SlowlyRecordedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Arm, RobotContract, with_gripper<ArmRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Arm, ObedientRobotContract, with_gripper<ArmRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Arm, GripperContract, with_gripper<ArmRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Arm, InterruptibleRobotContract, with_gripper<ArmRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Arm, ResumableRobotContract, with_gripper<ArmRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Kinematic, RobotContract, in_both_scenes<KinematicRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Kinematic, KnownRobotContract, in_both_scenes<KinematicRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Kinematic, ObedientRobotContract, in_both_scenes<KinematicRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Kinematic, GripperContract, with_gripper<KinematicRig>(), scene_name);

}  // namespace
}  // namespace jostle::tests
