#include "perception/tags/pose.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <vector>

#include "idl/types/transform.hpp"

namespace jostle::perception {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kSamePose = 0.02;  // rad; minima that are nearer are one

// A point of the body, and where it was seen.
struct Sight {
  Vector3d p_B;
  Pixel pixel;
};

// Sums over all corners at one pose.
struct Normal {
  double cost = 0.0;                     // pixels^2
  Matrix6d hessian = Matrix6d::Zero();   // J^T J
  Vector6d gradient = Vector6d::Zero();  // J^T residual
};

Matrix3d cross(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Nothing when a corner would be behind the camera.
std::optional<Normal> normal_equations(const Camera& camera, const std::vector<Sight>& sights, const Isometry3d& X_CB) {
  Normal sum;
  for (const Sight& sight : sights) {
    const Vector3d arm = X_CB.linear() * sight.p_B;
    const Vector3d p_C = arm + X_CB.translation();
    if (p_C.z() <= 1e-6) return std::nullopt;
    const Projection projection = project(camera, {p_C.x(), p_C.y(), p_C.z()});
    const Eigen::Vector2d residual(projection.pixel.x - sight.pixel.x, projection.pixel.y - sight.pixel.y);
    Eigen::Matrix<double, 2, 3> slope;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 3; ++j)
        slope(i, j) = projection.slope.at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(j));
    }
    Eigen::Matrix<double, 2, 6> J;
    J << slope, -slope * cross(arm);
    sum.cost += residual.squaredNorm();
    sum.hessian += J.transpose() * J;
    sum.gradient += J.transpose() * residual;
  }
  return sum;
}

Isometry3d moved(const Isometry3d& X_CB, const Vector6d& step) {
  Isometry3d result = X_CB;
  const Vector3d turn = step.tail<3>();
  if (const double angle = turn.norm(); angle > 0)
    result.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() * X_CB.linear();
  result.translation() += step.head<3>();
  return result;
}

struct Minimum {
  Isometry3d X_CB;
  Normal normal;
};

// Levenberg-Marquardt: damped until a step lowers the cost.
std::optional<Minimum> descend(const Camera& camera, const std::vector<Sight>& sights, const Isometry3d& start) {
  constexpr int kMostSteps = 50;
  constexpr double kStill = 1e-12;  // of m^2 + rad^2
  auto normal = normal_equations(camera, sights, start);
  if (!normal) return std::nullopt;
  Minimum at{start, *normal};
  double damping = 1e-6;
  for (int i = 0; i < kMostSteps && damping < 1e6; ++i) {
    Matrix6d damped = at.normal.hessian;
    damped.diagonal() *= 1 + damping;
    const Vector6d step = -damped.ldlt().solve(at.normal.gradient);
    if (!step.allFinite()) break;
    const Isometry3d next = moved(at.X_CB, step);
    if (auto there = normal_equations(camera, sights, next); there && there->cost <= at.normal.cost) {
      at = {next, *there};
      damping /= 10;
      if (step.squaredNorm() < kStill) break;
    } else {
      damping *= 10;
    }
  }
  return at;
}

// X_CT of a single tag, both solutions. OpenCV's square lies with y up and z out of it.
std::vector<Isometry3d> ippe(const Camera& camera, const TagView& tag) {
  std::vector<cv::Point3d> square;
  std::vector<cv::Point2d> seen;
  for (const auto& [x, y, z] : tag_corners(tag.size)) square.emplace_back(x, -y, z);
  for (const Pixel& corner : tag.corners) {
    const auto [x, y] = ray(camera, corner);
    seen.emplace_back(x, y);
  }
  std::vector<cv::Mat> turns, ways;
  cv::solvePnPGeneric(square, seen, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turns, ways, false,
                      cv::SOLVEPNP_IPPE_SQUARE);
  std::vector<Isometry3d> poses;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const Vector3d turn(turns[i].at<double>(0), turns[i].at<double>(1), turns[i].at<double>(2));
    Isometry3d X = Isometry3d::Identity();
    X.translation() = Vector3d(ways[i].at<double>(0), ways[i].at<double>(1), ways[i].at<double>(2));
    if (const double angle = turn.norm(); angle > 0) X.rotate(Eigen::AngleAxisd(angle, turn / angle));
    X.rotate(Eigen::AngleAxisd(M_PI, Vector3d::UnitX()));
    if (X.matrix().allFinite()) poses.push_back(X);
  }
  return poses;
}

Result<void> check(std::span<const TagView> tags) {
  if (tags.empty()) return invalid("tags", "none", "at least one");
  for (const TagView& tag : tags) {
    if (!(tag.size > 0) || !std::isfinite(tag.size)) return invalid("tag size", fmt::format("{}", tag.size), "> 0, m");
    double area = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      const Pixel& a = tag.corners[i];
      const Pixel& b = tag.corners[(i + 1) % 4];
      area += (a.x * b.y - b.x * a.y) / 2;
    }
    // Seen from behind, its corners go round the other way.
    if (!(area > 1e-6) || !std::isfinite(area))
      return invalid("tag corners", fmt::format("a quadrilateral of {} square pixels", area), "more than 0, clockwise");
  }
  return {};
}

double rotation_between(const Isometry3d& a, const Isometry3d& b) {
  return std::abs(Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle());
}

Fit fit_of(const Minimum& minimum, std::size_t corners) {
  return {.X_CB = pose_of(minimum.X_CB), .error_px = std::sqrt(minimum.normal.cost / static_cast<double>(corners))};
}

}  // namespace

double surprise_of(const Fit& fit, const PoseEstimate& estimate) {
  constexpr double kCorners = 4;
  const double sigma = std::max(kCornerSigma, estimate.best.error_px);
  return kCorners * (std::pow(fit.error_px, 2) - std::pow(estimate.best.error_px, 2)) / (sigma * sigma);
}

std::array<std::array<double, 3>, 4> tag_corners(double size) {
  const double half = size / 2;
  return {{{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}}};
}

Result<PoseEstimate> estimate_pose(const Camera& camera, std::span<const TagView> tags, double corner_sigma) {
  if (auto ok = check(tags); !ok) return ok.error();
  std::vector<Sight> sights;
  for (const TagView& tag : tags) {
    const auto corners = tag_corners(tag.size);
    for (std::size_t i = 0; i < 4; ++i)
      sights.push_back({transform(tag.X_BT) * Vector3d(corners[i].data()), tag.corners[i]});
  }
  std::vector<Minimum> minima;
  for (const TagView& tag : tags) {
    for (const Isometry3d& X_CT : ippe(camera, tag)) {
      if (auto minimum = descend(camera, sights, X_CT * transform(tag.X_BT).inverse())) minima.push_back(*minimum);
    }
  }
  if (minima.empty()) return invalid("tag corners", "corners that no pose explains", "those of a square");
  std::ranges::sort(minima, {}, [](const Minimum& minimum) { return minimum.normal.cost; });
  const Minimum& best = minima.front();
  PoseEstimate estimate{.best = fit_of(best, sights.size())};
  const auto other = std::ranges::find_if(
      minima, [&](const Minimum& minimum) { return rotation_between(best.X_CB, minimum.X_CB) > kSamePose; });
  if (other != minima.end()) estimate.other = fit_of(*other, sights.size());
  const Matrix6d covariance = corner_sigma * corner_sigma * best.normal.hessian.ldlt().solve(Matrix6d::Identity());
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(estimate.covariance.data()) = covariance;
  return estimate;
}

}  // namespace jostle::perception
