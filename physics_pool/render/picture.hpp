#pragma once
/// \file
/// Pictures as plain values.

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::physics_pool {

struct Picture {
  int width = 0, height = 0;      ///< pixels
  std::vector<std::uint8_t> rgb;  ///< [height][width][3], top row first

  /// Red, green and blue of one pixel; x to the right, y down.
  std::array<std::uint8_t, 3> pixel(int x, int y) const;

  bool operator==(const Picture&) const = default;
};

/// Makes a picture of one shade of grey.
Picture blank_picture(int width, int height, std::uint8_t grey);

/// Copies `part` into `whole` with its top left corner at (x, y). Our own bug
/// if it does not fit.
void paste(Picture& whole, const Picture& part, int x, int y);

/// `dots_per_metre`: how large it is on paper; 0 says nothing of it.
/// Error kIo: the file cannot be written.
Result<void> write_png(const std::filesystem::path& file, const Picture& picture, double dots_per_metre = 0.0);

}  // namespace jostle::physics_pool
