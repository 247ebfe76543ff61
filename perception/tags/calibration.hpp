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

/// What rides on an arm's flange F, while the other one stands still.
enum class Mounted { kCamera, kSheet };

/// A picture of the sheet, and where the flange was.
struct HandEyeView {
  Pose X_WF;                  ///< as the arm says; W is whatever frame it says it in
  std::vector<TagView> tags;  ///< what on_board() returns
};

struct HandEye {
  Pose X_camera;                ///< kCamera: X_FC; kSheet: X_WC
  Pose X_sheet;                 ///< kCamera: X_WB; kSheet: X_FB
  double position_error = 0.0;  ///< m, root mean square distance of the sheet in a view from where it is in the mean
  double rotation_error = 0.0;  ///< rad, the same
};

/// Finds where a camera is on an arm, or beside one that shows it the sheet, by OpenCV's calibrateHandEye (Park and
/// Martin, "Robot Sensor Calibration: Solving AX = XB on the Euclidean Group", TRA 1994).
/// Error kInvalidArgument, with the remedy: fewer than 6 views with 4 tags, a flange that turned by less than 20
/// degrees, or about one axis alone, or poses that do not fit the pictures (more than 5 mm or 1 degree).
Result<HandEye> calibrate_hand_eye(const Camera& camera, std::span<const HandEyeView> views, Mounted mounted);

}  // namespace jostle::perception
