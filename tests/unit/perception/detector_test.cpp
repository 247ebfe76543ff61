// Tags in rendered images, whose truth is known.

#include "perception/tags/detector.hpp"

#include <gmock/gmock.h>

#include "tests/support/tag_views.hpp"

namespace jostle::perception {
namespace {

using namespace tests;
using testing::SizeIs;

// A view from the world's origin: world and camera are one.
View view_of(const std::vector<Sticker>& stickers) { return {.solids = {}, .stickers = stickers, .X_WC = {}}; }

TEST(Detector, CornersAreWhereTheyWereDrawn) {
  const Camera camera = distorting_camera();
  const SceneCamera eye(camera, {.blur = 0.5, .noise = 0.0});
  Detector sut;
  std::vector<Sticker> stickers;
  for (int i = 0; i < 6; ++i)
    stickers.push_back(
        {.id = 100 + 7 * i, .size = 0.06, .X_WT = tilted({-0.3 + 0.12 * i, 0.1 * (i % 3 - 1), 0.7}, 0.4, i, 0.5 + i)});
  const auto found = sut.detect(eye.render(view_of(stickers), 1));
  ASSERT_THAT(found, SizeIs(6));
  double bias_x = 0, bias_y = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(found[i].id, stickers[i].id);
    EXPECT_EQ(found[i].wrong_bits, 0);
    const auto truth = perfect_corners(camera, stickers[i].X_WT, stickers[i].size);
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const double x = found[i].corners[corner].x - truth[corner].x, y = found[i].corners[corner].y - truth[corner].y;
      EXPECT_LT(std::hypot(x, y), 0.3) << "corner " << corner << " of tag " << found[i].id;
      bias_x += x / 24, bias_y += y / 24;
    }
  }
  // Half a pixel between two conventions would show here.
  EXPECT_NEAR(bias_x, 0, 0.05);
  EXPECT_NEAR(bias_y, 0, 0.05);
}

TEST(Detector, PosesOfRenderedTagsAreTheTruth) {
  const Camera camera = distorting_camera();
  const SceneCamera eye(camera);
  Detector sut;
  const Sticker sticker{.id = 7, .size = 0.05, .X_WT = tilted({0.1, -0.05, 0.6}, 0.6, 1.0, 2.0)};
  const auto found = sut.detect(eye.render(view_of({sticker}), 1));
  ASSERT_THAT(found, SizeIs(1));
  const TagView tag{.corners = found[0].corners, .size = sticker.size};
  const auto estimate = estimate_pose(camera, {&tag, 1});
  ASSERT_TRUE(estimate);
  EXPECT_LT(distance_between(estimate->best.X_CB, sticker.X_WT), 0.002);
  EXPECT_LT(rotation_between(estimate->best.X_CB, sticker.X_WT), 0.02);
}

TEST(Detector, HiddenAndTurnedAwayTagsAreNotSeen) {
  const SceneCamera eye(distorting_camera());
  Detector sut;
  View view = view_of({{.id = 1, .size = 0.05, .X_WT = tilted({-0.1, 0, 0.7}, 0, 0, 0)},
                       {.id = 2, .size = 0.05, .X_WT = tilted({0.1, 0, 0.7}, 0, 0, 0)},
                       {.id = 3, .size = 0.05, .X_WT = tilted({0, 0.1, 0.7}, M_PI, 0, 0)}});
  view.solids.push_back(
      {.shape = Solid::Shape::kSphere, .half = {0.02, 0.02, 0.02}, .X_WB = {.position = {0.07, 0, 0.5}}});
  const auto found = sut.detect(eye.render(view, 1));
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].id, 1);
}

TEST(Detector, ThereIsNothingInNoise) {
  const SceneCamera eye(distorting_camera(), {.blur = 0.7, .noise = 40.0});
  EXPECT_THAT(Detector().detect(eye.render({}, 5)), SizeIs(0));
}

TEST(Rendering, SolidsShowWhereTheyAreProjected) {
  Camera camera = distorting_camera();
  const SceneCamera sut(camera, {.blur = 0.0, .noise = 0.0, .background = 0.0});
  // From 1 m above the middle of a table, straight down: the image's up is the world's +y.
  View view{.X_WC = looking_at({0, 0, 1}, {0, 0, 0})};
  view.solids.push_back(
      {.shape = Solid::Shape::kBox, .half = {0.05, 0.03, 0.01}, .X_WB = {.position = {0.1, 0.2, -0.01}}, .shade = 0.8});
  view.solids.push_back({.shape = Solid::Shape::kCylinder,
                         .half = {0.04, 0.04, 0.01},
                         .X_WB = {.position = {-0.2, 0, -0.01}},
                         .shade = 0.4});
  const GreyImage image = sut.render(view, 1);
  const auto at = [&](double x, double y) {
    const Pixel pixel = project(camera, {x, -y, 1.0}).pixel;
    return image.at(static_cast<int>(std::lround(pixel.x)), static_cast<int>(std::lround(pixel.y)));
  };
  EXPECT_EQ(at(0.1, 0.2), 204);
  EXPECT_EQ(at(0.147, 0.227), 204);
  EXPECT_EQ(at(0.053, 0.173), 204);
  EXPECT_EQ(at(0.153, 0.2), 0);
  EXPECT_EQ(at(-0.2, 0.038), 102);
  EXPECT_EQ(at(-0.17, 0.04), 0);  // the corner of its bounding square
}

TEST(Rendering, EqualSeedsGiveEqualImages) {
  const SceneCamera sut(distorting_camera());
  const View view = view_of({{.id = 1, .size = 0.05, .X_WT = tilted({0, 0, 0.7}, 0.3, 0, 0)}});
  EXPECT_EQ(sut.render(view, 1), sut.render(view, 1));
  EXPECT_NE(sut.render(view, 1), sut.render(view, 2));
}

}  // namespace
}  // namespace jostle::perception
