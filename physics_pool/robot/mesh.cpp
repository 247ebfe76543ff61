#include "physics_pool/robot/mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "idl/files/files.hpp"

namespace jostle::physics_pool {
namespace {

using Point = std::array<double, 3>;

constexpr std::size_t kHeader = 84, kTriangle = 50;  // bytes of a binary STL
constexpr std::size_t kDirections = 400, kAxes = 6;  // the first are those of the axes: a mesh keeps its extents
constexpr double kDamaged = std::numeric_limits<double>::quiet_NaN();

bool is_binary_stl(const std::string& bytes) {
  if (bytes.size() < kHeader) return false;
  std::uint32_t triangles = 0;
  std::memcpy(&triangles, bytes.data() + 80, sizeof triangles);
  return bytes.size() == kHeader + std::size_t{triangles} * kTriangle;
}

std::vector<Point> binary_stl(const std::string& bytes) {
  std::vector<Point> points;
  for (std::size_t at = kHeader; at + kTriangle <= bytes.size(); at += kTriangle) {
    float corners[9];  // after the normal
    std::memcpy(corners, bytes.data() + at + 12, sizeof corners);
    for (int i = 0; i < 9; i += 3) points.push_back({corners[i], corners[i + 1], corners[i + 2]});
  }
  return points;
}

// Lines "WORD x y z": "vertex" of a text STL, "v" of an OBJ.
std::vector<Point> lines_of(const std::string& text, const std::string& word) {
  std::vector<Point> points;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string first;
    if (!(words >> first) || first != word) continue;
    Point point;
    if (!(words >> point[0] >> point[1] >> point[2])) point.fill(kDamaged);
    points.push_back(point);
  }
  return points;
}

// Direction i of those along the axes, and then of others that are spread evenly (a Fibonacci sphere).
Point direction(std::size_t i) {
  if (i < kAxes) {
    Point along{};
    along[i / 2] = i % 2 == 0 ? 1 : -1;
    return along;
  }
  const auto number = static_cast<double>(i - kAxes);
  const double z = 1 - 2 * (number + 0.5) / (kDirections - kAxes), level = std::sqrt(1 - z * z);
  const double turn = std::numbers::pi * (3 - std::sqrt(5.0)) * number;
  return {level * std::cos(turn), level * std::sin(turn), z};
}

std::set<Point> farthest(const std::set<Point>& points) {
  std::set<Point> kept;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const Point d = direction(i);
    const auto along = [&](const Point& p) { return d[0] * p[0] + d[1] * p[1] + d[2] * p[2]; };
    kept.insert(*std::ranges::max_element(points, {}, along));
  }
  return kept;
}

}  // namespace

Result<std::vector<double>> mesh_vertices(const std::filesystem::path& file) {
  auto bytes_result = files::read(file);
  if (!bytes_result) return bytes_result.error();
  const std::string& bytes = *bytes_result;
  std::string ending = file.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  std::vector<Point> found;
  if (ending == ".stl") {
    found = is_binary_stl(bytes) ? binary_stl(bytes) : lines_of(bytes, "vertex");
  } else if (ending == ".obj") {
    found = lines_of(bytes, "v");
  } else {
    return invalid(file.string(), fmt::format("a mesh of format '{}'", ending),
                   "STL or OBJ; remedy: convert it, for example with meshlabserver or Blender");
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (std::ranges::all_of(found[i], [](double value) { return std::isfinite(value); })) continue;
    return invalid(file.string(), fmt::format("a damaged vertex, number {}", i + 1), "three finite numbers each");
  }
  std::set<Point> points(found.begin(), found.end());
  if (points.size() < 4) {
    return invalid(file.string(), fmt::format("{} points in {} bytes", points.size(), bytes.size()), "4 or more");
  }
  if (points.size() > kDirections) points = farthest(points);
  std::vector<double> vertices;
  for (const Point& point : points) vertices.insert(vertices.end(), point.begin(), point.end());
  return vertices;
}

}  // namespace jostle::physics_pool
