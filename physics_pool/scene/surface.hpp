#pragma once
/// \file
/// What objects stand on: rectangles at height 0.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace jostle::physics_pool {

/// A rectangle with sides along x and y.
struct Rectangle {
  double x = 0.0, y = 0.0;               ///< centre, m
  std::array<double, 2> size{0.6, 0.6};  ///< full extents x, y, m

  /// Whether a point is in it, and at least `margin` metres from its sides.
  bool contains(double px, double py, double margin = 0.0) const {
    return std::abs(px - x) <= size[0] / 2 - margin && std::abs(py - y) <= size[1] / 2 - margin;
  }
  double low_x() const { return x - size[0] / 2; }
  double high_x() const { return x + size[0] / 2; }
  double low_y() const { return y - size[1] / 2; }
  double high_y() const { return y + size[1] / 2; }

  bool operator==(const Rectangle&) const = default;
};

/// The supporting surface, top at z = 0: a table is one rectangle, an L or a table that narrows (Fig. 5.4) several
/// that do not overlap.
struct Surface {
  std::vector<Rectangle> parts{Rectangle{}};

  static Surface table(double size_x, double size_y) { return {{{.size = {size_x, size_y}}}}; }

  /// Whether a body with its centre there is supported.
  bool carries(double x, double y) const {
    return std::ranges::any_of(parts, [&](const Rectangle& part) { return part.contains(x, y); });
  }

  /// Whether a point is in the surface less `margin` metres along its border. Where two parts meet there is no border.
  bool contains(double x, double y, double margin) const {
    if (std::ranges::any_of(parts, [&](const Rectangle& part) { return part.contains(x, y, margin); })) return true;
    return parts.size() > 1 && margin > 0 && covers(x - margin, x + margin, y - margin, y + margin, 0);
  }

  /// The smallest rectangle around all parts.
  Rectangle bounds() const {
    if (parts.size() == 1) return parts[0];
    double low_x = parts[0].low_x(), high_x = parts[0].high_x(), low_y = parts[0].low_y(), high_y = parts[0].high_y();
    for (const Rectangle& part : parts) {
      low_x = std::min(low_x, part.low_x());
      high_x = std::max(high_x, part.high_x());
      low_y = std::min(low_y, part.low_y());
      high_y = std::max(high_y, part.high_y());
    }
    return {.x = (low_x + high_x) / 2, .y = (low_y + high_y) / 2, .size = {high_x - low_x, high_y - low_y}};
  }

  bool operator==(const Surface&) const = default;

 private:
  // Whether the parts from number `first` on cover a rectangle: what the first leaves over must be covered by the rest.
  bool covers(double x0, double x1, double y0, double y1, std::size_t first) const {
    constexpr double kRounding = 1e-9;  // m; parts that meet may be 1e-17 m apart
    if (x1 - x0 <= kRounding || y1 - y0 <= kRounding) return true;
    if (first == parts.size()) return false;
    const Rectangle& part = parts[first];
    const double in_x0 = std::clamp(part.low_x(), x0, x1), in_x1 = std::clamp(part.high_x(), x0, x1);
    const double in_y0 = std::clamp(part.low_y(), y0, y1), in_y1 = std::clamp(part.high_y(), y0, y1);
    if (in_x0 >= in_x1 || in_y0 >= in_y1) return covers(x0, x1, y0, y1, first + 1);
    return covers(x0, in_x0, y0, y1, first + 1) && covers(in_x1, x1, y0, y1, first + 1) &&
           covers(in_x0, in_x1, y0, in_y0, first + 1) && covers(in_x0, in_x1, in_y1, y1, first + 1);
  }
};

}  // namespace jostle::physics_pool
