#include "services/world/perceive/detections.hpp"

#include <gmock/gmock.h>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

TEST(Detections, SayWhereHowSurelyHowLargeAndSinceWhen) {
  physics_pool::Scene scene;
  scene.objects.push_back({.name = "box", .size = {0.05, 0.04, 0.06}});
  scene.objects.push_back({.name = "can", .shape = physics_pool::Shape::kCylinder, .radius = 0.03, .height = 0.05});
  perception::Estimate box{.reading = {.name = "box", .position = {1, 2, 3}, .orientation = {0.5, -0.5, 0.5, 0.5}},
                           .last_seen = 7.25};
  for (std::size_t i = 0; i < 36; ++i) box.covariance[i] = static_cast<double>(i);
  const perception::Estimate can{.reading = {.name = "can"}, .last_seen = 3.5, .seen = false};
  const perception::Estimate stranger{.reading = {.name = "stranger"}};

  const auto message = detections_message({box, can, stranger}, 7.5, &scene);

  EXPECT_EQ(message.header().frame_id(), "world");
  EXPECT_DOUBLE_EQ(seconds(message.header()), 7.5);
  ASSERT_EQ(message.detections().size(), 3u);
  const auto& first = message.detections()[0];
  EXPECT_EQ(first.id(), "box");
  EXPECT_DOUBLE_EQ(seconds(first.header()), 7.25);
  ASSERT_EQ(first.results().size(), 1u);
  EXPECT_EQ(first.results()[0].hypothesis().class_id(), "box");
  EXPECT_EQ(first.results()[0].hypothesis().score(), 1.0);
  EXPECT_EQ(first.results()[0].pose().covariance(), box.covariance);
  const geometry_msgs::msg::Pose& pose = first.results()[0].pose().pose();
  EXPECT_EQ(pose.position().y(), 2);
  EXPECT_EQ(pose.orientation().w(), 0.5);
  EXPECT_EQ(pose.orientation().x(), -0.5);
  EXPECT_EQ(first.bbox().center(), pose);
  EXPECT_EQ(first.bbox().size().y(), 0.04);
  EXPECT_EQ(message.detections()[1].results()[0].hypothesis().score(), 0.0);
  EXPECT_EQ(message.detections()[1].bbox().size().x(), 0.06);
  EXPECT_EQ(message.detections()[2].bbox().size().x(), 0.0);
}

}  // namespace
}  // namespace jostle::world
