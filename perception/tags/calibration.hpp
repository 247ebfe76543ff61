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
  double error_px = 0.0;   ///< root of the mean square distance of a corner from where it should be, pixels
  std::vector<Pose> X_CB;  ///< of the board in each view
};

/// Returns the tags of one view that are on the board, a printed page: body frame B is the page's, x right, y down, z
/// into the paper, origin in its top left corner.
std::vector<TagView> on_board(std::span<const Detection> seen, const Page& board);

/// Finds fx, fy, cx, cy, k1, k2, p1, p2 (k3 is 0) that explain all corners best, by OpenCV's calibrateCamera (Zhang, "A
/// Flexible New Technique for Camera Calibration", PAMI 2000). `width`, `height`: of the images, pixels. `views`: each
/// what on_board() returns.
/// Error kInvalidArgument, with the remedy: fewer than 8 views with 4 tags, boards all tilted alike, or corners that
/// leave much of the image out.
Result<Calibration> calibrate(int width, int height, std::span<const std::vector<TagView>> views);

}  // namespace jostle::perception
