#include "physics_pool/robot/mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <numbers>
#include <set>
#include <sstream>
#include <string>

namespace jostle::physics_pool {
namespace {

using Point = std::array<double, 3>;

constexpr std::size_t kHeader = 84, kTriangle = 50;  // bytes of a binary STL
constexpr std::size_t kDirections = 400;

bool is_binary_stl(const std::string& bytes) {
  if (bytes.size() < kHeader) return false;
  std::uint32_t triangles = 0;
  std::memcpy(&triangles, bytes.data() + 80, sizeof triangles);
  return bytes.size() == kHeader + std::size_t{triangles} * kTriangle;
}

std::set<Point> binary_stl(const std::string& bytes) {
  std::set<Point> points;
  for (std::size_t at = kHeader; at + kTriangle <= bytes.size(); at += kTriangle) {
    float corners[9];  // after the normal
    std::memcpy(corners, bytes.data() + at + 12, sizeof corners);
    for (int i = 0; i < 9; i += 3) points.insert({corners[i], corners[i + 1], corners[i + 2]});
  }
  return points;
}

// Lines "WORD x y z": "vertex" of a text STL, "v" of an OBJ.
std::set<Point> lines_of(const std::string& text, const std::string& word) {
  std::set<Point> points;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string first;
    Point point;
    if (words >> first && first == word && words >> point[0] >> point[1] >> point[2]) points.insert(point);
  }
  return points;
}

// The farthest points along directions that are spread evenly (a Fibonacci sphere).
std::set<Point> farthest(const std::set<Point>& points) {
  std::set<Point> kept;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / kDirections, level = std::sqrt(1 - z * z);
    const double turn = std::numbers::pi * (3 - std::sqrt(5.0)) * static_cast<double>(i);
    const Point d{level * std::cos(turn), level * std::sin(turn), z};
    const auto along = [&](const Point& p) { return d[0] * p[0] + d[1] * p[1] + d[2] * p[2]; };
    kept.insert(*std::ranges::max_element(points, {}, along));
  }
  return kept;
}

}  // namespace

Result<std::vector<double>> mesh_vertices(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  if (!in) return Error{Code::kIo, file.string() + ": cannot be read"};
  std::string ending = file.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  std::set<Point> points;
  if (ending == ".stl") {
    points = is_binary_stl(bytes) ? binary_stl(bytes) : lines_of(bytes, "vertex");
  } else if (ending == ".obj") {
    points = lines_of(bytes, "v");
  } else {
    return invalid(file.string(), fmt::format("a mesh of format '{}'", ending),
                   "STL or OBJ; remedy: convert it, for example with meshlabserver or Blender");
  }
  if (points.size() < 4) {
    return invalid(file.string(), fmt::format("{} points in {} bytes", points.size(), bytes.size()), "4 or more");
  }
  if (points.size() > kDirections) points = farthest(points);
  std::vector<double> vertices;
  for (const Point& point : points) vertices.insert(vertices.end(), point.begin(), point.end());
  return vertices;
}

}  // namespace jostle::physics_pool
