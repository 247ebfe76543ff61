#include "perception/camera/camera.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <vector>

#include "idl/files/files.hpp"
#include "idl/text/yaml_fields.hpp"

namespace jostle::perception {
namespace {

using yaml::Fields;

// A point of the plane z = 1 after distortion, and the slope of that.
struct Bent {
  double x, y;
  double x_dx, x_dy, y_dx, y_dy;
};

Bent bend(const Camera& camera, double x, double y) {
  const auto [k1, k2, p1, p2, k3] = camera.distortion;
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double steepness = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));  // d radial / d r^2, times 2
  return {.x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          .y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
          .x_dx = radial + x * x * steepness + 2 * p1 * y + 6 * p2 * x,
          .x_dy = x * y * steepness + 2 * p1 * x + 2 * p2 * y,
          .y_dx = x * y * steepness + 2 * p1 * x + 2 * p2 * y,
          .y_dy = radial + y * y * steepness + 6 * p1 * y + 2 * p2 * x};
}

// A matrix or vector as ROS's files have them.
std::vector<double> read_matrix(Fields& file, const char* key, int rows, int columns) {
  std::vector<double> data;
  file.section(key, true, [&](Fields& in) {
    int got_rows = 0, got_columns = 0;
    in.required("rows", got_rows);
    in.required("cols", got_columns);
    in.required("data", data);
    if (!in.is_sound()) return;
    if (got_rows != rows || got_columns != columns)
      in.refuse("rows", fmt::format("got {} x {}, wanted {} x {}", got_rows, got_columns, rows, columns));
    if (static_cast<int>(data.size()) != rows * columns)
      in.refuse("data", fmt::format("got {} numbers, wanted {}", data.size(), rows * columns));
  });
  return data;
}

void write_matrix(std::string& text, const char* key, int rows, int columns, const std::vector<double>& data) {
  text += fmt::format("{}:\n  rows: {}\n  cols: {}\n  data: [{}]\n", key, rows, columns, fmt::join(data, ", "));
}

void read_sizes(Fields& in, Camera& camera) {
  constexpr int kLargest = 1 << 14;
  in.required("image_width", camera.width);
  in.required("image_height", camera.height);
  for (const auto& [key, value] : {std::pair("image_width", camera.width), std::pair("image_height", camera.height)}) {
    if (in.is_sound() && (value < 1 || value > kLargest))
      in.refuse(key, fmt::format("got {}, wanted 1 to {}", value, kLargest));
  }
}

Result<Camera> read_camera(const YAML::Node& root, const std::string& origin) {
  Camera camera;
  Fields in(root, "", origin);
  in.optional("camera_name", camera.name);
  read_sizes(in, camera);
  const std::vector<double> k = read_matrix(in, "camera_matrix", 3, 3);
  enum class Model { kPlumbBob } model{};
  in.choice("distortion_model", model, {{"plumb_bob", Model::kPlumbBob}});
  const std::vector<double> d = read_matrix(in, "distortion_coefficients", 1, 5);
  in.skip({"rectification_matrix", "projection_matrix"});
  if (in.is_sound()) {
    camera.fx = k[0], camera.cx = k[2], camera.fy = k[4], camera.cy = k[5];
    std::ranges::copy(d, camera.distortion.begin());
    if (!(camera.fx > 0 && camera.fy > 0) || k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
      in.refuse("camera_matrix", "wanted [fx, 0, cx, 0, fy, cy, 0, 0, 1] with fx and fy > 0");
  }
  in.finish();
  return camera;
}

}  // namespace

Projection project(const Camera& camera, const std::array<double, 3>& p_C) {
  const double x = p_C[0] / p_C[2], y = p_C[1] / p_C[2];
  const Bent bent = bend(camera, x, y);
  Projection result{.pixel = {camera.fx * bent.x + camera.cx, camera.fy * bent.y + camera.cy}};
  // d (x, y) / d p_C = 1/z (1, 0, -x; 0, 1, -y)
  const double u = camera.fx / p_C[2], v = camera.fy / p_C[2];
  result.slope[0] = {u * bent.x_dx, u * bent.x_dy, -u * (bent.x_dx * x + bent.x_dy * y)};
  result.slope[1] = {v * bent.y_dx, v * bent.y_dy, -v * (bent.y_dx * x + bent.y_dy * y)};
  return result;
}

std::array<double, 2> ray(const Camera& camera, const Pixel& pixel) {
  constexpr int kMostSteps = 20;
  constexpr double kExact = 1e-12;
  const double wanted_x = (pixel.x - camera.cx) / camera.fx, wanted_y = (pixel.y - camera.cy) / camera.fy;
  double x = wanted_x, y = wanted_y;
  for (int i = 0; i < kMostSteps; ++i) {
    const Bent bent = bend(camera, x, y);
    const double off_x = wanted_x - bent.x, off_y = wanted_y - bent.y;
    if (std::abs(off_x) + std::abs(off_y) < kExact) break;
    const double determinant = bent.x_dx * bent.y_dy - bent.x_dy * bent.y_dx;
    x += (bent.y_dy * off_x - bent.x_dy * off_y) / determinant;
    y += (bent.x_dx * off_y - bent.y_dx * off_x) / determinant;
  }
  return {x, y};
}

Result<Camera> parse_camera(std::string_view yaml, const std::string& origin) {
  return yaml::parse<Camera>(yaml, origin, [&](const YAML::Node& root) { return read_camera(root, origin); });
}

Result<Camera> load_camera(const std::filesystem::path& file) {
  const auto text_result = files::read(file, files::kMostText);
  if (!text_result) return text_result.error();
  return parse_camera(*text_result, file.string());
}

std::string to_yaml(const Camera& camera) {
  const auto& [name, width, height, fx, fy, cx, cy, distortion] = camera;
  std::string text =
      fmt::format("image_width: {}\nimage_height: {}\ncamera_name: {}\n", width, height, yaml::quoted(name));
  write_matrix(text, "camera_matrix", 3, 3, {fx, 0, cx, 0, fy, cy, 0, 0, 1});
  text += "distortion_model: plumb_bob\n";
  write_matrix(text, "distortion_coefficients", 1, 5, {distortion.begin(), distortion.end()});
  write_matrix(text, "rectification_matrix", 3, 3, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  write_matrix(text, "projection_matrix", 3, 4, {fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0});
  return text;
}

}  // namespace jostle::perception
