#include "perception/tags/calibration.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "idl/types/transform.hpp"

namespace jostle::perception {
namespace {

constexpr std::size_t kFewestViews = 10, kFewestTags = 4;
constexpr double kLeastTurn = 25.0;    // degrees between the boards of two views
constexpr double kLeastShare = 0.6;    // of the image's width and height that corners must span
constexpr double kMostSpread = 0.002;  // of the focal length, two standard deviations
constexpr double kMostError = 2.0;     // pixels
constexpr double kMostPosition = 0.001, kMostRotation = 0.1 * M_PI / 180;  // m, rad, two standard deviations
constexpr std::size_t kFewestFlanges = 6;
constexpr double kLeastFlangeTurn = 20.0;                                  // degrees, about each of two axes
constexpr double kMostMisfit = 0.005, kMostMisfitTurn = 1.0 * M_PI / 180;  // m, rad
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

Result<void> check_spread(const Calibration& calibration) {
  const double allowed = kMostSpread / 2 * calibration.camera.fx;
  if (calibration.focal_sigma <= allowed && calibration.centre_sigma <= allowed) return {};
  return invalid("views",
                 fmt::format("a focal length of {:.1f} +- {:.2f} and a centre +- {:.2f} pixels", calibration.camera.fx,
                             2 * calibration.focal_sigma, 2 * calibration.centre_sigma),
                 fmt::format("+- {:.2f}: take more pictures, nearer, and more tilted", 2 * allowed));
}

// By how much the flange turned about the axis about which it turned second most, degrees.
double second_turn(std::span<const Eigen::Isometry3d> flanges) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  double most = 0.0;
  for (const Eigen::Isometry3d& a : flanges) {
    for (const Eigen::Isometry3d& b : flanges) {
      const Eigen::AngleAxisd turn(a.linear().transpose() * b.linear());
      most = std::max(most, turn.angle());
      const Eigen::Vector3d w = turn.angle() * turn.axis();
      spread += w * w.transpose();
    }
  }
  const Eigen::Vector3d shares = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues();
  return kDegrees * most * std::sqrt(std::max(shares(1), 0.0) / std::max(shares(2), 1e-12));
}

Eigen::Isometry3d isometry(const cv::Mat& R, const cv::Mat& p) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i) {
    X.translation()(i) = p.at<double>(i);
    for (int j = 0; j < 3; ++j) X.linear()(i, j) = R.at<double>(i, j);
  }
  X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
  return X;
}

void add(const Eigen::Isometry3d& X, std::vector<cv::Mat>& turns, std::vector<cv::Mat>& ways) {
  cv::Mat R(3, 3, CV_64F), p(3, 1, CV_64F);
  for (int i = 0; i < 3; ++i) {
    p.at<double>(i) = X.translation()(i);
    for (int j = 0; j < 3; ++j) R.at<double>(i, j) = X.linear()(i, j);
  }
  turns.push_back(R);
  ways.push_back(p);
}

// The pose in the middle of several that are nearly the same.
Eigen::Isometry3d middle_of(std::span<const Eigen::Isometry3d> poses) {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Matrix4d spread = Eigen::Matrix4d::Zero();
  for (const Eigen::Isometry3d& X : poses) {
    p += X.translation() / static_cast<double>(poses.size());
    const Eigen::Vector4d q = Eigen::Quaterniond(X.linear()).coeffs();
    spread += q * q.transpose();
  }
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = p;
  const Eigen::Vector4d q = Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(spread).eigenvectors().col(3);
  X.linear() = Eigen::Quaterniond(q).normalized().toRotationMatrix();
  return X;
}

// The root of a covariance's largest eigenvalue.
double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues().maxCoeff());
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
  cv::Mat k, d, spread, spread_of_poses, errors;
  std::vector<cv::Mat> turns, ways;
  Calibration result;
  try {
    result.error_px = cv::calibrateCamera(places, pixels, {width, height}, k, d, turns, ways, spread, spread_of_poses,
                                          errors, cv::CALIB_FIX_K3 | cv::CALIB_USE_LU);
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
  result.focal_sigma = std::max(spread.at<double>(0), spread.at<double>(1));
  result.centre_sigma = std::max(spread.at<double>(2), spread.at<double>(3));
  if (auto ok = check_spread(result); !ok) return ok.error();
  return result;
}

Result<Extrinsics> locate_camera(const Camera& camera, std::span<const TagView> tags) {
  if (tags.size() < kFewestTags)
    return invalid("tags", fmt::format("{} at known places", tags.size()),
                   fmt::format("at least {}: look whether they are in the light, and whole", kFewestTags));
  const auto estimate_result = estimate_pose(camera, tags);
  if (!estimate_result) return estimate_result.error();
  const Eigen::Isometry3d X_CW = transform(estimate_result->best.X_CB);
  Extrinsics result{.X_WC = pose_of(X_CW.inverse()), .error_px = estimate_result->best.error_px};
  if (result.error_px > kMostError)
    return invalid("tags", fmt::format("corners that are {:.1f} pixels from where their places say", result.error_px),
                   fmt::format("at most {:.0f}: measure the places again, and the tags' size", kMostError));
  // p_WC = -R_CW^T p_CW, moved by an error of either.
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> covariance(estimate_result->covariance.data());
  const Eigen::Vector3d p = X_CW.translation();
  Eigen::Matrix3d cross;
  cross << 0, -p.z(), p.y(), p.z(), 0, -p.x(), -p.y(), p.x(), 0;
  Eigen::Matrix<double, 3, 6> slope;
  slope << Eigen::Matrix3d::Identity(), cross;
  // Corners may be farther off than in rendered images.
  const double worse = std::max(result.error_px / (std::sqrt(2.0) * kCornerSigma), 1.0);
  result.position_sigma = worse * largest_sigma(slope * covariance * slope.transpose());
  result.rotation_sigma = worse * largest_sigma(covariance.bottomRightCorner<3, 3>());
  if (2 * result.position_sigma <= kMostPosition && 2 * result.rotation_sigma <= kMostRotation) return result;
  return invalid("tags",
                 fmt::format("a camera's place +- {:.1f} mm and +- {:.2f} degrees", 2e3 * result.position_sigma,
                             2 * kDegrees * result.rotation_sigma),
                 fmt::format("+- {:.0f} mm and {:.1f} degrees: use more tags, larger ones, and farther apart",
                             1e3 * kMostPosition, kDegrees * kMostRotation));
}

Result<HandEye> calibrate_hand_eye(const Camera& camera, std::span<const HandEyeView> views, Mounted mounted) {
  std::vector<Eigen::Isometry3d> flanges, sheets;  // X_WF; X_CB
  for (const HandEyeView& view : views) {
    if (view.tags.size() < kFewestTags) continue;
    const auto estimate_result = estimate_pose(camera, view.tags);
    if (!estimate_result) return estimate_result.error();
    flanges.push_back(transform(view.X_WF));
    sheets.push_back(transform(estimate_result->best.X_CB));
  }
  if (flanges.size() < kFewestFlanges)
    return invalid("views", fmt::format("{} of {} with {} tags or more", flanges.size(), views.size(), kFewestTags),
                   fmt::format("at least {}: take more pictures of the whole sheet", kFewestFlanges));
  if (const double turn = second_turn(flanges); turn < kLeastFlangeTurn)
    return invalid("views", fmt::format("a flange that turned by {:.0f} degrees about a second axis", turn),
                   fmt::format("{:.0f} or more: turn the wrist left and right, and up and down", kLeastFlangeTurn));
  std::vector<cv::Mat> hand_turns, hand_ways, sheet_turns, sheet_ways;
  for (std::size_t i = 0; i < flanges.size(); ++i) {
    add(mounted == Mounted::kCamera ? flanges[i] : flanges[i].inverse(), hand_turns, hand_ways);
    add(sheets[i], sheet_turns, sheet_ways);
  }
  cv::Mat R, p;
  try {
    cv::calibrateHandEye(hand_turns, hand_ways, sheet_turns, sheet_ways, R, p, cv::CALIB_HAND_EYE_PARK);
  } catch (const cv::Exception& error) {
    return Error{Code::kInvalidArgument, fmt::format("views: no place of the camera explains them: {}", error.err)};
  }
  const Eigen::Isometry3d X_camera = isometry(R, p);
  std::vector<Eigen::Isometry3d> still;  // the sheet, where it does not move
  for (std::size_t i = 0; i < flanges.size(); ++i)
    still.push_back((mounted == Mounted::kCamera ? flanges[i] : flanges[i].inverse()) * X_camera * sheets[i]);
  const Eigen::Isometry3d X_sheet = middle_of(still);
  HandEye result{.X_camera = pose_of(X_camera), .X_sheet = pose_of(X_sheet)};
  for (const Eigen::Isometry3d& X : still) {
    const double angle = Eigen::AngleAxisd(X.linear().transpose() * X_sheet.linear()).angle();
    result.position_error += (X.translation() - X_sheet.translation()).squaredNorm();
    result.rotation_error += angle * angle;
  }
  result.position_error = std::sqrt(result.position_error / static_cast<double>(still.size()));
  result.rotation_error = std::sqrt(result.rotation_error / static_cast<double>(still.size()));
  if (result.position_error <= kMostMisfit && result.rotation_error <= kMostMisfitTurn) return result;
  return invalid("views",
                 fmt::format("a sheet that moves by {:.1f} mm and {:.2f} degrees, though it should not",
                             1e3 * result.position_error, kDegrees * result.rotation_error),
                 fmt::format("at most {:.0f} mm and {:.0f} degree: is each pose that of its picture, in m and rad, and "
                             "of the flange?",
                             1e3 * kMostMisfit, kDegrees * kMostMisfitTurn));
}

}  // namespace jostle::perception
