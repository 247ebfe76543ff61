#include "perception/rendering/renderer.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "idl/types/transform.hpp"
#include "perception/tags/detector.hpp"

namespace jostle::perception {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr float kWhite = 255.0f;
constexpr double kAmbient = 0.55;            // of the light; the rest comes from above
constexpr double kPaper = 0.9, kInk = 0.06;  // shades
constexpr double kProud = 1e-4;              // m that paper is nearer than what it lies on
constexpr double kNear = 0.01;               // m; nothing nearer to the camera shows
constexpr int kFaces = 256;                  // numbers for a body's faces, and a tag's cells
constexpr int kSamples = 16;                 // in each pixel that an edge crosses
constexpr int kNothing = -1;

// What one ray meets.
struct Hit {
  double depth = std::numeric_limits<double>::infinity();  // m along the camera's z axis
  int face = 0;
  Vector3d normal = Vector3d::UnitZ();  // in the body
};

// Rays run from `from` along `way`, in the body's frame; `way` has length 1 along the camera's axis.
using Meet = std::optional<Hit> (*)(const Vector3d& half, const Vector3d& from, const Vector3d& way);

std::optional<Hit> meet_box(const Vector3d& half, const Vector3d& from, const Vector3d& way) {
  double enter = kNear, leave = std::numeric_limits<double>::infinity();
  int face = kNothing;
  for (int i = 0; i < 3; ++i) {
    if (way[i] == 0.0) {
      if (std::abs(from[i]) > half[i]) return std::nullopt;
      continue;
    }
    const double side = way[i] > 0 ? -1 : 1;
    if (const double in = (side * half[i] - from[i]) / way[i]; in > enter) {
      enter = in;
      face = 2 * i + (side > 0 ? 1 : 0);
    }
    leave = std::min(leave, (-side * half[i] - from[i]) / way[i]);
  }
  if (face == kNothing || enter > leave) return std::nullopt;
  Vector3d normal = Vector3d::Zero();
  normal[face / 2] = face % 2 == 1 ? 1 : -1;
  return Hit{enter, face, normal};
}

std::optional<Hit> meet_cylinder(const Vector3d& half, const Vector3d& from, const Vector3d& way) {
  const double radius = half.x(), top = half.z();
  if (way.z() != 0.0) {
    const double side = way.z() > 0 ? -1 : 1;
    const double depth = (side * top - from.z()) / way.z();
    const Vector3d p = from + depth * way;
    if (depth > kNear && p.head<2>().squaredNorm() <= radius * radius)
      return Hit{depth, side > 0 ? 1 : 0, side * Vector3d::UnitZ()};
  }
  const double a = way.head<2>().squaredNorm();
  const double b = from.head<2>().dot(way.head<2>());
  const double discriminant = b * b - a * (from.head<2>().squaredNorm() - radius * radius);
  if (a == 0.0 || discriminant < 0.0) return std::nullopt;
  const double depth = (-b - std::sqrt(discriminant)) / a;
  const Vector3d p = from + depth * way;
  if (depth <= kNear || std::abs(p.z()) > top) return std::nullopt;
  return Hit{depth, 2, Vector3d(p.x() / radius, p.y() / radius, 0)};
}

std::optional<Hit> meet_sphere(const Vector3d& half, const Vector3d& from, const Vector3d& way) {
  const double a = way.squaredNorm(), b = from.dot(way);
  const double discriminant = b * b - a * (from.squaredNorm() - half.x() * half.x());
  if (discriminant < 0.0) return std::nullopt;
  const double depth = (-b - std::sqrt(discriminant)) / a;
  if (depth <= kNear) return std::nullopt;
  return Hit{depth, 0, (from + depth * way) / half.x()};
}

// A square in the plane z = 0, seen from z < 0; its faces are a tag's cells.
std::optional<Hit> meet_paper(const Vector3d& half, const Vector3d& from, const Vector3d& way) {
  if (way.z() <= 0.0 || from.z() >= 0.0) return std::nullopt;
  const double depth = -from.z() / way.z();
  const Vector3d p = from + depth * way;
  if (depth <= kNear || std::abs(p.x()) >= half.x() || std::abs(p.y()) >= half.x()) return std::nullopt;
  const auto cell = [&](double place) { return static_cast<int>((place / half.x() + 1) / 2 * kTagCells); };
  return Hit{depth - kProud, cell(p.y()) * kTagCells + cell(p.x()), -Vector3d::UnitZ()};
}

// Something as one camera sees it.
struct Thing {
  Meet meet;
  Vector3d half, from;
  Matrix3d R_BC;
  Vector3d up;                   // the world's, in the body
  std::vector<float> shades;     // of its faces; one for all
  int left, right, top, bottom;  // corners of pixels that may show it

  bool is_at(int x, int y) const { return x >= left && x <= right && y >= top && y <= bottom; }
  float grey(const Hit& hit) const {
    const double light = kAmbient + (1 - kAmbient) * std::max(0.0, hit.normal.dot(up));
    const float shade = shades.size() == 1 ? shades[0] : shades[static_cast<std::size_t>(hit.face)];
    return kWhite * std::min(1.0f, shade * static_cast<float>(light));
  }
};

// What shows at one place.
struct Spot {
  int surface = kNothing;
  float grey = 0.0f;
};

struct Ray {
  float x, y;
};

Ray between(const Ray& a, const Ray& b, float share) { return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)}; }

}  // namespace

struct SceneCamera::Parts {
  Camera camera;
  Imaging imaging;
  std::vector<Ray> rays;  // [height + 1][width + 1], through the corners of pixels

  const Ray* row(int y) const {
    return rays.data() + static_cast<std::ptrdiff_t>(y) * (static_cast<std::ptrdiff_t>(camera.width) + 1);
  }

  Thing thing(Meet meet, const Vector3d& half, const Isometry3d& X_WB, const Isometry3d& X_WC,
              std::vector<float> shades) const {
    const Isometry3d X_BC = X_WB.inverse() * X_WC;
    Thing result{.meet = meet,
                 .half = half,
                 .from = X_BC.translation(),
                 .R_BC = X_BC.linear(),
                 .up = X_WB.linear().row(2),
                 .shades = std::move(shades)};
    bound(X_BC.inverse(), result);
    return result;
  }

  // Where the corners of its box show, and a little more; everywhere if one is behind the camera or far aside.
  void bound(const Isometry3d& X_CB, Thing& thing) const {
    constexpr double kMargin = 3.0;  // pixels: distortion bends edges
    double left = camera.width, right = 0, top = camera.height, bottom = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
      const Vector3d p = X_CB * thing.half.cwiseProduct(sign);
      if (p.z() < kNear || std::hypot(p.x(), p.y()) > 1.5 * p.z()) {
        thing.left = thing.top = 0, thing.right = camera.width, thing.bottom = camera.height;
        return;
      }
      const Pixel pixel = project(camera, {p.x(), p.y(), p.z()}).pixel;
      left = std::min(left, pixel.x), right = std::max(right, pixel.x);
      top = std::min(top, pixel.y), bottom = std::max(bottom, pixel.y);
    }
    const double margin = kMargin + 0.02 * std::max(right - left, bottom - top);
    thing.left = static_cast<int>(std::clamp(left - margin, -1e6, 1e6));
    thing.right = static_cast<int>(std::clamp(right + margin + 1, -1e6, 1e6));
    thing.top = static_cast<int>(std::clamp(top - margin, -1e6, 1e6));
    thing.bottom = static_cast<int>(std::clamp(bottom + margin + 1, -1e6, 1e6));
  }

  std::vector<Thing> things(const View& view) const {
    const Isometry3d X_WC = transform(view.X_WC);
    std::vector<Thing> result;
    for (const Solid& solid : view.solids) {
      const Meet meet = solid.shape == Solid::Shape::kBox        ? meet_box
                        : solid.shape == Solid::Shape::kCylinder ? meet_cylinder
                                                                 : meet_sphere;
      result.push_back(
          thing(meet, Vector3d(solid.half.data()), transform(solid.X_WB), X_WC, {static_cast<float>(solid.shade)}));
    }
    for (const Sticker& sticker : view.stickers) {
      const double half = sticker.size / 2 * kTagCells / kTagBorderCells;
      std::vector<float> shades;
      for (const std::uint8_t cell : tag_cells(sticker.id).pixels)
        shades.push_back(static_cast<float>(cell > 127 ? kPaper : kInk));
      result.push_back(thing(meet_paper, Vector3d(half, half, 0), transform(sticker.X_WT), X_WC, std::move(shades)));
    }
    return result;
  }

  // `x`, `y`: the corner of pixels that the ray is at or next to.
  Spot look(const std::vector<Thing>& all, const std::vector<int>& in_row, int x, int y, const Ray& ray) const {
    Spot spot{.surface = kNothing, .grey = kWhite * static_cast<float>(imaging.background)};
    double nearest = std::numeric_limits<double>::infinity();
    const Vector3d way_C(ray.x, ray.y, 1.0);
    for (const int i : in_row) {
      const Thing& thing = all[static_cast<std::size_t>(i)];
      if (!thing.is_at(x, y)) continue;
      const auto hit = thing.meet(thing.half, thing.from, thing.R_BC * way_C);
      if (!hit || hit->depth >= nearest) continue;
      nearest = hit->depth;
      spot = {i * kFaces + hit->face, thing.grey(*hit)};
    }
    return spot;
  }

  // A pixel that an edge crosses: its mean, over places of which no two have one row or column.
  float mean(const std::vector<Thing>& all, const std::vector<int>& in_row, int x, int y) const {
    constexpr int kOrder[kSamples] = {0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15};
    const Ray* above = row(y) + x;
    const Ray* below = row(y + 1) + x;
    float sum = 0.0f;
    for (int i = 0; i < kSamples; ++i) {
      const float across = (static_cast<float>(i) + 0.5f) / kSamples;
      const float down = (static_cast<float>(kOrder[i]) + 0.5f) / kSamples;
      sum += look(all, in_row, x, y,
                  between(between(above[0], above[1], across), between(below[0], below[1], across), down))
                 .grey;
    }
    return sum / kSamples;
  }

  std::vector<Spot> look_along(const std::vector<Thing>& all, int y) const {
    const std::vector<int> in_row = near(all, y);
    std::vector<Spot> spots;
    spots.reserve(static_cast<std::size_t>(camera.width) + 1);
    for (int x = 0; x <= camera.width; ++x) spots.push_back(look(all, in_row, x, y, row(y)[x]));
    return spots;
  }

  static std::vector<int> near(const std::vector<Thing>& all, int y) {
    std::vector<int> in_row;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (y >= all[i].top && y <= all[i].bottom) in_row.push_back(static_cast<int>(i));
    }
    return in_row;
  }

  cv::Mat1f light(const View& view) const {
    const std::vector<Thing> all = things(view);
    cv::Mat1f image(camera.height, camera.width);
    std::vector<Spot> above = look_along(all, 0);
    for (int y = 0; y < camera.height; ++y) {
      std::vector<Spot> below = look_along(all, y + 1);
      const std::vector<int> in_row = near(all, y);
      for (int x = 0; x < camera.width; ++x) {
        const auto i = static_cast<std::size_t>(x);
        const Spot& first = above[i];
        const auto same = [&](const Spot& spot) { return spot.surface == first.surface; };
        const bool is_whole = same(above[i + 1]) && same(below[i]) && same(below[i + 1]);
        image(y, x) = is_whole ? (first.grey + above[i + 1].grey + below[i].grey + below[i + 1].grey) / 4
                               : mean(all, in_row, x, y);
      }
      above = std::move(below);
    }
    return image;
  }
};

SceneCamera::SceneCamera(const Camera& camera, const Imaging& imaging)
    : parts_(std::make_unique<Parts>(Parts{.camera = camera, .imaging = imaging, .rays = {}})) {
  parts_->rays.reserve((static_cast<std::size_t>(camera.width) + 1) * (static_cast<std::size_t>(camera.height) + 1));
  for (int y = 0; y <= camera.height; ++y) {
    for (int x = 0; x <= camera.width; ++x) {
      const auto [across, down] = ray(camera, {x - 0.5, y - 0.5});
      parts_->rays.push_back({static_cast<float>(across), static_cast<float>(down)});
    }
  }
}

SceneCamera::SceneCamera(SceneCamera&&) noexcept = default;
SceneCamera& SceneCamera::operator=(SceneCamera&&) noexcept = default;
SceneCamera::~SceneCamera() = default;

GreyImage SceneCamera::render(const View& view, std::uint64_t seed) const {
  const Imaging& imaging = parts_->imaging;
  cv::Mat1f image = parts_->light(view);
  if (imaging.blur > 0) cv::GaussianBlur(image, image, {}, imaging.blur);
  if (imaging.noise > 0) {
    cv::RNG random(seed ^ 0x9e3779b97f4a7c15u);  // its state must not be 0
    cv::Mat1f noise(image.size());
    random.fill(noise, cv::RNG::NORMAL, 0.0, imaging.noise);
    image += noise;
  }
  cv::Mat1b rounded;
  image.convertTo(rounded, CV_8U);
  return {.width = rounded.cols, .height = rounded.rows, .pixels = {rounded.begin(), rounded.end()}};
}

Pose looking_at(const std::array<double, 3>& eye, const std::array<double, 3>& target) {
  const Vector3d from(eye.data()), forward = (Vector3d(target.data()) - from).normalized();
  const Vector3d up = std::abs(forward.z()) > 1 - 1e-9 ? Vector3d::UnitY() : Vector3d::UnitZ();
  Isometry3d X_WC = Isometry3d::Identity();
  X_WC.translation() = from;
  X_WC.linear().col(0) = forward.cross(up).normalized();
  X_WC.linear().col(1) = forward.cross(X_WC.linear().col(0));
  X_WC.linear().col(2) = forward;
  return pose_of(X_WC);
}

Pose on_top(double height) { return {.position = {0, 0, height}, .orientation = {0, 1, 0, 0}}; }

}  // namespace jostle::perception
