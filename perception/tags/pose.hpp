#pragma once
/// \file
/// From the corners of tags to the pose of what they are on, and how sure that is.

#include <array>
#include <optional>
#include <span>

#include "idl/types/pose.hpp"
#include "idl/types/result.hpp"
#include "perception/camera/camera.hpp"

namespace jostle::perception {

/// A tag as it was seen, on a body B.
struct TagView {
  std::array<Pixel, 4> corners{};  ///< of the black border: top left, top right, bottom right, bottom left
  double size = 0.0;               ///< m, outer edge of the black border
  Pose X_BT;                       ///< tag frame T in the body: origin in its middle, x right, y down, z into the tag
};

/// A pose that explains the corners.
struct Fit {
  Pose X_CB;
  double error_px = 0.0;  ///< root of the mean square distance of a corner from where it should be, pixels
};

/// What corners say of a pose.
struct PoseEstimate {
  Fit best;
  /// The other minimum, which explains the corners less well: a flat thing that is far away looks nearly the same
  /// when it is tilted the other way. Nothing where there is but one.
  std::optional<Fit> other;
  /// [6][6] of (translation, m; rotation vector, rad), both along the camera's axes, the rotation about the body's
  /// origin: R_CB = exp(rotation) R_CB(best). In the order of ROS's PoseWithCovariance. It is of the best minimum: that
  /// the other one may be the true one is not in it.
  std::array<double, 36> covariance{};
};

/// Standard deviation of a corner's coordinate, pixels: `jostle bench tags` measures it in rendered images of noise 2
/// shades and blur 0.7 pixels.
inline constexpr double kCornerSigma = 0.06;

/// Share of a pose's covariance that images of equal scenes have in common: where a corner is found depends on how its
/// edges lie among the pixels more than on noise. `jostle bench tags`, as above.
inline constexpr double kSteadyShare = 0.5;

/// Finds X_CB that makes the sum of squared distances of all corners least, pixels^2 in the raw image.
///
/// Source   starts: both solutions of IPPE for each tag (Collins and Bartoli, "Infinitesimal Plane-Based Pose
///          Estimation", IJCV 2014), by OpenCV. From each, Levenberg's damped Gauss-Newton steps over all corners of
///          all tags. Covariance: sigma^2 (J^T J)^-1 at the best, J the slope of the corners.
/// Errors   kInvalidArgument  no tag, a size that is not > 0, or corners that are no quadrilateral
Result<PoseEstimate> estimate_pose(const Camera& camera, std::span<const TagView> tags,
                                   double corner_sigma = kCornerSigma);

/// Returns how much worse a minimum of one tag explains the corners than the best one: -2 times the logarithm of the
/// ratio of likelihoods, with corners at least as noisy as the best fit's.
double surprise_of(const Fit& fit, const PoseEstimate& estimate);

/// Returns where the four corners of a tag are in its frame, m, in the order of TagView::corners.
std::array<std::array<double, 3>, 4> tag_corners(double size);

}  // namespace jostle::perception
