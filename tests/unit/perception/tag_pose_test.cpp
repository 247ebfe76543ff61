#include "perception/tags/pose.hpp"

#include <gmock/gmock.h>

#include <random>

#include "tests/support/tag_views.hpp"

namespace jostle::perception {
namespace {

using namespace tests;
using Eigen::Vector3d;
using testing::HasSubstr;

constexpr double kSize = 0.05;  // m

Pose some_pose(std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  return tilted({0.2 * uniform(random), 0.1 * uniform(random), 0.8 + 0.2 * uniform(random)},
                0.6 + 0.3 * uniform(random), M_PI * uniform(random), M_PI * uniform(random));
}

TEST(TagPose, PerfectCornersGiveTheExactPoseThroughADistortingLens) {
  const Camera camera = distorting_camera();
  std::mt19937_64 random(1);
  for (int i = 0; i < 50; ++i) {
    const Pose truth = some_pose(random);
    const TagView view{.corners = perfect_corners(camera, truth, kSize), .size = kSize};
    const auto estimate = estimate_pose(camera, {&view, 1});
    ASSERT_TRUE(estimate) << estimate.error().message;
    EXPECT_LT(estimate->best.error_px, 1e-6);
    EXPECT_LT(distance_between(estimate->best.X_CB, truth), 1e-7);
    EXPECT_LT(rotation_between(estimate->best.X_CB, truth), 1e-6);
  }
}

TEST(TagPose, TheOtherMinimumIsTiltedTheOtherWayAndFitsLessWell) {
  const Camera camera = distorting_camera();
  const Pose truth = tilted({0, 0, 1.0}, 0.5, 0.0, 0.0);
  const TagView view{.corners = perfect_corners(camera, truth, kSize), .size = kSize};
  const auto estimate = estimate_pose(camera, {&view, 1});
  ASSERT_TRUE(estimate && estimate->other);
  EXPECT_NEAR(rotation_between(estimate->other->X_CB, truth), 1.0, 0.1);
  EXPECT_GT(estimate->other->error_px, estimate->best.error_px + 0.05);
}

// Chi-squared of 6 degrees: what is drawn with the covariance's own sigma must be in its ellipsoids.
// -2 log of the ratio of likelihoods of four corners; noise is never taken for less than it is in rendered images.
TEST(TagPose, SurpriseIsThatOfTheCorners) {
  PoseEstimate estimate;
  estimate.best.error_px = 0.0;
  EXPECT_EQ(surprise_of(estimate.best, estimate), 0.0);
  EXPECT_NEAR(surprise_of({.X_CB = {}, .error_px = 2 * kCornerSigma}, estimate), 4 * 4.0, 1e-9);
  estimate.best.error_px = 0.5;
  EXPECT_NEAR(surprise_of({.X_CB = {}, .error_px = 1.0}, estimate), 4 * (1.0 - 0.25) / 0.25, 1e-9);
}

TEST(TagPose, CovarianceIsThatOfNoisyCorners) {
  const Camera camera = distorting_camera();
  std::mt19937_64 random(3);
  constexpr double kSigma = 0.05;
  constexpr int kDraws = 2000;
  constexpr double kNinetyFive = 12.592;
  std::normal_distribution<double> noise(0, kSigma);
  double mean = 0;
  int inside = 0;
  for (int i = 0; i < kDraws; ++i) {
    const Pose truth = some_pose(random);
    TagView view{.corners = perfect_corners(camera, truth, kSize), .size = kSize};
    for (Pixel& corner : view.corners) corner.x += noise(random), corner.y += noise(random);
    const auto estimate = estimate_pose(camera, {&view, 1}, kSigma);
    ASSERT_TRUE(estimate);
    const Eigen::AngleAxisd turn(transform(truth).linear() * transform(estimate->best.X_CB).linear().transpose());
    Eigen::Matrix<double, 6, 1> off;
    off << transform(truth).translation() - transform(estimate->best.X_CB).translation(), turn.angle() * turn.axis();
    const Eigen::Map<const Eigen::Matrix<double, 6, 6>> covariance(estimate->covariance.data());
    const double distance = off.dot(covariance.ldlt().solve(off));
    mean += std::min(distance, 100.0) / kDraws;
    inside += distance < kNinetyFive ? 1 : 0;
  }
  EXPECT_NEAR(inside, 0.95 * kDraws, 0.015 * kDraws);
  EXPECT_NEAR(mean, 6.0, 0.4);
}

TEST(TagPose, ABundleIsOnePnpOverAllCorners) {
  const Camera camera = distorting_camera();
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0, 0.05);
  // Two tags on neighbouring sides of a box, of different sizes.
  const Pose on_front{.position = {0, 0, -0.03}, .orientation = {1, 0, 0, 0}};
  const Pose on_side{.position = {0.03, 0, 0}, .orientation = {std::sqrt(0.5), 0, -std::sqrt(0.5), 0}};
  double alone = 0, together = 0;
  for (int i = 0; i < 200; ++i) {
    const Pose X_CB = tilted({0.05, 0.02, 0.9}, 0.7, M_PI / 2, 0);
    std::vector<TagView> views;
    for (const auto& [X_BT, size] : {std::pair(on_front, 0.04), std::pair(on_side, 0.03)}) {
      const Pose X_CT = pose_of(transform(X_CB) * transform(X_BT));
      views.push_back({.corners = perfect_corners(camera, X_CT, size), .size = size, .X_BT = X_BT});
      for (Pixel& corner : views.back().corners) corner.x += noise(random), corner.y += noise(random);
    }
    const auto one = estimate_pose(camera, std::span(views).first(1));
    const auto both = estimate_pose(camera, views);
    ASSERT_TRUE(one && both) << both.error().message;
    alone += rotation_between(one->best.X_CB, X_CB);
    together += rotation_between(both->best.X_CB, X_CB);
    EXPECT_LT(distance_between(both->best.X_CB, X_CB), 0.005);
  }
  EXPECT_LT(together, 0.7 * alone);
}

TEST(TagPose, SaysWhatIsNoTag) {
  const Camera camera = distorting_camera();
  const auto complaint = [&](const TagView& view) {
    const auto result = estimate_pose(camera, {&view, 1});
    return result ? std::string("nothing") : result.error().message;
  };
  TagView view{.corners = perfect_corners(camera, tilted({0, 0, 1}, 0, 0, 0), kSize), .size = kSize};
  EXPECT_EQ(complaint(view), "nothing");
  view.size = 0;
  EXPECT_THAT(complaint(view), HasSubstr("tag size"));
  view.size = kSize;
  std::swap(view.corners[1], view.corners[3]);
  EXPECT_THAT(complaint(view), HasSubstr("tag corners"));
  EXPECT_FALSE(estimate_pose(camera, {}));
}

}  // namespace
}  // namespace jostle::perception
