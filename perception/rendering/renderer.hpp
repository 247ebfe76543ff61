#pragma once
/// \file
/// What a camera would see of simple bodies with tags on them: images whose truth is known.

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "idl/types/pose.hpp"
#include "perception/camera/camera.hpp"

namespace jostle::perception {

/// A body of one shade.
struct Solid {
  enum class Shape { kBox, kCylinder, kSphere } shape = Shape::kBox;
  std::array<double, 3>
      half{};  ///< m; box: half extents; cylinder along z: radius, radius, half height; sphere: radius thrice
  Pose X_WB;
  double shade = 0.5;  ///< 0 black to 1 white, where light falls on it at right angles
};

/// A tag of family 36h11 on paper, with its white margin. It shows from one side.
struct Sticker {
  int id = 0;
  double size = 0.0;  ///< m, outer edge of the black border
  Pose X_WT;          ///< x right, y down, z into the paper
};

struct View {
  std::vector<Solid> solids;
  std::vector<Sticker> stickers;
  Pose X_WC;  ///< camera
};

/// What is between the scene and the numbers.
struct Imaging {
  double blur = 0.7;   ///< pixels, standard deviation of the lens's and sensor's blur
  double noise = 2.0;  ///< shades of grey, standard deviation of each pixel
  double background = 0.35;
};

/// A SceneCamera renders by casting rays through the lens's distortion, so that images are exact to a hundredth of a
/// pixel: no texture is filtered, nothing is warped. Light comes from above (+z of the world) and everywhere; there are
/// no shadows.
///
/// Threads  one at a time.
/// Repeats  equal views and seeds give equal images.
class SceneCamera {
 public:
  explicit SceneCamera(const Camera& camera, const Imaging& imaging = {});
  SceneCamera(SceneCamera&&) noexcept;
  SceneCamera& operator=(SceneCamera&&) noexcept;
  ~SceneCamera();

  /// `seed`: of the noise.
  GreyImage render(const View& view, std::uint64_t seed) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Returns X_WC of a camera at `eye` that looks at `target`, the world's z up in its image. m. Straight down, the
/// image's up is the world's +y.
Pose looking_at(const std::array<double, 3>& eye, const std::array<double, 3>& target);

/// Where a tag is that lies flat on a body's top, `height` m above the body's origin, read with the body's y axis up.
Pose on_top(double height);

}  // namespace jostle::perception
