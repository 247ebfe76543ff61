#include "physics_pool/feasible/nearest_state.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>

#include "idl/types/transform.hpp"

namespace jostle::physics_pool {
namespace {

using Eigen::AngleAxisd;
using Eigen::Vector3d;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::array<double, 36> diagonal(double translation, double rotation) {
  std::array<double, 36> covariance{};
  for (std::size_t i = 0; i < 6; ++i) covariance[7 * i] = std::pow(i < 3 ? translation : rotation, 2);
  return covariance;
}

SceneObject box(std::string name, double x, double y, double yaw = 0.0) {
  return {.name = std::move(name), .size = {0.06, 0.04, 0.1}, .mass = 0.2, .friction = 0.5, .x = x, .y = y, .yaw = yaw};
}

SceneObject can(std::string name, double x, double y) {
  return {.name = std::move(name), .shape = Shape::kCylinder, .radius = 0.03, .height = 0.1, .x = x, .y = y};
}

Pose pose_of(const SceneObject& object) {
  return {.position = {object.x, object.y, object.rest_height()}, .orientation = turned_about_z(object.yaw)};
}

Scene scene_of(std::vector<SceneObject> objects) {
  Scene scene;
  scene.name = "test";
  scene.objects = std::move(objects);
  return scene;
}

// What a sensor says, wrong by a draw from the covariance that it says.
MeasuredObject seen(const SceneObject& object, double translation, double rotation, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const auto draw = [&](double sigma) -> Vector3d {
    return sigma * Vector3d(normal(random), normal(random), normal(random));
  };
  Eigen::Isometry3d X = transform(pose_of(object));
  X.translation() += draw(translation);
  const Vector3d turn = draw(rotation);
  X.linear() = AngleAxisd(turn.norm(), turn.normalized()) * X.linear();
  return {.name = object.name, .X_WB = jostle::pose_of(X), .covariance = diagonal(translation, rotation)};
}

MeasuredObject as_it_is(const SceneObject& object, double translation = 0.01, double rotation = 0.05) {
  return {.name = object.name, .X_WB = pose_of(object), .covariance = diagonal(translation, rotation)};
}

TEST(NearestState, WhatIsFeasibleStays) {
  const Scene scene = scene_of({box("a", 0, 0, 0.3), can("b", 0.1, 0), box("c", -0.1, 0)});
  std::vector<MeasuredObject> measured;
  for (const SceneObject& object : scene.objects) measured.push_back(as_it_is(object));

  const auto result = nearest_state(scene, measured);

  ASSERT_TRUE(result) << result.error().message;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const PlacedObject& object = result->at(i);
    EXPECT_EQ(object.name, measured[i].name);
    EXPECT_TRUE(object.stands);
    EXPECT_NEAR(object.moved, 0.0, 1e-12);
    EXPECT_LT((Vector3d(object.X_WB.position.data()) - Vector3d(measured[i].X_WB.position.data())).norm(), 1e-12);
    EXPECT_LT(angle_between(object.X_WB.orientation.data(), measured[i].X_WB.orientation.data()), 1e-6);
  }
}

// Two cans 10 mm inside each other along x: closed form of the weighted least squares.
TEST(NearestState, OverlapIsSharedAsTheCovariancesSay) {
  const Scene scene = scene_of({can("a", 0, 0), can("b", 0.05, 0)});
  const double sure = 0.005, unsure = 0.01;
  const NearestOptions options{.slack = 0.0, .turning_slack = 0.001};

  const auto result =
      nearest_state(scene, std::vector{as_it_is(scene.objects[0], sure), as_it_is(scene.objects[1], unsure)}, options);

  ASSERT_TRUE(result) << result.error().message;
  const double total = sure * sure + unsure * unsure, apart = 0.01 + options.gap;
  EXPECT_NEAR(result->at(0).X_WB.position[0], -apart * sure * sure / total, 1e-6);
  EXPECT_NEAR(result->at(1).X_WB.position[0], 0.05 + apart * unsure * unsure / total, 1e-6);
  EXPECT_NEAR(result->at(1).moved, std::pow(apart * unsure / total, 2), 1e-3);
}

TEST(NearestState, StandingMovesWhatIsCorrelatedWithHeight) {
  const Scene scene = scene_of({can("a", 0, 0)});
  // A camera that looks along (1, 0, -1): what it knows least is how far away the can is.
  MeasuredObject measured = as_it_is(scene.objects[0], 1e-4, 0.01);
  measured.X_WB.position = {0.02, 0, 0.03};  // 2 cm too far along that way
  Eigen::Map<Eigen::Matrix<double, 6, 6>> covariance(measured.covariance.data());
  const Vector3d way(1, 0, -1);
  covariance.topLeftCorner<3, 3>() += 0.02 * 0.02 * way * way.transpose();

  const auto result = nearest_state(scene, std::vector{measured});

  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->at(0).stands);
  EXPECT_NEAR(result->at(0).X_WB.position[0], 0.0, 2e-4);
  EXPECT_DOUBLE_EQ(result->at(0).X_WB.position[2], 0.05);
}

TEST(NearestState, TiltThatTheCovarianceExplainsIsMadeUprightAndYawStays) {
  const Scene scene = scene_of({box("a", 0, 0, 0.7)});
  MeasuredObject measured = as_it_is(scene.objects[0], 0.01, 0.05);
  Eigen::Isometry3d X = transform(measured.X_WB);
  X.linear() = AngleAxisd(0.1, Vector3d(0.6, 0.8, 0)) * X.linear();
  measured.X_WB = jostle::pose_of(X);

  const auto result = nearest_state(scene, std::vector{measured});

  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(uprightness(result->at(0).X_WB.orientation.data()), 1.0, 1e-12);
  EXPECT_NEAR(yaw_of(result->at(0).X_WB.orientation.data()), 0.7, 0.01);
}

TEST(NearestState, WhatLeansOrIsLiftedIsLeftAsItIs) {
  const Scene scene = scene_of({box("a", 0, 0), can("b", 0.01, 0), can("c", -0.2, 0), can("d", 2, 0)});
  MeasuredObject leaning = as_it_is(scene.objects[0]), lifted = as_it_is(scene.objects[1]);
  leaning.X_WB.orientation = {std::cos(0.2), std::sin(0.2), 0, 0};
  lifted.X_WB.position[2] = 0.3;
  const std::vector measured{leaning, lifted, as_it_is(scene.objects[2]), as_it_is(scene.objects[3])};

  const auto result = nearest_state(scene, measured);

  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->at(0).stands);
  EXPECT_EQ(result->at(0).X_WB, leaning.X_WB);
  EXPECT_FALSE(result->at(1).stands);
  EXPECT_EQ(result->at(1).X_WB, lifted.X_WB);
  EXPECT_TRUE(result->at(2).stands);
  EXPECT_FALSE(result->at(3).stands) << "beyond the surface";
}

TEST(NearestState, WhatLiesOnItsSideIsKeptApartAsItLies) {
  const Scene scene = scene_of({can("lying", 0, 0), can("standing", 0.075, 0)});
  MeasuredObject lying = as_it_is(scene.objects[0]);
  lying.X_WB = {.position = {0, 0, 0.032}, .orientation = {std::sqrt(0.5), 0, std::sqrt(0.5), 0}};  // axis along x

  const auto result = nearest_state(scene, std::vector{lying, as_it_is(scene.objects[1])});

  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->at(0).stands);
  EXPECT_DOUBLE_EQ(result->at(0).X_WB.position[2], 0.03);
  // Half its length of 0.1 m and a radius of 0.03 m.
  EXPECT_NEAR(result->at(1).X_WB.position[0] - result->at(0).X_WB.position[0], 0.08, 1e-4);
}

TEST(NearestState, FixturesDoNotYield) {
  Scene scene = scene_of({can("a", 0, 0)});
  scene.fixtures.push_back({.name = "wall", .size = {0.02, 0.4, 0.2}, .pose = {.position = {0.035, 0, 0.1}}});
  scene.fixtures.push_back({.name = "board", .size = {0.4, 0.4, 0.02}, .pose = {.position = {0, 0, 0.3}}});

  const auto result = nearest_state(scene, std::vector{as_it_is(scene.objects[0])});

  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(result->at(0).X_WB.position[0], -0.005, 1e-4);
}

TEST(NearestState, WhatCannotBeIsAnErrorThatNamesTheObjects) {
  const Scene scene = scene_of({can("a", 0, 0), can("b", 0.02, 0), can("far", 0.2, 0)});
  std::vector<MeasuredObject> measured;
  for (const SceneObject& object : scene.objects) measured.push_back(as_it_is(object, 0.002));

  const auto result = nearest_state(scene, measured);

  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, AllOf(HasSubstr("'a', 'b'"), Not(HasSubstr("far"))));
}

TEST(NearestState, WhatIsNoMeasurementIsRefused) {
  const Scene scene = scene_of({can("a", 0, 0)});
  const auto complaint = [&](const MeasuredObject& measured) {
    const auto result = nearest_state(scene, std::vector{measured});
    return result ? std::string("nothing") : result.error().message;
  };
  auto measured = as_it_is(scene.objects[0]);
  measured.name = "b";
  EXPECT_THAT(complaint(measured), HasSubstr("objects: got 'b', wanted one of scene 'test'"));
  measured = as_it_is(scene.objects[0]);
  measured.X_WB.position[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(complaint(measured), HasSubstr("pose of 'a'"));
  measured = as_it_is(scene.objects[0]);
  measured.X_WB.orientation = {0, 0, 0, 0};
  EXPECT_THAT(complaint(measured), HasSubstr("pose of 'a'"));
  measured = as_it_is(scene.objects[0]);
  measured.covariance[7] = -1;
  EXPECT_THAT(complaint(measured), HasSubstr("covariance of 'a'"));
}

// Crowds whose objects nearly touch, seen with noise that makes them overlap.
TEST(NearestState, RandomCrowdsNeverOverlapAndNobodyIsMovedByMoreThanItsCovarianceExplains) {
  constexpr int kScenes = 10'000, kObjects = 10;
  constexpr double kNoise[] = {0.005, 0.01, 0.015};  // m
  std::mt19937_64 random(14);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int impossible = 0, overlapping = 0, objects = 0, standing = 0;
  double moved_worse = 0.0, sum_before = 0.0, sum_after = 0.0;
  for (int i = 0; i < kScenes; ++i) {
    Scene scene = scene_of({});
    for (int tries = 0; static_cast<int>(scene.objects.size()) < kObjects && tries < 1000; ++tries) {
      const std::string name(1, static_cast<char>('a' + scene.objects.size()));
      SceneObject object = uniform(random) < 0 ? can(name, 0, 0) : box(name, 0, 0, M_PI * uniform(random));
      object.x = 0.11 * uniform(random), object.y = 0.11 * uniform(random);
      if (std::ranges::none_of(scene.objects, [&](const SceneObject& other) { return overlap(object, other, 1e-3); }))
        scene.objects.push_back(object);
    }
    std::vector<MeasuredObject> measured;
    const double noise = kNoise[i % 3];
    for (const SceneObject& object : scene.objects) measured.push_back(seen(object, noise, 4 * noise, random));
    const auto result = nearest_state(scene, measured);
    if (!result) {
      ++impossible;
      continue;
    }
    std::vector<SceneObject> placed = scene.objects;
    for (std::size_t j = 0; j < placed.size(); ++j) {
      const PlacedObject& object = result->at(j);
      const auto& [p, q] = object.X_WB;
      sum_before += std::hypot(measured[j].X_WB.position[0] - placed[j].x, measured[j].X_WB.position[1] - placed[j].y);
      sum_after += std::hypot(p[0] - placed[j].x, p[1] - placed[j].y);
      // By its definition, not as it was calculated.
      const Eigen::Isometry3d X = transform(measured[j].X_WB), Y = transform(object.X_WB);
      const AngleAxisd turn(Y.linear() * X.linear().transpose());
      const double distance = (Y.translation() - X.translation()).squaredNorm() / (noise * noise + 1e-6) +
                              std::pow(turn.angle(), 2) / (16 * noise * noise + 1e-4);
      moved_worse = std::max(moved_worse, distance);
      ++objects;
      if (!object.stands) continue;
      ++standing;
      EXPECT_NEAR(p[2], placed[j].rest_height(), 1e-12);
      placed[j].x = p[0], placed[j].y = p[1], placed[j].yaw = yaw_of(q.data());
      for (std::size_t k = 0; k < j; ++k) overlapping += result->at(k).stands && overlap(placed[j], placed[k]);
    }
  }
  EXPECT_EQ(overlapping, 0);
  EXPECT_GT(standing, objects * 999 / 1000);
  EXPECT_LT(moved_worse, 1.1 * NearestOptions().most);  // rotations are added as vectors there
  EXPECT_EQ(impossible, 0);
  EXPECT_LT(sum_after, sum_before);
}

}  // namespace
}  // namespace jostle::physics_pool
