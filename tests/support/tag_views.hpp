#pragma once
/// \file
/// Cameras and tags whose poses are known.

#include <Eigen/Geometry>
#include <map>
#include <random>
#include <vector>

#include "idl/types/transform.hpp"
#include "perception/rendering/renderer.hpp"
#include "perception/tags/detector.hpp"
#include "perception/tags/pose.hpp"
#include "perception/tags/sheet.hpp"

namespace jostle::tests {

/// 1280x720, with the distortion of a common lens.
inline perception::Camera distorting_camera() {
  return {.name = "test",
          .width = 1280,
          .height = 720,
          .fx = 905.0,
          .fy = 903.0,
          .cx = 642.3,
          .cy = 355.8,
          .distortion = {-0.12, 0.05, 0.0008, -0.0005, 0.0}};
}

inline double rotation_between(const Pose& a, const Pose& b) {
  return angle_between(a.orientation.data(), b.orientation.data());
}

inline double distance_between(const Pose& a, const Pose& b) {
  return (transform(a).translation() - transform(b).translation()).norm();
}

/// Returns X_CT of a tag at p_C that faces the camera, tilted by `tilt` rad about an axis in its plane at `about` rad,
/// after a turn in its plane by `turn` rad.
inline Pose tilted(const Eigen::Vector3d& p_C, double tilt, double about, double turn) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = p_C;
  X.rotate(Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(about), std::sin(about), 0)));
  X.rotate(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
  return pose_of(X);
}

/// Twelve tags of 45 mm on a page, as `jostle tags print` lays them out and `jostle calibrate` expects them.
inline perception::Page sheet() {
  std::vector<perception::PrintedTag> tags;
  for (int i = 0; i < 12; ++i) tags.push_back({.id = i, .size = 0.045, .label = {}});
  return perception::lay_out(tags)->front();
}

/// What a camera at the world's origin sees of that page.
inline perception::View view_of_sheet(const Pose& X_CB) {
  perception::View view;
  for (const perception::PlacedTag& placed : sheet()) {
    const double half = placed.tag.size * perception::kTagCells / perception::kTagBorderCells / 2;
    const Pose X_BT{.position = {placed.x + half, placed.y + half, 0}};
    view.stickers.push_back({placed.tag.id, placed.tag.size, pose_of(transform(X_CB) * transform(X_BT))});
  }
  return view;
}

/// Returns the places of a tag's corners in a perfect image.
inline std::array<perception::Pixel, 4> perfect_corners(const perception::Camera& camera, const Pose& X_CT,
                                                        double size) {
  std::array<perception::Pixel, 4> corners;
  const auto in_tag = perception::tag_corners(size);
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d p = transform(X_CT) * Eigen::Vector3d(in_tag[i].data());
    corners[i] = perception::project(camera, {p.x(), p.y(), p.z()}).pixel;
  }
  return corners;
}

}  // namespace jostle::tests
