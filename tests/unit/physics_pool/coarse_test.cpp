#include <gmock/gmock.h>

#include <numbers>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/coarse/contact.hpp"
#include "physics_pool/coarse/kinematic.hpp"
#include "physics_pool/coarse/quasi_static.hpp"
#include "tests/support/pushing.hpp"

namespace jostle::tests {
namespace {

using namespace physics_pool;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Truly;

constexpr double kPusher = 0.0145, kDisc = 0.05115;

std::vector<double> planar_start(const Scene& scene) {
  std::vector<double> planar(static_cast<std::size_t>(PlanarLayout{static_cast<int>(scene.objects.size())}.size()));
  to_planar(layout_of(scene), initial_state(scene), planar);
  return planar;
}

std::vector<double> advance(CoarseModel& sut, std::vector<double> planar, std::vector<double> u, double duration) {
  sut.advance(planar, u, duration);
  return planar;
}

TEST(ToPlanar, NamesEveryPart) {
  Scene scene = pushing_scene(-0.3, 0.1, {slider_box("a", 0.1, 0.2, 0.7), slider_disc("b", 0.4, -0.3)});
  State x = initial_state(scene);
  x.v[0] = 1;      // pusher
  x.v[2 + 1] = 2;  // of a: y
  x.v[2 + 5] = 3;  // of a: about z
  std::vector<double> planar(PlanarLayout{2}.size());
  to_planar(layout_of(scene), x, planar);

  const std::vector<double> wanted{-0.3, 0.1, 0.1, 0.2, 0.7, 0.4, -0.3, 0.0, 1, 0, 0, 2, 3, 0, 0, 0};
  ASSERT_EQ(planar.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(planar[i], wanted[i], 1e-12) << i;
}

TEST(Kinematic, SliderGoesAlongFromTheTouchOn) {
  const Scene scene = pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)});
  KinematicModel sut(scene);
  const double free = 0.1 - kPusher - kDisc;

  const auto x = advance(sut, planar_start(scene), {0.05, 0.0}, 1.0);

  EXPECT_NEAR(x[0], -0.05, 1e-12);
  EXPECT_NEAR(x[2], 0.05 - free, 2e-5);  // p_c·u·Delta_t
  EXPECT_NEAR(x[4], 0.0, 1e-12);
  EXPECT_DOUBLE_EQ(x[7], 0.05);  // Eq. 6.7
}

TEST(Kinematic, OffCentrePushTurnsAsEq66Says) {
  const double y = 0.02, gain = 0.5;
  const double x0 = -std::sqrt((kPusher + kDisc) * (kPusher + kDisc) - y * y);
  const Scene scene = pushing_scene(x0 - 1e-7, y, {slider_disc("s", 0.0, 0.0)});
  KinematicModel sut(scene, gain);

  const auto x = advance(sut, planar_start(scene), {0.025, 0.0}, 1.0);

  // The arm is as long as the disc's radius, the angle that of the contact.
  const double sine = -y / (kPusher + kDisc);
  EXPECT_NEAR(x[4], gain * 0.025 * sine / kDisc, 1e-5);
}

TEST(Kinematic, MissedAndReceding) {
  const Scene scene = pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)});
  KinematicModel sut(scene);
  const auto start = planar_start(scene);

  for (const auto& u : {std::vector{0.0, 0.1}, std::vector{-0.1, 0.0}, std::vector{0.0, 0.0}}) {
    const auto x = advance(sut, start, u, 1.0);
    EXPECT_EQ(std::vector<double>(x.begin() + 2, x.begin() + 5),
              std::vector<double>(start.begin() + 2, start.begin() + 5));
    EXPECT_DOUBLE_EQ(x[0], start[0] + u[0]);
  }
}

class QuasiStatic : public ::testing::TestWithParam<bool> {
 protected:
  QuasiStaticModel model(const Scene& scene) { return {scene, {.sliders_touch = GetParam()}}; }
};

TEST_P(QuasiStatic, CentrePushGoesStraight) {
  for (const SceneObject& slider : {slider_disc("s", 0.0, 0.0), slider_box("s", 0.0, 0.0)}) {
    const double half = slider.shape == Shape::kBox ? slider.size[0] / 2 : slider.radius;
    const Scene scene = pushing_scene(-half - kPusher, 0.0, {slider});
    QuasiStaticModel sut = model(scene);

    const auto x = advance(sut, planar_start(scene), {0.05, 0.0}, 1.0);

    EXPECT_NEAR(x[2], 0.05, 1e-9);
    EXPECT_NEAR(x[3], 0.0, 1e-12);
    EXPECT_NEAR(x[4], 0.0, 1e-12);
    EXPECT_NEAR(x[7], 0.05, 1e-9);
  }
}

// Sticking at a point r across the line of motion: omega = -u·r/(c^2 + r^2), v_x = u·c^2/(c^2 + r^2).
TEST_P(QuasiStatic, StickingPushTurnsAsTheLimitSurfaceSays) {
  const double r = 0.03, half = 0.109 / 2, c = std::hypot(half, 0.154 / 2), u = 0.01;
  const Scene scene = pushing_scene(-half - kPusher, r, {slider_box("s", 0.0, 0.0)});
  QuasiStaticModel sut = model(scene);

  const auto x = advance(sut, planar_start(scene), {u, 0.0}, 0.1);  // 1 mm

  const double bottom = c * c + r * r + half * half;  // the arm has both parts
  EXPECT_NEAR(x[4], -u * 0.1 * r / bottom, 0.03 * u * 0.1 * r / bottom);
  EXPECT_NEAR(x[2] / (u * 0.1), (c * c + half * half) / bottom, 0.01);
}

TEST_P(QuasiStatic, MirroredPushesMirror) {
  const Scene left = pushing_scene(-0.075, 0.02, {slider_box("s", 0.0, 0.0, 0.2)});
  const Scene right = pushing_scene(-0.075, -0.02, {slider_box("s", 0.0, 0.0, -0.2)});
  QuasiStaticModel a = model(left), b = model(right);

  const auto x = advance(a, planar_start(left), {0.05, 0.01}, 1.0);
  const auto y = advance(b, planar_start(right), {0.05, -0.01}, 1.0);

  EXPECT_NEAR(x[2], y[2], 1e-12);
  EXPECT_NEAR(x[3], -y[3], 1e-12);
  EXPECT_NEAR(x[4], -y[4], 1e-12);
}

TEST_P(QuasiStatic, NothingEndsInsideThePusher) {
  for (const double y : {-0.06, -0.03, 0.0, 0.04}) {
    const Scene scene = pushing_scene(-0.12, y, {slider_box("s", 0.0, 0.0, 0.3)});
    QuasiStaticModel sut = model(scene);
    auto x = planar_start(scene);
    for (int step = 0; step < 4; ++step) x = advance(sut, x, {0.06, 0.01}, 1.0);
    const Contacts contacts =
        find_contacts(outline(scene.objects[0]), PlanarPose(x[2], x[3], x[4]), {.radius = kPusher},
                      PlanarPose(x[0], x[1], 0.0), 5e-5);  // second order in the substep
    EXPECT_TRUE(contacts.empty());
  }
}

TEST_P(QuasiStatic, WhatIsNotFiniteStaysSo) {
  const Scene scene = pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)});
  QuasiStaticModel sut = model(scene);
  const auto x = advance(sut, planar_start(scene), {std::nan(""), 0.0}, 1.0);
  EXPECT_TRUE(std::isnan(x[0]));
}

INSTANTIATE_TEST_SUITE_P(Models, QuasiStatic, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "Planar" : "LimitSurface"; });

TEST(Planar, RowOfDiscsMovesTogether) {
  const double d = 2 * kDisc;
  const Scene scene = pushing_scene(-kDisc - kPusher, 0.0,
                                    {slider_disc("a", 0, 0), slider_disc("b", d, 0), slider_disc("c", 2 * d, 0)});
  QuasiStaticModel sut(scene, {.sweeps = 30});

  const auto x = advance(sut, planar_start(scene), {0.05, 0.0}, 1.0);

  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(x[static_cast<std::size_t>(PlanarLayout{3}.pose(i))], i * d + 0.05, 1e-3) << i;
}

TEST(Planar, BoxesPushBoxesAndDiscs) {
  const Scene scene = pushing_scene(-0.0545 - kPusher, 0.0,
                                    {slider_box("a", 0, 0), slider_box("b", 0.115, 0.02), slider_disc("c", 0.23, 0.0)});
  QuasiStaticModel sut(scene, {});
  auto x = planar_start(scene);

  for (int step = 0; step < 2; ++step) x = advance(sut, x, {0.04, 0.0}, 1.0);

  const PlanarLayout at{3};
  EXPECT_GT(x[static_cast<std::size_t>(at.pose(1))], 0.115 + 0.06);
  EXPECT_GT(x[static_cast<std::size_t>(at.pose(2))], 0.23 + 0.04);
}

TEST(FindContacts, BoxesEdgeToEdgeHaveTwo) {
  const Outline box{.half_x = 0.1, .half_y = 0.05};
  const Contacts contacts = find_contacts(box, PlanarPose(0.19, 0.0, 0.0), box, PlanarPose(0.0, 0.0, 0.0));
  int count = 0;
  for (const Contact& contact : contacts) {
    ++count;
    EXPECT_NEAR(contact.depth, 0.01, 1e-12);
    EXPECT_NEAR(contact.normal.x(), 1.0, 1e-12);
    EXPECT_NEAR(std::abs(contact.point.y()), 0.05, 1e-12);
  }
  EXPECT_EQ(count, 2);
  EXPECT_TRUE(find_contacts(box, PlanarPose(0.21, 0.0, 0.0), box, PlanarPose(0.0, 0.0, 0.0)).empty());
}

TEST(FindContacts, CornerIntoEdge) {
  const Outline box{.half_x = 0.05, .half_y = 0.05};
  const double reach = 0.05 * std::numbers::sqrt2;
  const Contacts contacts =
      find_contacts(box, PlanarPose(0.05 + reach - 0.002, 0.01, std::numbers::pi / 4), box, PlanarPose());
  ASSERT_FALSE(contacts.empty());
  EXPECT_NEAR(contacts.begin()->depth, 0.002, 1e-9);
  EXPECT_NEAR(contacts.begin()->point.y(), 0.01, 1e-9);
}

TEST(MakeCoarseModel, SaysWhatItWants) {
  const Scene scene = pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)});
  for (const char* name : {"kinematic", "limit-surface", "planar"}) {
    auto model_result = make_coarse_model(name, scene);
    ASSERT_TRUE(model_result) << name;
    EXPECT_EQ((*model_result)->name(), name);
  }
  const auto unknown = make_coarse_model("astrology", scene);
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().message,
              HasSubstr("got 'astrology', wanted kinematic, limit-surface, planar, learned or learned:FILE"));

  Scene gripper = scene;
  gripper.robot = planar_gripper();
  const auto wrong = make_coarse_model("planar", gripper);
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().message, HasSubstr("robot.model: got 'planar_gripper', wanted a disc"));
}

}  // namespace
}  // namespace jostle::tests
