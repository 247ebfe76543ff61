#include "services/bags/plot/curves.hpp"

#include <algorithm>
#include <utility>

#include "physics_pool/scene/scene.hpp"
#include "physics_pool/task/task_geometry.hpp"
#include "services/bags/recorded/recorded_motion.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::bags {
namespace {

constexpr int kPoints = 500;  // of a curve: more than a picture has room for

double distance_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return (a - b).norm(); }

Eigen::Vector3d target_of(const physics_pool::TaskGeometry& geometry, const State& x) {
  const double* p = geometry.view(x).target().position();
  return {p[0], p[1], p[2]};
}

// A step per plan: it holds until the next one.
Curve cost_of(const RecordedRun& run, const RecordedMotion& motion) {
  Curve curve;
  for (std::size_t i = 0; i < run.plans.size(); ++i) {
    const auto time = [&](std::size_t plan) {
      return std::max(0.0, world::seconds(run.plans[plan].header()) - motion.world_begin());
    };
    const double from = time(i), to = i + 1 < run.plans.size() ? time(i + 1) : std::max(from, motion.duration());
    curve.time.insert(curve.time.end(), {from, to});
    curve.value.insert(curve.value.end(), {run.plans[i].cost(), run.plans[i].cost()});
  }
  return curve;
}

// Rests and what the fingers do are no actions, and have none.
Curve idle_of(const RecordedRun& run, const RecordedMotion& motion) {
  Curve curve;
  bool is_first = true;
  for (const jostle_msgs::msg::Observation& seen : run.observations) {
    if (seen.idle() <= 0 || std::exchange(is_first, false)) continue;
    curve.time.push_back(std::max(0.0, world::seconds(seen.header()) - motion.world_begin()));
    curve.value.push_back(seen.idle());
  }
  return curve;
}

}  // namespace

Result<RunCurves> curves_of(BagReader& reader, const RecordedRun& run) {
  const std::string where = reader.info().path.string() + ": scene";
  auto scene_result = physics_pool::parse_scene(run.run.goal().execution_scene(), where);
  if (!scene_result) return scene_result.error();
  const physics_pool::TaskGeometry geometry(*scene_result);
  auto motion_result = RecordedMotion::read(reader, run, geometry.layout, RunClock::kWorld);
  if (!motion_result) return motion_result.error();
  const RecordedMotion& motion = *motion_result;

  RunCurves curves{.task = geometry.kind->name, .has_goal = geometry.kind->has_goal, .cost = cost_of(run, motion)};
  curves.idle = idle_of(run, motion);
  curves.unreadable = motion.unreadable();
  const double step = motion.duration() / kPoints;
  std::optional<State> before;
  for (int i = 0; i <= kPoints; ++i) {
    const double time = i * step;
    State x = motion.at(time).state;
    x.v.assign(static_cast<std::size_t>(geometry.layout.nv), 0.0);  // recordings of states have none
    curves.distance.time.push_back(time);
    curves.distance.value.push_back(geometry.kind->distance(geometry, x));
    if (before && step > 0) {
      const auto speed = [&](const auto& place) { return distance_between(place(*before), place(x)) / step; };
      const auto hand = [&](const State& state) -> Eigen::Vector3d {
        return physics_pool::tool_pose(geometry, state).translation();
      };
      const auto target = [&](const State& state) { return target_of(geometry, state); };
      for (Curve* curve : {&curves.hand_speed, &curves.target_speed}) curve->time.push_back(time - step / 2);
      curves.hand_speed.value.push_back(speed(hand));
      curves.target_speed.value.push_back(speed(target));
    }
    before = std::move(x);
  }
  return curves;
}

}  // namespace jostle::bags
