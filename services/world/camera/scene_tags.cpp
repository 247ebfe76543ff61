#include "services/world/camera/scene_tags.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "perception/rendering/renderer.hpp"
#include "perception/tags/detector.hpp"

namespace jostle::world {

using physics_pool::Scene;
using physics_pool::SceneObject;
using physics_pool::Shape;

Result<std::vector<ObjectTag>> tags_of(const Scene& scene) {
  constexpr double kLeast = 0.01;  // m
  if (static_cast<int>(scene.objects.size()) > perception::tag_count())
    return invalid("objects", fmt::format("{}", scene.objects.size()),
                   fmt::format("at most {} with a tag each", perception::tag_count()));
  std::vector<ObjectTag> tags;
  for (const SceneObject& object : scene.objects) {
    // The side of the largest square of paper.
    const double side =
        object.shape == Shape::kBox ? std::min(object.size[0], object.size[1]) : object.radius * std::sqrt(2.0);
    const double size = std::floor(1e3 * side * perception::kTagBorderCells / perception::kTagCells) / 1e3;
    if (size < kLeast)
      return invalid(fmt::format("object '{}'", object.name), fmt::format("a top of {:.0f} mm", 1e3 * side),
                     "room for a tag of 10 mm and its margin");
    tags.push_back({.object = object.name,
                    .id = static_cast<int>(tags.size()),
                    .size = size,
                    .X_BT = perception::on_top(object.rest_height()),
                    .height = object.rest_height()});
  }
  return tags;
}

perception::Camera simulated_camera() {
  return {.name = "camera",
          .width = 1280,
          .height = 960,
          .fx = 1100.0,
          .fy = 1100.0,
          .cx = 639.5,
          .cy = 479.5,
          .distortion = {-0.05, 0.02, 0.0, 0.0, 0.0}};
}

Pose overhead(const Scene& scene) {
  constexpr double kShare = 0.8;  // of the image that the surface fills
  const physics_pool::Rectangle bounds = scene.surface.bounds();
  const perception::Camera camera = simulated_camera();
  const double height =
      std::max(bounds.size[0] * camera.fx / camera.width, bounds.size[1] * camera.fy / camera.height) / kShare;
  return perception::looking_at({bounds.x, bounds.y, height}, {bounds.x, bounds.y, 0});
}

}  // namespace jostle::world
