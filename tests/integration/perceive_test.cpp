// Objects that are seen by a motion capture: the simulated world tells its cameras alone, they speak NatNet, and what
// reads them publishes; or through rendered images. All of them processes of their own.

#include <gmock/gmock.h>

#include <map>
#include <nlohmann/json.hpp>

#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class Perceive : public RunFixture, public ::testing::WithParamInterface<const char*> {};

TEST_P(Perceive, RunGraspsWhatMotionCaptureSeesAndReplaysBitEqual) {
  const std::string bag = folder.path() / "bag", report = folder.path() / "run.json";
  const int code = finish({easy, "--arm", GetParam(), "--objects", "mocap-sim", "--workers", "2", "--parameters", plain,
                           "--record", bag, "--json", report});

  ASSERT_EQ(code, 0) << run->err();
  const auto result = nlohmann::json::parse(contents(report));
  EXPECT_TRUE(result["success"]);
  EXPECT_GT(result["actions"], 1);
  const auto replay = program("jostle_replay", {bag});
  EXPECT_EQ(replay->wait(kPatience), 0) << replay->out() << replay->err();
  EXPECT_THAT(replay->out(), HasSubstr("BIT-EQUAL"));
}
INSTANTIATE_TEST_SUITE_P(, Perceive, ::testing::Values("sim", "ur-sim"),
                         [](const auto& arm) { return std::string(arm.param) == "sim" ? "ByHand" : "ByArm"; });

class PerceiveByCamera : public RunFixture {
 protected:
  // Each image costs a tenth of a second of a core, or more on a busy machine.
  static constexpr auto kSlow = 3 * kPatience;
};

TEST_F(PerceiveByCamera, RunGraspsWhatRenderedPixelsShow) {
  const std::string report = folder.path() / "run.json";
  const int code = finish({easy, "--objects", "camera-sim", "--workers", "2", "--parameters", plain, "--json", report});

  ASSERT_EQ(code, 0) << run->err();
  const auto result = nlohmann::json::parse(contents(report));
  EXPECT_TRUE(result["success"]);
  EXPECT_GT(result["actions"], 1);
}

// The whole lab: a controller with physics behind RTDE, images of the arm among the objects, tags, the estimate.
TEST_F(PerceiveByCamera, AnArmGraspsWhatRenderedPixelsShowAndReplaysBitEqual) {
  const std::string bag = folder.path() / "bag", report = folder.path() / "run.json";
  start({easy, "--arm", "ur-sim", "--objects", "camera-sim", "--workers", "2", "--parameters", plain, "--record", bag,
         "--json", report});

  ASSERT_EQ(run->wait(kSlow), 0) << run->err() << log("ur_sim.log") << log("perceive.log");
  const auto result = nlohmann::json::parse(contents(report));
  EXPECT_TRUE(result["success"]);
  EXPECT_GT(result["actions"], 1);
  const auto replay = program("jostle_replay", {bag});
  EXPECT_EQ(replay->wait(kPatience), 0) << replay->out() << replay->err();
  EXPECT_THAT(replay->out(), HasSubstr("BIT-EQUAL"));
}

// What `jostle doctor` says of the eyes, by what it looked at.
class DoctorOfEyes : public RunFixture {
 protected:
  void ask(const std::vector<std::string>& arguments) {
    const auto doctor = program("jostle_doctor", arguments);
    EXPECT_TRUE(doctor->wait(kPatience));
    for (const nlohmann::json& check : nlohmann::json::parse(doctor->out(), nullptr, false))
      said[check["name"]] =
          fmt::format("{}: {}", check["verdict"].get<std::string>(), check["finding"].get<std::string>());
  }

  std::map<std::string, std::string> said;
};

TEST_F(DoctorOfEyes, NamesTheBodiesOfAMotionCapture) {
  const std::string address = fmt::format("127.0.6.{}", domain + 1);
  const auto world = program("jostle_sim", {easy, "--mocap", address, "--free-running"});
  ask({"--json", "--mocap", address});
  EXPECT_THAT(said["motion capture"], StartsWith("ok: frames come from " + address)) << world->err();
  EXPECT_THAT(said["rigid bodies"], AllOf(StartsWith("ok: "), HasSubstr("target")));
  EXPECT_THAT(said["frames"], HasSubstr("0 lost, 0 malformed"));
}

TEST_F(DoctorOfEyes, SaysThatNobodyIsThere) {
  ask({"--json", "--mocap", fmt::format("127.0.6.{}", domain + 1)});
  EXPECT_THAT(said["motion capture"], StartsWith("FAIL: "));
  ask({"--json", "--camera", "camera"});
  EXPECT_THAT(said["camera"], StartsWith("FAIL: no image on /camera/image_raw"));
}

TEST_F(DoctorOfEyes, NamesTheTagsThatACameraSees) {
  const auto arm = program("jostle_ur_sim", {easy, "--camera", "--address", fmt::format("127.0.1.{}", domain + 1)});
  ASSERT_TRUE(arm->says("ready", kPatience)) << arm->err();
  ask({"--json", "--camera", "camera"});
  EXPECT_THAT(said["camera"], HasSubstr("images per second of")) << arm->err();
  EXPECT_THAT(said["intrinsics"], StartsWith("ok: focal length"));
  EXPECT_THAT(said["tags"], StartsWith("ok: "));
}

TEST_F(PerceiveByCamera, ASnapshotShowsWhatWasLookedAt) {
  const std::string picture = folder.path() / "snapshot.png";
  const auto arm = program("jostle_ur_sim", {easy, "--camera", "--address", fmt::format("127.0.1.{}", domain + 1)});
  const auto sut = program("jostle_perceive", {"camera", "camera", "--scene", easy, "--snapshot", picture});
  EXPECT_TRUE(sut->says("frames come from camera", kPatience)) << sut->err() << arm->err();
  sut->signal(SIGTERM);
  EXPECT_EQ(sut->wait(kPatience), 0) << sut->err();
  EXPECT_THAT(contents(picture), StartsWith("\x89PNG"));
}

TEST_F(PerceiveByCamera, WhatACameraCannotDoIsRefused) {
  EXPECT_EQ(finish({easy, "--objects", "camera-sim", "--arm", "ur:127.0.0.1"}), 2);
  EXPECT_THAT(run->err(), HasSubstr("wanted --arm sim or ur-sim"));
  EXPECT_EQ(finish({easy, "--objects", "camera-sim", "--uncertainty", "low"}), 2);
  EXPECT_THAT(run->err(), HasSubstr("a camera sees what is there"));
}

class PerceiveTrouble : public RunFixture {};

TEST_F(PerceiveTrouble, EyesThatAreGoneEndTheRunByTheirName) {
  start({easy, "--objects", "mocap-sim", "--workers", "2", "--parameters", endless});
  ASSERT_TRUE(searches()) << run->err();
  const pid_t eyes = run->child("jostle_perceive");
  ASSERT_GT(eyes, 0);

  kill(eyes, SIGKILL);

  EXPECT_EQ(run->wait(kPatience), 3);
  EXPECT_THAT(run->err(), HasSubstr("the eyes ended: killed by signal 9"));
}

class PerceiveFaults : public RunFixture {};

// Noise, hidden objects, swapped markers and late frames, all of them ordered.
TEST_F(PerceiveFaults, OfMotionCaptureThatWereOrderedAreSurvived) {
  const std::string report = folder.path() / "run.json";
  const int code =
      finish({easy, "--objects", "mocap-sim", "--mocap-noise", "0.002", "--mocap-hidden", "0.1", "--mocap-swapped",
              "0.05", "--mocap-latency", "0.02", "--workers", "2", "--parameters", plain, "--json", report});
  ASSERT_EQ(code, 0) << run->err();
  EXPECT_TRUE(nlohmann::json::parse(contents(report))["success"]);
}

TEST_F(PerceiveTrouble, NobodyThereIsSaid) {
  const auto sut = program("jostle_perceive", {"mocap", "--host", "127.0.7.7"});
  EXPECT_TRUE(sut->says("waiting: 127.0.7.7:1510: no answer so far", kPatience)) << sut->err();
  sut->signal(SIGTERM);
  EXPECT_EQ(sut->wait(kPatience), 0);
  EXPECT_THAT(sut->err(), HasSubstr("0 frames"));
}

TEST_F(PerceiveTrouble, WhatIsNoSensorIsRefused) {
  EXPECT_EQ(finish({easy, "--objects", "eyes"}), 2);
  EXPECT_THAT(run->err(), HasSubstr("wanted sim, mocap-sim, camera-sim or mocap:HOST"));
  EXPECT_EQ(finish({easy, "--objects", "mocap:10.0.0.1"}), 2);
  EXPECT_THAT(run->err(), HasSubstr("the arm's world is simulated"));
  EXPECT_EQ(finish({easy, "--mocap-noise", "0.01"}), 2);
  EXPECT_THAT(run->err(), HasSubstr("wanted mocap-sim: only it has faults"));
}

}  // namespace
}  // namespace jostle::tests
