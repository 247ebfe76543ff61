#include "services/task/coordinator/markers.hpp"

#include <array>
#include <string>
#include <utility>

#include "services/world/link/messages.hpp"

namespace jostle::task {
namespace {

using physics_pool::Shape;
using visualization_msgs::msg::Marker;
using visualization_msgs::msg::MarkerArray;

// visualization_msgs/Marker has them as constants.
enum Type : std::int32_t { kCube = 1, kCylinder = 3, kLineStrip = 4 };
constexpr std::int32_t kDeleteAll = 3;

struct Color {
  float r, g, b, a = 1.0f;
};
constexpr Color kSurface{0.62f, 0.60f, 0.57f}, kFixture{0.45f, 0.47f, 0.50f}, kObject{0.36f, 0.56f, 0.77f},
    kTarget{0.84f, 0.26f, 0.22f}, kGoal{0.25f, 0.65f, 0.35f, 0.5f}, kObstacle{0.85f, 0.55f, 0.15f, 0.5f},
    kTool{0.55f, 0.35f, 0.80f};
constexpr double kThickness = 0.02, kSheet = 0.001, kLine = 0.004;  // m: of the surface, of areas on it, of lines

Marker marker(const std::string& group, int id, Type type, const Pose& pose, const std::array<double, 3>& size,
              const Color& color) {
  Marker result;
  result.header().frame_id(world::kWorldFrame);
  result.ns(group);
  result.id(id);
  result.type(type);
  result.pose().position().x(pose.position[0]);
  result.pose().position().y(pose.position[1]);
  result.pose().position().z(pose.position[2]);
  result.pose().orientation().w(pose.orientation[0]);
  result.pose().orientation().x(pose.orientation[1]);
  result.pose().orientation().y(pose.orientation[2]);
  result.pose().orientation().z(pose.orientation[3]);
  result.scale().x(size[0]);
  result.scale().y(size[1]);
  result.scale().z(size[2]);
  result.color().r(color.r);
  result.color().g(color.g);
  result.color().b(color.b);
  result.color().a(color.a);
  return result;
}

// Objects and fixtures have shapes alike.
template <class Body>
Marker solid(const std::string& group, int id, const Body& body, const Pose& pose, const Color& color) {
  if (body.shape == Shape::kBox) return marker(group, id, kCube, pose, body.size, color);
  return marker(group, id, kCylinder, pose, {2 * body.radius, 2 * body.radius, body.height}, color);
}

Marker area(const std::string& group, const physics_pool::Disc& disc, const Color& color) {
  return marker(group, 0, kCylinder, {.position = {disc.x, disc.y, kSheet / 2}},
                {2 * disc.radius, 2 * disc.radius, kSheet}, color);
}

}  // namespace

MarkerArray no_markers() {
  MarkerArray array;
  array.markers().resize(1);
  array.markers()[0].action(kDeleteAll);
  return array;
}

MarkerArray scene_markers(const physics_pool::Scene& scene) {
  MarkerArray array = no_markers();
  auto& markers = array.markers();
  const auto place = [&] { return static_cast<int>(markers.size()); };  // a number that none before has
  for (const physics_pool::Rectangle& part : scene.surface.parts) {
    markers.push_back(marker("surface", place(), kCube, {.position = {part.x, part.y, -kThickness / 2}},
                             {part.size[0], part.size[1], kThickness}, kSurface));
  }
  for (const physics_pool::Fixture& fixture : scene.fixtures)
    markers.push_back(solid("fixtures", place(), fixture, fixture.pose, kFixture));
  const physics_pool::TaskKind* kind = physics_pool::find_task_kind(scene.task.kind);
  if (kind && kind->has_goal) markers.push_back(area("goal", scene.task.goal, kGoal));
  if (scene.task.obstacle) markers.push_back(area("obstacle", *scene.task.obstacle, kObstacle));
  for (const physics_pool::SceneObject& object : scene.objects) {
    Marker drawn = solid("objects", place(), object, {}, object.name == scene.task.target ? kTarget : kObject);
    drawn.header().frame_id(object.name);
    drawn.frame_locked(true);
    drawn.text(object.name);
    markers.push_back(std::move(drawn));
    for (const physics_pool::ObjectPart& part : object.parts) {
      Marker piece = solid("objects", place(), part, part.pose, object.name == scene.task.target ? kTarget : kObject);
      piece.header().frame_id(object.name);
      piece.frame_locked(true);
      markers.push_back(std::move(piece));
    }
  }
  return array;
}

MarkerArray plan_markers(const physics_pool::TaskGeometry& geometry, const jostle_msgs::msg::Plan& plan) {
  Marker target = marker("target", 0, kLineStrip, {}, {kLine, 0, 0}, kTarget);
  Marker tool = marker("tool", 0, kLineStrip, {}, {kLine, 0, 0}, kTool);
  target.header(plan.header());
  tool.header(plan.header());
  const auto nq = static_cast<std::size_t>(geometry.layout.nq);
  State x{.q = std::vector<double>(nq), .v = std::vector<double>(static_cast<std::size_t>(geometry.layout.nv))};
  const auto add = [](Marker& line, double px, double py, double pz) {
    geometry_msgs::msg::Point point;
    point.x(px);
    point.y(py);
    point.z(pz);
    line.points().push_back(point);
  };
  for (std::size_t at = 0; at + nq <= plan.states().size(); at += nq) {
    x.q.assign(plan.states().begin() + static_cast<std::ptrdiff_t>(at),
               plan.states().begin() + static_cast<std::ptrdiff_t>(at + nq));
    const double* p = geometry.view(x).target().position();
    add(target, p[0], p[1], p[2]);
    const Eigen::Vector3d hand = physics_pool::tool_pose(geometry, x).translation();
    add(tool, hand.x(), hand.y(), hand.z());
  }
  MarkerArray array;
  array.markers({std::move(target), std::move(tool)});
  return array;
}

}  // namespace jostle::task
