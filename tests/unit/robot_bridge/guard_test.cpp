// A guard around a robot that misbehaves.

#include "robot_bridge/safety/guard.hpp"

#include <gmock/gmock.h>

#include <limits>

namespace jostle::robot_bridge {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

constexpr double kTick = 0.01;  // s

// Two joints, an axis each, that do as told in ticks, but for what a test adds.
class Scripted final : public Robot {
 public:
  Result<RobotReading> read(std::stop_token = {}) override { return state; }
  Result<void> start(std::span<const double> u, double duration, std::stop_token = {}) override {
    u_.assign(u.begin(), u.end());
    left_ = duration;
    ++started;
    return {};
  }
  Result<bool> advance(std::stop_token stop = {}) override {
    if (left_ <= 1e-9) return true;
    if (stop.stop_requested()) {
      left_ = 0.0;
      happened += "stopped ";
      return Error{Code::kCancelled, "stopped"};
    }
    left_ -= kTick;
    for (std::size_t j = 0; j < 2; ++j) {
      state.v[j] = u_[j];
      state.q[j] += u_[j] * kTick;
    }
    state.stamp += kTick;
    if (spoil) spoil(state);
    return left_ <= 1e-9;
  }

  RobotReading state{.stamp = 5.0, .q = {0, 0}, .v = {0, 0}, .object_in_hand = {}};
  std::function<void(RobotReading&)> spoil;
  std::string happened;
  int started = 0;

 private:
  std::vector<double> u_;
  double left_ = 0.0;  // s
};

class Guarded : public ::testing::Test {
 protected:
  GuardOptions options() {
    return {.axes = {{.limit = 1.0, .change = 0.5, .joints = {{0, 1.0}}}, {.limit = 1.0, .joints = {{1, 0.5}}}},
            .stray = {0.02, 0.02},
            .silence = 0ms,
            .touches = [this](std::span<const std::vector<double>> path) -> std::optional<std::string> {
              for (const auto& q : path) {
                if (q[0] > wall) return "a wall";
              }
              return {};
            },
            .tell =
                [this](const std::string& report) {
                  robot.happened += "told ";
                  reports.push_back(report);
                }};
  }

  // Ends an action that should be stopped; the sentence.
  std::string stopped(std::vector<double> u = {0.2, 0.0}) {
    const auto ok = sut.execute(u, 1.0);
    EXPECT_FALSE(ok);
    EXPECT_EQ(robot.happened, "stopped told ");  // in that order
    EXPECT_TRUE(sut.advance().value());
    return ok ? "" : ok.error().message;
  }

  double wall = 10.0;
  Scripted robot;
  std::vector<std::string> reports;
  Guard sut{robot, options()};
};

TEST_F(Guarded, GoodActionsPass) {
  robot.spoil = [](RobotReading& state) { state.q[0] -= 0.001; };  // something is in the way
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(sut.execute(std::vector{0.2, -0.3}, 0.1));
  EXPECT_EQ(robot.started, 5);
  EXPECT_TRUE(reports.empty());
}

TEST_F(Guarded, ControlsThatLeapAreRefusedUntilTheRobotHasRested) {
  const auto leap = sut.execute(std::vector{0.6, 0.0}, 0.1);
  ASSERT_FALSE(leap);
  EXPECT_THAT(leap.error().message, HasSubstr("velocities[0]: got 0.6 after 0, wanted a change of at most 0.5"));
  EXPECT_EQ(robot.started, 0);
  ASSERT_TRUE(sut.execute(std::vector{0.4, 0.0}, 0.1));
  ASSERT_TRUE(sut.execute(std::vector{0.8, 0.0}, 0.1));  // 0.4 more
  EXPECT_FALSE(sut.execute(std::vector{-0.2, 0.0}, 0.1));
  robot.state.stamp += 0.2;  // at rest
  EXPECT_TRUE(sut.execute(std::vector{-0.2, 0.0}, 0.1));
}

TEST_F(Guarded, WayThatTouchesSomethingIsRefusedBeforehand) {
  wall = 0.15;
  const auto ok = sut.execute(std::vector{0.2, 0.0}, 1.0);
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kInvalidArgument);
  EXPECT_THAT(ok.error().message, HasSubstr("a wall"));
  EXPECT_EQ(robot.started, 0);
  EXPECT_TRUE(sut.execute(std::vector{0.2, 0.0}, 0.5));
}

TEST_F(Guarded, MeasuredPlaceThatTouchesSomethingStopsTheRobot) {
  robot.spoil = [this](RobotReading& state) {
    if (state.q[0] > 0.1) wall = 0.1;  // somebody put it there
  };
  EXPECT_THAT(stopped(), HasSubstr("a wall"));
}

TEST_F(Guarded, JointThatGoesWhereItWasNotToldStopsTheRobotAtOnce) {
  robot.spoil = [](RobotReading& state) {
    if (state.stamp > 5.205) state.q[1] += 0.03;  // a jump
  };
  EXPECT_THAT(stopped(), HasSubstr("joint 1 is where it was not told to go"));
  EXPECT_NEAR(robot.state.stamp, 5.21, 1e-9);
}

TEST_F(Guarded, StateThatIsNotFiniteOrFromThePastStopsTheRobot) {
  robot.spoil = [](RobotReading& state) { state.v[1] = std::numeric_limits<double>::quiet_NaN(); };
  EXPECT_THAT(stopped(), HasSubstr("v[1]: got nan"));
  robot.state.v[1] = 0.0;
  robot.happened.clear();
  robot.spoil = [](RobotReading& state) { state.stamp -= 1.0; };
  EXPECT_THAT(stopped(), HasSubstr("after one of"));
}

TEST_F(Guarded, RobotThatShowsNoNewerStateIsStopped) {
  robot.spoil = [](RobotReading& state) { state.stamp = 5.05; };
  EXPECT_THAT(stopped(), HasSubstr("showed no newer state"));
}

TEST_F(Guarded, ReportHasTheLastStatesAndCommandsOldestFirst) {
  robot.spoil = [](RobotReading& state) {
    if (state.stamp > 5.905) state.q[1] = 1.0;
  };
  (void)stopped();
  ASSERT_EQ(reports.size(), 1u);
  const std::string& report = reports[0];
  EXPECT_THAT(report, HasSubstr("joint 1 is where it was not told to go"));
  EXPECT_EQ(std::ranges::count(report, '\n'), static_cast<long>(Guard::kKept) + 1);
  const auto oldest = report.find("-0.390  u [0.200, 0.000]  q [0.1040, 0.0000]");
  const auto newest = report.find(" 0.000  u [0.200, 0.000]  q [0.1820, 1.0000]");
  EXPECT_NE(oldest, report.npos) << report;
  EXPECT_NE(newest, report.npos) << report;
  EXPECT_LT(oldest, newest);
}

TEST_F(Guarded, StopRequestOfTheCallerIsNothingToReport) {
  ASSERT_TRUE(sut.start(std::vector{0.2, 0.0}, 1.0));
  std::stop_source stop;
  stop.request_stop();
  const auto over = sut.advance(stop.get_token());
  ASSERT_FALSE(over);
  EXPECT_EQ(over.error().code, Code::kCancelled);
  EXPECT_EQ(robot.happened, "stopped ");
}

}  // namespace
}  // namespace jostle::robot_bridge
