#include "physics_pool/render/renderer.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "physics_pool/scenarios/chapter3.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

using ::testing::HasSubstr;

constexpr RenderOptions kSmall{.width = 160, .height = 120};

Scene small_scene() { return generate_chapter3({.objects = 3, .seed = 1}).value(); }

// Green clearly above red and blue: only the target is painted so.
bool is_green(const std::array<std::uint8_t, 3>& colour) {
  return colour[1] > 60 && colour[1] > 3 * colour[0] / 2 && colour[1] > 3 * colour[2] / 2;
}

int count_green(const Picture& picture) {
  int count = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) count += is_green(picture.pixel(x, y)) ? 1 : 0;
  }
  return count;
}

TEST(Renderer, ShowsTheTargetInGreenFromAbove) {
  const Scene scene = small_scene();

  const auto picture = render(scene, initial_state(scene), {.width = 160, .height = 120, .camera = "top"});

  ASSERT_TRUE(picture) << picture.error().message;
  // About 40 mm of a 600 mm table that is 80 pixels wide: some 5 x 5 pixels.
  EXPECT_GT(count_green(*picture), 8);
  EXPECT_LT(count_green(*picture), 100);
}

// Seen straight from above a disc is where its centre is.
TEST(Renderer, ShowsGoalRegionAndObstacleOfAPush) {
  const Scene scene = tests::push_around();  // goal at x = 0.2 m, obstacle at the origin

  const auto picture = render(scene, initial_state(scene), {.width = 160, .height = 120, .camera = "top"});

  ASSERT_TRUE(picture) << picture.error().message;
  const auto obstacle = picture->pixel(80, 60);
  for (const int part : obstacle) EXPECT_LT(part, 80);
  int red = 0, mean_x = 0;
  for (int y = 0; y < picture->height; ++y) {
    for (int x = 0; x < picture->width; ++x) {
      const auto colour = picture->pixel(x, y);
      if (colour[0] < 100 || colour[0] < 2 * colour[1]) continue;
      ++red;
      mean_x += x;
    }
  }
  ASSERT_GT(red, 20);
  EXPECT_NEAR(mean_x / double(red), 80 + 0.2 * 120 / (2 * 1.3 * std::tan(20 * std::numbers::pi / 180)), 2.0);
}

TEST(Renderer, HasManyColoursInTheOverview) {
  const Scene scene = small_scene();

  const auto picture = render(scene, initial_state(scene), kSmall);

  ASSERT_TRUE(picture) << picture.error().message;
  const auto [least, most] = std::ranges::minmax(picture->rgb);
  EXPECT_GT(most - least, 100);
}

TEST(Renderer, FollowsTheState) {
  const Scene scene = small_scene();
  auto sut = Renderer::create(scene, kSmall);
  ASSERT_TRUE(sut) << sut.error().message;
  State moved = initial_state(scene);
  moved.q[kJointX] += 0.05;

  const auto start = sut->render(initial_state(scene));
  const auto later = sut->render(moved);
  const auto again = sut->render(initial_state(scene));

  ASSERT_TRUE(start && later && again);
  EXPECT_NE(start->rgb, later->rgb);
  EXPECT_EQ(start->rgb, again->rgb);
}

TEST(Renderer, IgnoresMissingVelocities) {
  const Scene scene = small_scene();

  const auto picture = render(scene, {.q = initial_state(scene).q}, kSmall);

  EXPECT_TRUE(picture);
}

TEST(Renderer, RefusesAStateOfAnotherScene) {
  const Scene scene = small_scene();

  const auto picture = render(scene, {.q = {0.0, 0.0}}, kSmall);

  ASSERT_FALSE(picture);
  EXPECT_EQ(picture.error().code, Code::kInvalidArgument);
  EXPECT_EQ(picture.error().message, "q: got 2 values, wanted 33");
}

TEST(Renderer, RefusesAStateThatIsNotFinite) {
  const Scene scene = small_scene();
  State state = initial_state(scene);
  state.q[7] = std::numeric_limits<double>::quiet_NaN();

  const auto picture = render(scene, state, kSmall);

  ASSERT_FALSE(picture);
  EXPECT_THAT(picture.error().message, HasSubstr("q[7]"));
}

TEST(Renderer, NamesTheCamerasWhenAskedForAnother) {
  const auto sut = Renderer::create(small_scene(), {.camera = "side"});

  ASSERT_FALSE(sut);
  EXPECT_EQ(sut.error().message, "camera: got 'side', wanted one of: overview, top");
}

TEST(Renderer, RefusesSizesOutOfRange) {
  for (const int width : {0, -1, 5000}) {
    const auto sut = Renderer::create(small_scene(), {.width = width});
    ASSERT_FALSE(sut);
    EXPECT_THAT(sut.error().message, HasSubstr("picture size"));
  }
}

}  // namespace
}  // namespace jostle::physics_pool
