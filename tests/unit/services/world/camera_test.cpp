// From a scene to an image of it, and back from the message to where its objects are.

#include <gmock/gmock.h>

#include "idl/types/transform.hpp"
#include "perception/tags/detector.hpp"
#include "perception/tags/pose.hpp"
#include "services/world/arm/arm_scene.hpp"
#include "services/world/camera/camera_out.hpp"
#include "services/world/camera/messages.hpp"

namespace jostle::world {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

physics_pool::Scene two_objects() {
  physics_pool::Scene scene;
  scene.name = "two";
  scene.objects.push_back(
      {.name = "box", .size = {0.05, 0.04, 0.06}, .mass = 0.3, .friction = 0.4, .x = 0.1, .y = -0.05, .yaw = 0.7});
  scene.objects.push_back({.name = "can",
                           .shape = physics_pool::Shape::kCylinder,
                           .radius = 0.03,
                           .height = 0.05,
                           .mass = 0.3,
                           .friction = 0.4,
                           .x = -0.1,
                           .y = 0.15,
                           .yaw = -2});
  scene.task.target = "box";
  return scene;
}

TEST(SceneTags, AreAsLargeAsFitsOnTheTops) {
  const auto tags = tags_of(two_objects());
  ASSERT_TRUE(tags) << tags.error().message;
  EXPECT_EQ((*tags)[0].id, 0);
  EXPECT_DOUBLE_EQ((*tags)[0].size, 0.032);  // 40 mm of paper
  EXPECT_EQ((*tags)[1].object, "can");
  EXPECT_DOUBLE_EQ((*tags)[1].size, 0.033);  // 60 mm / sqrt 2 of paper
  EXPECT_DOUBLE_EQ((*tags)[1].X_BT.position[2], 0.025);
}

TEST(SceneTags, SayWhereThereIsNoRoom) {
  auto scene = two_objects();
  scene.objects[1].radius = 0.008;
  const auto tags = tags_of(scene);
  ASSERT_FALSE(tags);
  EXPECT_THAT(tags.error().message, HasSubstr("'can'"));
}

TEST(SimulatedCamera, ImagesTellWhereObjectsAre) {
  const auto scene = two_objects();
  const auto tags = tags_of(scene);
  const perception::Camera camera = simulated_camera();
  const Pose X_WC = overhead(scene);
  const auto image = perception::SceneCamera(camera).render(view_of(scene, *tags, initial_state(scene), X_WC), 1);
  const auto received = from_message(to_message(image, 1.5));
  const auto intrinsics = from_message(to_message(camera, 1.5));
  ASSERT_TRUE(received && intrinsics);
  EXPECT_EQ(*received, image);
  EXPECT_EQ(intrinsics->distortion, camera.distortion);

  const auto found = perception::Detector().detect(*received);
  ASSERT_EQ(found.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const physics_pool::SceneObject& object = scene.objects[i];
    const perception::TagView tag{.corners = found[i].corners, .size = (*tags)[i].size, .X_BT = (*tags)[i].X_BT};
    const auto estimate = perception::estimate_pose(*intrinsics, {&tag, 1});
    ASSERT_TRUE(estimate);
    const Pose X_WB = pose_of(transform(X_WC) * transform(estimate->best.X_CB));
    EXPECT_NEAR(X_WB.position[0], object.x, 0.002);
    EXPECT_NEAR(X_WB.position[1], object.y, 0.002);
    EXPECT_NEAR(X_WB.position[2], object.rest_height(), 0.01);
    EXPECT_NEAR(yaw_of(X_WB.orientation.data()), object.yaw, 0.02);
  }
}

TEST(SimulatedCamera, AnArmHidesWhatIsBelowIt) {
  const auto found_with_hand_at = [](double x) {
    physics_pool::Scene scene = two_objects();
    scene.robot = physics_pool::planar_gripper({.x = x, .opening = 0.085});
    scene.objects[0].x = 0.01, scene.objects[0].y = 0.0;
    scene.objects[1].y = -0.2;
    const physics_pool::Scene shown = with_arm(scene, {}).value();
    const auto tags = tags_of(shown).value();
    const auto image = perception::SceneCamera(simulated_camera())
                           .render(view_of(shown, tags, initial_state(shown), overhead(shown)), 1);
    std::vector<int> ids;
    for (const perception::Detection& detection : perception::Detector().detect(image)) ids.push_back(detection.id);
    return ids;
  };
  EXPECT_THAT(found_with_hand_at(-0.33), ElementsAre(0, 1));
  EXPECT_THAT(found_with_hand_at(0.2), ElementsAre(1));  // the box is below the wrist
}

TEST(CameraMessages, ColoursBecomeGreyAndRowsMayBePadded) {
  sensor_msgs::msg::Image message;
  message.width(2), message.height(1), message.encoding("rgb8"), message.step(8);
  message.data({10, 20, 30, 255, 255, 255, 99, 99});
  const auto image = from_message(message);
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->pixels, (std::vector<std::uint8_t>{20, 255}));
}

TEST(CameraMessages, SayWhatIsWrong) {
  const auto complaint = [](const sensor_msgs::msg::Image& message) {
    const auto image = from_message(message);
    return image ? std::string("nothing") : image.error().message;
  };
  const sensor_msgs::msg::Image good = to_message({.width = 2, .height = 2, .pixels = {1, 2, 3, 4}}, 0);
  EXPECT_EQ(complaint(good), "nothing");
  auto bad = good;
  bad.encoding("yuv422");
  EXPECT_THAT(complaint(bad), HasSubstr("image.encoding: got 'yuv422'"));
  bad = good;
  bad.data().pop_back();
  EXPECT_THAT(complaint(bad), HasSubstr("image.data: got 3 bytes"));
  bad = good;
  bad.step(1);
  EXPECT_THAT(complaint(bad), HasSubstr("image.step"));
  bad = good;
  bad.width(0);
  EXPECT_THAT(complaint(bad), HasSubstr("0x2 pixels"));
  // So many rows that their product is small again.
  bad = good;
  bad.step(0x80000000u), bad.height(2);
  EXPECT_THAT(complaint(bad), HasSubstr("image.data"));

  sensor_msgs::msg::CameraInfo info = to_message(simulated_camera(), 0);
  info.k()[0] = 0;
  EXPECT_FALSE(from_message(info));
  info = to_message(simulated_camera(), 0);
  info.distortion_model("equidistant");
  EXPECT_FALSE(from_message(info));
}

}  // namespace
}  // namespace jostle::world
