#pragma once
/// \file
/// Images as plain values.

#include <cstdint>
#include <vector>

namespace jostle::perception {

/// Shades of grey: 0 is black, 255 white.
struct GreyImage {
  int width = 0, height = 0;         ///< pixels
  std::vector<std::uint8_t> pixels;  ///< [height][width], top row first

  std::uint8_t at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
  bool operator==(const GreyImage&) const = default;
};

/// A place in an image: x to the right, y down. The middle of the top left pixel is (0, 0), as in ROS and OpenCV.
struct Pixel {
  double x = 0.0, y = 0.0;
};

}  // namespace jostle::perception
