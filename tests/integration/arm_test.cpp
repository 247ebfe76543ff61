// An arm behind its own protocols: coordinator, DDS, bridge, RTDE, a simulated controller with physics, a gripper by
// its socket. All of them processes of their own.

#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/support/arm_parts.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using robot_bridge::net::TcpClient;
using ::testing::HasSubstr;
using Clock = robot_bridge::net::Clock;

class ArmRun : public RunFixture {
 protected:
  void start_arm(std::vector<std::string> more = {}) {
    more.insert(more.begin(), {easy, "--arm", "ur-sim", "--workers", "2", "--parameters", plain});
    start(std::move(more));
  }
  const std::string address = fmt::format("127.0.1.{}", domain + 1);
};

TEST_F(ArmRun, GraspsIsRecordedAndReplaysBitEqual) {
  const std::string bag = folder.path() / "bag", picture = folder.path() / "picture.png",
                    report = folder.path() / "run.json";
  start_arm({"--record", bag, "--picture", picture, "--json", report});
  ASSERT_EQ(run->wait(2 * kPatience), 0) << run->err() << log("bridge.log") << log("ur_sim.log");

  const auto result = nlohmann::json::parse(contents(report));
  EXPECT_TRUE(result["success"]);
  EXPECT_GT(result["actions"], 1);
  EXPECT_TRUE(std::filesystem::file_size(picture) > 1000);
  const auto replay = program("jostle_replay", {bag});
  EXPECT_EQ(replay->wait(kPatience), 0) << replay->out() << replay->err();
  EXPECT_THAT(replay->out(), HasSubstr("BIT-EQUAL"));
}

class ArmParts_Deaths : public ArmParts, public ::testing::WithParamInterface<int> {};

// By the controller's own clock, whatever this machine does meanwhile.
TEST_P(ArmParts_Deaths, OfTheBridgeStopTheArmWithin200Milliseconds) {
  watchdog = "0.067";  // as it is unless told otherwise
  start_moving();
  bridge->signal(GetParam());
  const double dead = onlooker->next().time;
  EXPECT_LT(time_to_stand(dead), 0.2);
  if (GetParam() == SIGSTOP) {
    // Back again, it sends nothing that is old.
    bridge->signal(SIGCONT);
    const double back = onlooker->next().time;
    for (auto sample = onlooker->next(); sample.time < back + 1.0; sample = onlooker->next()) {
      ASSERT_LT(sample.fastest, kStill) << sample.time - back;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(, ArmParts_Deaths, ::testing::Values(SIGKILL, SIGSTOP, SIGTERM));

class ArmParts_Coordinators : public ArmParts, public ::testing::WithParamInterface<int> {};

// Whoever commands the bridge is silent.
TEST_P(ArmParts_Coordinators, DeathStopsTheArmWithin200Milliseconds) {
  silence = "0.06";  // as it is unless told otherwise
  start_moving();
  coordinator->signal(GetParam());
  const double dead = onlooker->next().time;
  EXPECT_LT(time_to_stand(dead), 0.2);
  EXPECT_FALSE(bridge->code());  // it waits for the next one
}
INSTANTIATE_TEST_SUITE_P(, ArmParts_Coordinators, ::testing::Values(SIGKILL, SIGSTOP));

class ArmParts_Stops : public ArmParts, public ::testing::WithParamInterface<const char*> {
 protected:
  void press(const std::string& button) {
    auto tcp = TcpClient::connect(address, kPendant, Clock::now() + kPatience);
    ASSERT_TRUE(tcp) << tcp.error().message;
    ASSERT_TRUE(tcp->write(button + "\n", Clock::now() + kPatience));
    EXPECT_EQ(tcp->read_line(Clock::now() + kPatience).value(), "ok");
  }

  // A controller that starts anew hangs up, also on whoever came a moment too early.
  Onlooker::Sample look_on_again() {
    Onlooker::Sample sample;
    EXPECT_TRUE(soon(kPatience, [&] {
      try {
        onlooker = std::make_unique<Onlooker>(address);
        sample = onlooker->next();
        return true;
      } catch (const std::runtime_error&) {
        return false;
      }
    }));
    return sample;
  }

  struct Recovery {
    double fastest = 0.0;  // rad/s, of a joint, until the bridge commands it again
    double took = -1.0;    // s of the controller's clock from the arm's being free to move until then; below 0: never
  };
  Recovery recovery() {
    Recovery seen;
    double free_since = -1.0;
    soon(kPatience, [&] {
      const auto sample = onlooker->next();
      seen.fastest = std::max(seen.fastest, sample.fastest);
      if (!sample.may_move) free_since = -1.0;
      if (sample.may_move && free_since < 0.0) free_since = sample.time;
      if (sample.is_commanded) seen.took = sample.time - free_since;
      return sample.is_commanded;
    });
    fmt::print("commanded again {:.0f} ms after it was free to move, {:.3f} rad/s at most meanwhile\n", 1e3 * seen.took,
               seen.fastest);
    return seen;
  }
  // s of the controller's clock until the run is over; -1: it is not.
  double time_to_end(double since) {
    double now = since;
    soon(kPatience, [&] {
      now = onlooker->next().time;
      return goal->code().has_value();
    });
    fmt::print("the run was over after {:.0f} ms\n", 1e3 * (now - since));
    return goal->code() ? now - since : -1.0;
  }
  static int count(const std::string& text, const std::string& word) {
    int found = 0;
    for (auto at = text.find(word); at != text.npos; at = text.find(word, at + 1)) ++found;
    return found;
  }
};

// The run ends with the reason, within 2 s; the bridge gets the arm ready again, within 2 s of its being free to move,
// and it does not move meanwhile; and the next run grasps.
TEST_P(ArmParts_Stops, EndTheRunAndTheNextOneGrasps) {
  const std::string button = GetParam();
  const double moving = start_moving().time;
  press(button);
  EXPECT_LT(time_to_stand(button == "reboot" ? look_on_again().time : moving), 1.0);
  const double ended = time_to_end(onlooker->next().time);
  EXPECT_GE(ended, 0.0);
  EXPECT_LT(ended, 2.0);
  EXPECT_EQ(goal->wait(kPatience), 3) << goal->err();
  EXPECT_THAT(goal->err(), HasSubstr("robot: "));
  if (button == "emergency stop") press("restart safety");
  const Recovery seen = recovery();
  EXPECT_LT(seen.fastest, 5 * kStill);
  EXPECT_GE(seen.took, 0.0);
  EXPECT_LT(seen.took, 2.0);
  EXPECT_TRUE(soon(kPatience, [&] { return count(bridge->err(), "the arm is ready again") > 0; })) << bridge->err();
  ASSERT_EQ(count(bridge->err(), "the arm is ready again"), 1) << bridge->err() << arm->err();
  const auto next = program("jostle_goal", {easy, "--parameters", plain, "--headless"});
  EXPECT_EQ(next->wait(kPatience), 0) << next->err() << bridge->err() << coordinator->err();
}
INSTANTIATE_TEST_SUITE_P(, ArmParts_Stops, ::testing::Values("protective stop", "emergency stop", "reboot"));

TEST_F(ArmRun, OfAPusherOrAWrongNameIsRefusedAndNobodyIsWaitedForAloud) {
  const std::string push = folder.path() / "push.yaml";
  ASSERT_EQ(program("jostle_scene", {"generate", "--chapter", "6", "-o", push})->wait(kPatience), 0);
  start({push, "--arm", "ur-sim"});
  EXPECT_NE(run->wait(kPatience), 0);
  EXPECT_THAT(run->err(), HasSubstr("wanted planar_gripper"));
  const auto nobody = program("jostle_run", {easy, "--arm", "ur:127.0.3.3", "--headless"});
  EXPECT_TRUE(nobody->says("waiting: 127.0.3.3:30004: connecting: Connection refused", kPatience)) << nobody->err();
  nobody->signal(SIGINT);
  EXPECT_EQ(nobody->wait(kPatience), 130);
  const auto wrong = program("jostle_run", {easy, "--arm", "ur6"});
  EXPECT_EQ(wrong->wait(kPatience), 2);
  EXPECT_THAT(wrong->err(), HasSubstr("wanted sim, ur-sim or ur:HOST"));
}

}  // namespace
}  // namespace jostle::tests
