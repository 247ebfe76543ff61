#pragma once
/// \file
/// Camera: where a point in front of it shows, with the lens's distortion; and its file, as ROS writes it.

#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"
#include "perception/camera/image.hpp"

namespace jostle::perception {

/// Intrinsics of a raw image. Frame C: x to the right, y down, z forward.
///
/// Source  the plumb-bob model of Brown as OpenCV ("Camera Calibration and 3D Reconstruction") and ROS's CameraInfo
///         have it: k1, k2, p1, p2, k3.
struct Camera {
  std::string name = "camera";
  int width = 0, height = 0;           ///< pixels
  double fx = 0.0, fy = 0.0;           ///< pixels
  double cx = 0.0, cy = 0.0;           ///< pixels; whole numbers are middles of pixels
  std::array<double, 5> distortion{};  ///< k1, k2, p1, p2, k3

  bool operator==(const Camera&) const = default;
};

/// Where a point shows, and how fast that place moves with the point.
struct Projection {
  Pixel pixel;
  std::array<std::array<double, 3>, 2> slope{};  ///< d pixel / d p_C, pixels/m
};

/// Projects a point p_C, m, that is in front of the camera (z > 0). The place may be outside the image. Far outside,
/// where the model of distortion means nothing any more, it may be inside by mistake.
Projection project(const Camera& camera, const std::array<double, 3>& p_C);

/// Returns (x, y) so that p_C = (x, y, 1) shows at `pixel`: the inverse of project(), by Newton's method.
std::array<double, 2> ray(const Camera& camera, const Pixel& pixel);

/// Reads and checks a camera's file: the YAML of ROS's camera_calibration with image_width, image_height, camera_name,
/// camera_matrix, distortion_model plumb_bob, distortion_coefficients. Its rectification and projection matrices are
/// not used: images are raw.
/// Errors   kNotFound, kInvalidArgument; the message names file, line, field, got and wanted
Result<Camera> load_camera(const std::filesystem::path& file);
Result<Camera> parse_camera(std::string_view yaml, const std::string& origin);

/// Writes the same text; reading it back gives the same camera bit for bit.
std::string to_yaml(const Camera& camera);

}  // namespace jostle::perception
