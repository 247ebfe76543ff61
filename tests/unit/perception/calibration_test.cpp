// Intrinsics from rendered views of a printed sheet, against the camera that rendered them.

#include "perception/tags/calibration.hpp"

#include <gmock/gmock.h>

#include "tests/support/tag_views.hpp"

namespace jostle::perception {
namespace {

using namespace tests;
using testing::HasSubstr;

// X_CB of a sheet whose middle is at (x, y, z), tilted about an axis in its plane.
Pose sheet_at(double x, double y, double z, double tilt, double about) {
  const Pose middle{.position = {-0.095, -0.125, 0}};
  return pose_of(transform(tilted({x, y, z}, tilt, about, 0.1)) * transform(middle));
}

std::vector<Pose> good_poses() {
  std::vector<Pose> poses;
  for (int i = 0; i < 24; ++i)
    poses.push_back(
        sheet_at(0.16 * (i % 3 - 1), 0.05 * (i % 2 == 0 ? 1 : -1), 0.42 + 0.02 * (i % 4), 0.55, 2 * M_PI * i / 24));
  return poses;
}

std::vector<std::vector<TagView>> views_of(const std::vector<Pose>& poses) {
  const Camera camera = distorting_camera();
  const SceneCamera eye(camera);
  Detector detector;
  const Page board = sheet();
  std::vector<std::vector<TagView>> views;
  for (const Pose& X_CB : poses) {
    views.push_back(on_board(detector.detect(eye.render(view_of_sheet(X_CB), views.size())), board));
  }
  return views;
}

TEST(Calibration, RenderedSheetsGiveTheCameraThatRenderedThem) {
  const Camera truth = distorting_camera();
  const auto poses = good_poses();
  const auto result = calibrate(truth.width, truth.height, views_of(poses));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(result->camera.fx, truth.fx, 0.002 * truth.fx);
  EXPECT_NEAR(result->camera.fy, truth.fy, 0.002 * truth.fy);
  EXPECT_NEAR(result->camera.cx, truth.cx, 0.002 * truth.width);
  EXPECT_NEAR(result->camera.cy, truth.cy, 0.002 * truth.width);
  EXPECT_NEAR(result->camera.distortion[0], truth.distortion[0], 0.02);
  EXPECT_LT(result->error_px, 0.2);
  EXPECT_LT(std::abs(result->camera.fx - truth.fx), 3 * result->focal_sigma);
  ASSERT_EQ(result->X_CB.size(), poses.size());
  // The sheet's pose in one picture is a by-product; where a camera is, locate_camera() finds.
  double squares = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_LT(distance_between(result->X_CB[i], poses[i]), 0.001);
    const double turn = rotation_between(result->X_CB[i], poses[i]);
    squares += turn * turn / static_cast<double>(poses.size());
  }
  EXPECT_LT(std::sqrt(squares), 0.1 * M_PI / 180);
}

TEST(Calibration, TooFewOrTooSimilarViewsAreRefused) {
  const Camera truth = distorting_camera();
  const auto complaint = [&](const std::vector<std::vector<TagView>>& views) {
    const auto result = calibrate(truth.width, truth.height, views);
    return result ? std::string("nothing") : result.error().message;
  };
  const auto perfect = [&](const std::vector<Pose>& poses) {
    std::vector<std::vector<TagView>> views;
    for (const Pose& X_CB : poses) {
      views.emplace_back();
      for (const PlacedTag& placed : sheet()) {
        const double half = placed.tag.size * kTagCells / kTagBorderCells / 2;
        const Pose X_BT{.position = {placed.x + half, placed.y + half, 0}};
        const Pose X_CT = pose_of(transform(X_CB) * transform(X_BT));
        views.back().push_back({perfect_corners(truth, X_CT, placed.tag.size), placed.tag.size, X_BT});
      }
    }
    return views;
  };
  auto poses = good_poses();
  EXPECT_EQ(complaint(perfect(poses)), "nothing");
  poses.resize(9);
  EXPECT_THAT(complaint(perfect(poses)), HasSubstr("got 9 of 9 with 4 tags or more, wanted at least 10"));
  poses.clear();
  for (int i = 0; i < 10; ++i) poses.push_back(sheet_at(0, 0, 0.9, 0.5, i));
  EXPECT_THAT(complaint(perfect(poses)), HasSubstr("towards the image's borders"));
  poses.clear();
  for (int i = 0; i < 10; ++i)
    poses.push_back(sheet_at(0.16 * (i % 3 - 1), 0.06 * (i % 2 == 0 ? 1 : -1), 0.45, 0.1, i));
  EXPECT_THAT(complaint(perfect(poses)), HasSubstr("tilted alike"));
}

// Four sheets flat on a table, below a camera that looks down at a slant.
std::vector<TagView> tags_on_table(const Pose& X_WC, double size, int count, std::uint64_t seed) {
  const Camera camera = distorting_camera();
  View view{.X_WC = X_WC};
  for (int i = 0; i < count; ++i) {
    Eigen::Isometry3d X_WT = Eigen::Isometry3d::Identity();
    X_WT.translation() = Eigen::Vector3d(0.25 * (i % 3 - 1), 0.15 * (i / 3 - 1), 0);
    X_WT.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
    view.stickers.push_back({i, size, pose_of(X_WT)});
  }
  Detector detector;
  std::vector<TagView> tags;
  for (const Detection& seen : detector.detect(SceneCamera(camera).render(view, seed)))
    tags.push_back({seen.corners, size, view.stickers[static_cast<std::size_t>(seen.id)].X_WT});
  return tags;
}

TEST(Extrinsics, RenderedTagsAtKnownPlacesSayWhereTheCameraIs) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const Pose X_WC = looking_at({0.2 - 0.1 * static_cast<double>(seed), -0.4, 0.8}, {0, 0, 0});
    const auto result = locate_camera(distorting_camera(), tags_on_table(X_WC, 0.1, 9, seed));
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LT(distance_between(result->X_WC, X_WC), 0.001);
    EXPECT_LT(rotation_between(result->X_WC, X_WC), 0.1 * M_PI / 180);
    EXPECT_LT(distance_between(result->X_WC, X_WC), 4 * result->position_sigma);
  }
}

TEST(Extrinsics, WhatDoesNotSayEnoughIsRefused) {
  const Pose X_WC = looking_at({0, -0.4, 0.8}, {0, 0, 0});
  const auto complaint = [&](const std::vector<TagView>& tags) {
    const auto result = locate_camera(distorting_camera(), tags);
    return result ? std::string("nothing") : result.error().message;
  };
  EXPECT_THAT(complaint(tags_on_table(X_WC, 0.1, 3, 1)), HasSubstr("tags: got 3 at known places, wanted at least 4"));
  EXPECT_THAT(complaint(tags_on_table(X_WC, 0.02, 4, 1)), HasSubstr("use more tags, larger ones"));
  auto tags = tags_on_table(X_WC, 0.1, 9, 1);
  tags[4].X_BT.position[0] += 0.03;
  EXPECT_THAT(complaint(tags), HasSubstr("measure the places again"));
}

// Twelve poses from which a camera sees the sheet's middle, turned about its axis, too.
std::vector<Pose> places_to_look_from() {
  std::vector<Pose> places;
  for (int i = 0; i < 12; ++i) {
    const double about = 2 * M_PI * i / 12;
    const Eigen::Isometry3d X = transform(
        looking_at({0.1 + 0.35 * std::cos(about), -0.12 + 0.35 * std::sin(about), 0.4 + 0.01 * i}, {0.1, -0.12, 0}));
    places.push_back(pose_of(X * Eigen::AngleAxisd(0.6 * (i % 3 - 1), Eigen::Vector3d::UnitZ())));
  }
  return places;
}

constexpr Pose kCameraOnFlange{.position = {0.03, -0.05, 0.08},
                               .orientation = {0.9659258262890683, 0, 0, 0.25881904510252074}};

// The sheet lies on the table, and a camera on the flange looks at it; or, seen from the camera, the other way round.
std::vector<HandEyeView> hand_eye_views(Mounted mounted) {
  const Eigen::Isometry3d X_WB(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
  std::vector<Pose> X_CB, X_WF;
  for (const Pose& X_WC : places_to_look_from()) {
    X_CB.push_back(pose_of(transform(X_WC).inverse() * X_WB));
    // kSheet: the camera stands where kCameraOnFlange says, in W, and the sheet's page is the flange.
    X_WF.push_back(mounted == Mounted::kCamera ? pose_of(transform(X_WC) * transform(kCameraOnFlange).inverse())
                                               : pose_of(transform(kCameraOnFlange) * transform(X_CB.back())));
  }
  const auto tags = views_of(X_CB);
  std::vector<HandEyeView> views;
  for (std::size_t i = 0; i < tags.size(); ++i) views.push_back({X_WF[i], tags[i]});
  return views;
}

TEST(HandEye, RenderedViewsSayWhereTheCameraIsOnTheArmAndBesideIt) {
  for (const Mounted mounted : {Mounted::kCamera, Mounted::kSheet}) {
    const auto result = calibrate_hand_eye(distorting_camera(), hand_eye_views(mounted), mounted);
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LT(distance_between(result->X_camera, kCameraOnFlange), 0.001);
    EXPECT_LT(rotation_between(result->X_camera, kCameraOnFlange), 0.1 * M_PI / 180);
    EXPECT_LT(result->position_error, 0.001);
  }
}

TEST(HandEye, WhatDoesNotSayEnoughIsRefused) {
  const auto complaint = [](const std::vector<HandEyeView>& views) {
    const auto result = calibrate_hand_eye(distorting_camera(), views, Mounted::kCamera);
    return result ? std::string("nothing") : result.error().message;
  };
  const auto good = hand_eye_views(Mounted::kCamera);
  EXPECT_THAT(complaint({good.begin(), good.begin() + 5}),
              HasSubstr("got 5 of 5 with 4 tags or more, wanted at least 6"));
  EXPECT_THAT(complaint(std::vector<HandEyeView>(6, good[0])), HasSubstr("turn the wrist left and right"));
  auto mixed_up = good;
  std::swap(mixed_up[1].X_WF, mixed_up[7].X_WF);
  EXPECT_THAT(complaint(mixed_up), HasSubstr("is each pose that of its picture"));
}

}  // namespace
}  // namespace jostle::perception
