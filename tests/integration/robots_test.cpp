// An arm that a user brings as URDF, through the programs that look at scenes.

#include <gmock/gmock.h>

#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using testing::HasSubstr;

const std::string kArm = std::string(JOSTLE_SOURCE_DIR) + "/tests/support/robots/seven_axis_reach.yaml";

class Robots : public RunFixture {
 protected:
  int ends(const std::string& name, const std::vector<std::string>& arguments) {
    const auto process = program(name, arguments);
    const int code = process->wait(kPatience).value_or(-1);
    out = process->out(), err = process->err();
    return code;
  }

  std::string out, err;
};

TEST_F(Robots, AnArmIsCheckedAndShown) {
  EXPECT_EQ(ends("jostle_scene", {"check", kArm}), 0) << err;
  EXPECT_THAT(out, HasSubstr("ok "));
  EXPECT_EQ(ends("jostle_scene", {"show", kArm}), 0) << err;
  EXPECT_THAT(out, HasSubstr("9 joints, controls axis_1, axis_2, axis_3, axis_4, axis_5, axis_6, axis_7, finger"));
  EXPECT_THAT(out, HasSubstr("shelf board"));
}

TEST_F(Robots, AnArmIsDrawn) {
  const auto picture = folder.path() / "arm.png";
  EXPECT_EQ(ends("jostle_render", {kArm, "-o", picture, "--size", "160x120"}), 0) << err;
  EXPECT_GT(std::filesystem::file_size(picture), 5000u);
}

// What a scene says may come from anywhere: a worker opens no file for it.
TEST_F(Robots, ASceneOfTextAloneContainsItsRobot) {
  EXPECT_EQ(ends("jostle_scene", {"perturb", kArm, "--uncertainty", "low", "-o", folder.path() / "belief.yaml"}), 0)
      << err;
  const std::string text = contents(folder.path() / "belief.yaml");
  EXPECT_THAT(text, HasSubstr("axis_7"));
  EXPECT_TRUE(physics_pool::parse_scene(text, "belief.yaml"));
}

TEST_F(Robots, ARobotThatThereIsNotIsRefusedWithThePlacesLookedAt) {
  const auto scene =
      folder.write("wrong.yaml",
                   "jostle_scene: 2\nrobot: {model: seven_axes}\nobjects:\n"
                   "  - {name: a, size: [0.04, 0.05, 0.06], mass: 0.5, friction: 0.4, pose: {x: 0, y: 0}}\n"
                   "task: {kind: reach, target: a}\n");
  EXPECT_EQ(ends("jostle_scene", {"check", scene}), 2);
  EXPECT_THAT(
      err,
      HasSubstr("wrong.yaml:2: robot.model: got 'seven_axes', wanted planar_gripper, pusher, ur5_2f85, or a file"));
  EXPECT_THAT(err, HasSubstr(folder.path().string()));
}

}  // namespace
}  // namespace jostle::tests
