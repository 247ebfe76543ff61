#include "services/world/camera/camera_out.hpp"

#include <utility>

#include "physics_pool/robot/kinematics.hpp"
#include "services/world/camera/messages.hpp"

namespace jostle::world {
namespace {

using perception::Solid;
using physics_pool::Scene;
using physics_pool::Shape;
using Clock = std::chrono::steady_clock;

constexpr auto kStill = std::chrono::seconds(1);  // between two images of a world that stands still
constexpr double kSurfaceShade = 0.45, kObjectShade = 0.3, kRobotShade = 0.25, kFixtureShade = 0.4;
constexpr double kThickness = 0.02;  // m, of the surface

// Objects and fixtures have shapes alike.
template <class Body>
Solid solid_of(const Body& body, const Pose& X_WB, double shade) {
  if (body.shape == Shape::kBox)
    return {.shape = Solid::Shape::kBox,
            .half = {body.size[0] / 2, body.size[1] / 2, body.size[2] / 2},
            .X_WB = X_WB,
            .shade = shade};
  return {.shape = Solid::Shape::kCylinder,
          .half = {body.radius, body.radius, body.height / 2},
          .X_WB = X_WB,
          .shade = shade};
}

void add_robot(const Scene& scene, const State& x, std::vector<Solid>& solids) {
  using physics_pool::GeomShape;
  const physics_pool::RobotModel& model = scene.robot.model;
  const std::span<const double> q = std::span(x.q).first(model.joints.size());
  for (std::size_t link = 0; link < model.links.size(); ++link) {
    const Eigen::Isometry3d X_WL =
        physics_pool::link_pose(model, transform(scene.robot.base), q, static_cast<int>(link));
    for (const physics_pool::RobotGeom& geom : model.links[link].geoms) {
      Solid solid{.X_WB = pose_of(X_WL * transform(geom.pose)), .shade = kRobotShade};
      if (geom.shape == GeomShape::kMesh) continue;
      if (geom.shape == GeomShape::kBox) {
        solid.half = {geom.size[0] / 2, geom.size[1] / 2, geom.size[2] / 2};
      } else if (geom.shape == GeomShape::kCylinder) {
        solid.shape = Solid::Shape::kCylinder;
        solid.half = {geom.radius, geom.radius, geom.height / 2};
      } else {
        solid.shape = Solid::Shape::kSphere;
        solid.half = {geom.radius, geom.radius, geom.radius};
      }
      solids.push_back(solid);
    }
  }
}

}  // namespace

perception::View view_of(const Scene& scene, const std::vector<ObjectTag>& tags, const State& x, const Pose& X_WC) {
  perception::View view{.X_WC = X_WC};
  for (const physics_pool::Rectangle& part : scene.surface.parts)
    view.solids.push_back({.shape = Solid::Shape::kBox,
                           .half = {part.size[0] / 2, part.size[1] / 2, kThickness / 2},
                           .X_WB = {.position = {part.x, part.y, -kThickness / 2}},
                           .shade = kSurfaceShade});
  for (const physics_pool::Fixture& fixture : scene.fixtures)
    view.solids.push_back(solid_of(fixture, fixture.pose, kFixtureShade));
  add_robot(scene, x, view.solids);
  const StateLayout layout = physics_pool::layout_of(scene);
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    Pose X_WB;
    const auto q = x.q.begin() + layout.objects[i].q;
    std::copy_n(q, 3, X_WB.position.begin());
    std::copy_n(q + 3, 4, X_WB.orientation.begin());
    view.solids.push_back(solid_of(scene.objects[i], X_WB, kObjectShade));
    for (const physics_pool::ObjectPart& part : scene.objects[i].parts)
      view.solids.push_back(solid_of(part, pose_of(transform(X_WB) * transform(part.pose)), kObjectShade));
    view.stickers.push_back(
        {.id = tags[i].id, .size = tags[i].size, .X_WT = pose_of(transform(X_WB) * transform(tags[i].X_BT))});
  }
  return view;
}

CameraOut::CameraOut(const wire::Participant& participant, Scene scene, std::vector<ObjectTag> tags, std::uint64_t seed)
    : scene_(std::move(scene)),
      tags_(std::move(tags)),
      X_WC_(overhead(scene_)),
      camera_(simulated_camera()),
      seed_(seed),
      images_(participant, wire::camera_image(kName)),
      infos_(participant, wire::camera_info(kName)),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

void CameraOut::show(const State& truth, double time) {
  {
    const std::lock_guard lock(mutex_);
    newest_ = {truth, time};
  }
  shown_.notify_one();
}

void CameraOut::work(const std::stop_token& stop) {
  double last_time = -1.0;
  Clock::time_point last{};
  while (!stop.stop_requested()) {
    Moment moment;
    {
      std::unique_lock lock(mutex_);
      const auto is_news = [&] { return newest_ && newest_->time != last_time; };
      if (!shown_.wait_until(lock, stop, last + kStill, is_news) && (stop.stop_requested() || !newest_)) {
        last = Clock::now();
        continue;
      }
      moment = *newest_;
    }
    publish(moment);
    last_time = moment.time;
    last = Clock::now();
  }
}

void CameraOut::publish(const Moment& moment) {
  const perception::GreyImage image = camera_.render(view_of(scene_, tags_, moment.x, X_WC_), seed_++);
  // Who misses one sees the next.
  (void)infos_.write(to_message(simulated_camera(), moment.time));
  (void)images_.write(to_message(image, moment.time));
}

}  // namespace jostle::world
