#include "perception/tags/calibration.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "idl/types/transform.hpp"

namespace jostle::perception {
namespace {

constexpr std::size_t kFewestViews = 8, kFewestTags = 4;
constexpr double kLeastTurn = 25.0;  // degrees between the boards of two views
constexpr double kLeastShare = 0.6;  // of the image's width and height that corners must span
constexpr double kDegrees = 180 / M_PI;

Result<void> check_views(int width, int height, std::span<const std::vector<TagView>> views) {
  const auto usable = std::ranges::count_if(views, [](const auto& view) { return view.size() >= kFewestTags; });
  if (static_cast<std::size_t>(usable) < kFewestViews)
    return invalid("views", fmt::format("{} of {} with {} tags or more", usable, views.size(), kFewestTags),
                   fmt::format("at least {}: take more pictures of the whole sheet", kFewestViews));
  double left = width, right = 0, top = height, bottom = 0;
  for (const auto& view : views) {
    for (const TagView& tag : view) {
      for (const Pixel& corner : tag.corners) {
        left = std::min(left, corner.x), right = std::max(right, corner.x);
        top = std::min(top, corner.y), bottom = std::max(bottom, corner.y);
      }
    }
  }
  const double across = (right - left) / width, down = (bottom - top) / height;
  if (across >= kLeastShare && down >= kLeastShare) return {};
  return invalid("views",
                 fmt::format("tags in {:.0f} % of the width and {:.0f} % of the height", 100 * across, 100 * down),
                 fmt::format("{:.0f} % of both: move the sheet towards the image's borders, too", 100 * kLeastShare));
}

Result<void> check_tilts(std::span<const Pose> poses) {
  double most = 0.0;
  for (const Pose& a : poses) {
    for (const Pose& b : poses) {
      const Eigen::Vector3d z_a = transform(a).linear().col(2), z_b = transform(b).linear().col(2);
      most = std::max(most, kDegrees * std::acos(std::clamp(z_a.dot(z_b), -1.0, 1.0)));
    }
  }
  if (most >= kLeastTurn) return {};
  return invalid("views", fmt::format("sheets that are tilted alike, by up to {:.0f} degrees", most),
                 fmt::format("{:.0f} degrees between some two: tilt it left, right, up and down", kLeastTurn));
}

Pose pose_from(const cv::Mat& turn, const cv::Mat& way) {
  const Eigen::Vector3d w(turn.at<double>(0), turn.at<double>(1), turn.at<double>(2));
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = Eigen::Vector3d(way.at<double>(0), way.at<double>(1), way.at<double>(2));
  if (const double angle = w.norm(); angle > 0) X.rotate(Eigen::AngleAxisd(angle, w / angle));
  return pose_of(X);
}

}  // namespace

std::vector<TagView> on_board(std::span<const Detection> seen, const Page& board) {
  std::vector<TagView> views;
  for (const Detection& detection : seen) {
    const auto placed =
        std::ranges::find(board, detection.id, [](const PlacedTag& candidate) { return candidate.tag.id; });
    if (placed == board.end()) continue;
    const double half = placed->tag.size * kTagCells / kTagBorderCells / 2;
    views.push_back({.corners = detection.corners,
                     .size = placed->tag.size,
                     .X_BT = {.position = {placed->x + half, placed->y + half, 0}}});
  }
  return views;
}

Result<Calibration> calibrate(int width, int height, std::span<const std::vector<TagView>> views) {
  if (auto ok = check_views(width, height, views); !ok) return ok.error();
  std::vector<std::vector<cv::Point3f>> places;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const auto& view : views) {
    if (view.size() < kFewestTags) continue;
    places.emplace_back(), pixels.emplace_back();
    for (const TagView& tag : view) {
      const auto corners = tag_corners(tag.size);
      for (std::size_t i = 0; i < 4; ++i) {
        places.back().emplace_back(static_cast<float>(tag.X_BT.position[0] + corners[i][0]),
                                   static_cast<float>(tag.X_BT.position[1] + corners[i][1]), 0.0f);
        pixels.back().emplace_back(static_cast<float>(tag.corners[i].x), static_cast<float>(tag.corners[i].y));
      }
    }
  }
  cv::Mat k, d;
  std::vector<cv::Mat> turns, ways;
  Calibration result;
  try {
    result.error_px = cv::calibrateCamera(places, pixels, {width, height}, k, d, turns, ways, cv::CALIB_FIX_K3);
  } catch (const cv::Exception& error) {
    return Error{Code::kInvalidArgument, fmt::format("views: no camera explains them: {}", error.err)};
  }
  for (std::size_t i = 0; i < turns.size(); ++i) result.X_CB.push_back(pose_from(turns[i], ways[i]));
  if (auto ok = check_tilts(result.X_CB); !ok) return ok.error();
  result.camera = {.width = width,
                   .height = height,
                   .fx = k.at<double>(0, 0),
                   .fy = k.at<double>(1, 1),
                   .cx = k.at<double>(0, 2),
                   .cy = k.at<double>(1, 2)};
  for (int i = 0; i < 5; ++i) result.camera.distortion.at(static_cast<std::size_t>(i)) = d.at<double>(i);
  return result;
}

}  // namespace jostle::perception
