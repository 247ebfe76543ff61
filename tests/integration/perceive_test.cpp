// Objects that are seen by a motion capture: the simulated world tells its cameras alone, they speak NatNet, and what
// reads them publishes; or through rendered images. All of them processes of their own.

#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "perception/rendering/renderer.hpp"
#include "services/common/process/child_process.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/world/camera/camera_out.hpp"
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
  static constexpr int kFrames = 40;
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
  ask({"--json", "--camera", "/camera"});  // as users of ROS 2 write it
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

// Frames as a device would give them: written to a file, and read back.
TEST_F(PerceiveByCamera, AVideoOfTheSceneShowsWhereObjectsAre) {
  const physics_pool::Scene scene = three_objects();
  const perception::SceneCamera eye(world::simulated_camera());
  const perception::View view =
      world::view_of(scene, world::tags_of(scene).value(), physics_pool::initial_state(scene), world::overhead(scene));
  for (int i = 0; i < kFrames; ++i) {
    const perception::GreyImage image = eye.render(view, static_cast<std::uint64_t>(i));
    std::ofstream file(folder.path() / fmt::format("{}.pgm", i), std::ios::binary);
    file << "P5 " << image.width << ' ' << image.height << " 255\n";
    file.write(reinterpret_cast<const char*>(image.pixels.data()), static_cast<std::streamsize>(image.pixels.size()));
  }
  const std::string video = folder.path() / "video.mkv";
  ASSERT_TRUE(common::run_tool("ffmpeg", "ffmpeg",
                               {"-framerate", "10", "-i", folder.path() / "%d.pgm", "-c:v", "ffv1", video},
                               folder.path() / "ffmpeg.log"));
  const std::string intrinsics = folder.write("camera.yaml", perception::to_yaml(world::simulated_camera()));
  const auto participant = wire::Participant::open({.domain = domain}).value();
  wire::Inbox<jostle_msgs::msg::ObjectStates> states(participant, wire::topics::kObjectStates, kFrames);

  const auto sut = program("jostle_perceive", {"camera", video, "--intrinsics", intrinsics, "--scene", easy});

  const auto seen = states.take(std::chrono::steady_clock::now() + kSlow);
  ASSERT_TRUE(seen) << sut->err();
  ASSERT_EQ(seen->objects().size(), scene.objects.size());
  for (const auto& object : seen->objects()) {
    const auto truth = std::ranges::find(scene.objects, object.name(), &physics_pool::SceneObject::name);
    ASSERT_NE(truth, scene.objects.end());
    EXPECT_NEAR(object.pose().position().x(), truth->x, 0.003) << object.name();
    EXPECT_NEAR(object.pose().position().y(), truth->y, 0.003) << object.name();
  }
  EXPECT_EQ(sut->wait(kPatience), 0) << "it ends with the file: " << sut->err();
  EXPECT_THAT(sut->err(), HasSubstr(fmt::format("{} frames", kFrames)));
}

TEST_F(PerceiveByCamera, AVideoWithoutIntrinsicsAndOneThatIsNoneAreRefused) {
  const std::string none = folder.write("none.mkv", "no video");
  const auto bare = program("jostle_perceive", {"camera", none, "--scene", easy});
  EXPECT_EQ(bare->wait(kPatience), 2);
  EXPECT_THAT(bare->err(), HasSubstr("--intrinsics: got none"));
  const std::string intrinsics = folder.write("camera.yaml", perception::to_yaml(world::simulated_camera()));
  const auto spoilt = program("jostle_perceive", {"camera", none, "--intrinsics", intrinsics, "--scene", easy});
  EXPECT_EQ(spoilt->wait(kPatience), 3);
  EXPECT_THAT(spoilt->err(), HasSubstr("cannot be opened as a video"));
  const auto missing =
      program("jostle_perceive", {"camera", "/dev/video99", "--intrinsics", intrinsics, "--scene", easy});
  EXPECT_EQ(missing->wait(kPatience), 2);
  EXPECT_THAT(missing->err(), HasSubstr("/dev/video99: got no such device"));
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
