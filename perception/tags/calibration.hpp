#pragma once
/// \file
/// A camera's intrinsics from views of a flat board of tags.

#include <span>
#include <vector>

#include "perception/camera/camera.hpp"
#include "perception/tags/detector.hpp"
#include "perception/tags/pose.hpp"
#include "perception/tags/sheet.hpp"

namespace jostle::perception {

struct Calibration {
  Camera camera;
  double focal_sigma = 0.0;   ///< pixels, the larger one of fx and fy
  double centre_sigma = 0.0;  ///< pixels, the larger one of cx and cy
  double error_px = 0.0;      ///< root of the mean square distance of a corner from where it should be, pixels
  std::vector<Pose> X_CB;     ///< of the board in each view
};

/// Returns the tags of one view that are on the board, a printed page: body frame B is the page's, x right, y down, z
/// into the paper, origin in its top left corner.
std::vector<TagView> on_board(std::span<const Detection> seen, const Page& board);

/// Finds fx, fy, cx, cy, k1, k2, p1, p2 (k3 is 0) that explain all corners best, by OpenCV's calibrateCamera (Zhang, "A
/// Flexible New Technique for Camera Calibration", PAMI 2000). `width`, `height`: of the images, pixels. `views`: each
/// what on_board() returns.
/// Error kInvalidArgument, with the remedy: fewer than 10 views with 4 tags, boards all tilted alike, corners that
/// leave much of the image out, or a focal length or centre that the views leave uncertain: two standard deviations are
/// more than 0.2 % of the focal length.
Result<Calibration> calibrate(int width, int height, std::span<const std::vector<TagView>> views);

/// Where a camera is in the world.
struct Extrinsics {
  Pose X_WC;
  double position_sigma = 0.0;  ///< m, along the axis that is known least
  double rotation_sigma = 0.0;  ///< rad, the same
  double error_px = 0.0;        ///< as above
};

/// Finds where a camera is that sees tags at known places. `tags`: of one image or of several from the same place, each
/// with its pose in the world as X_BT.
/// Error kInvalidArgument, with the remedy: fewer than 4 tags, places that do not fit what is seen (more than 2
/// pixels), or a pose that the tags leave uncertain: two standard deviations are more than 1 mm or 0.1 degrees.
Result<Extrinsics> locate_camera(const Camera& camera, std::span<const TagView> tags);

}  // namespace jostle::perception
