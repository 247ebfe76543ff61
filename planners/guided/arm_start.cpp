#include "planners/guided/arm_start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "planners/approach/straight_reach.hpp"
#include "planners/guided/guided_start.hpp"

namespace jostle::planners {
namespace {

using physics_pool::Scene;
using physics_pool::TaskGeometry;

constexpr int kMostIterations = 4;  // of the guide

// How fast the shadow may be, and how it is disturbed: m/s, m/s, rad/s, m/s. A reach of 0.5 m takes 1 s (Sec. 4.5.1).
constexpr std::array kLimit{0.75, 0.75, 3.0, 0.05}, kSigma{0.15, 0.15, 0.6, 0.0};

// Where a hand is in the plane: m, m, rad.
struct Place {
  double x = 0.0, y = 0.0, heading = 0.0;
};

Place place_of(const Eigen::Isometry3d& X) {
  return {
      .x = X.translation().x(), .y = X.translation().y(), .heading = std::atan2(X.linear()(1, 0), X.linear()(0, 0))};
}

}  // namespace

Result<Scene> shadow_of(const Scene& scene, std::span<const double> q) {
  const physics_pool::RobotModel& arm = scene.robot.model;
  if (!arm.hand || as_planar(arm)) {
    return invalid("robot.model", fmt::format("'{}'", arm.name), "an arm that holds a hand");
  }
  const Place hand = place_of(tool_pose(arm, transform(scene.robot.base), q));
  Scene shadow = scene;
  shadow.name += " (shadow)";
  shadow.robot = physics_pool::planar_gripper({.x = hand.x, .y = hand.y, .rotation = hand.heading});
  shadow.robot.q[static_cast<std::size_t>(shadow.robot.model.hand->left)] = q[static_cast<std::size_t>(arm.hand->left)];
  shadow.robot.q[static_cast<std::size_t>(shadow.robot.model.hand->right)] =
      q[static_cast<std::size_t>(arm.hand->right)];
  return shadow;
}

Result<std::unique_ptr<ArmStart>> ArmStart::make(physics_pool::Pool& pool, const Scene& scene,
                                                 const TaskGeometry& geometry, const PbstoOptions& options,
                                                 const GuidanceOptions& guidance, std::unique_ptr<Planner> planner) {
  auto shadow_result = shadow_of(scene, scene.robot.q);
  if (!shadow_result) return shadow_result.error();
  PbstoOptions planar = options;
  planar.sigma.assign(kSigma.begin(), kSigma.end());
  planar.limit.assign(kLimit.begin(), kLimit.end());
  auto guide_result = GuidedPlanner::make(pool, *shadow_result, planar, guidance);
  if (!guide_result) return guide_result.error();
  auto world_result = pool.load(*shadow_result);
  if (!world_result) return world_result.error();
  return std::unique_ptr<ArmStart>(new ArmStart(geometry, std::move(shadow_result).value(), *world_result,
                                                options.step_duration, std::move(guide_result).value(),
                                                std::move(planner)));
}

ArmStart::ArmStart(const TaskGeometry& geometry, Scene shadow, Hash world, double step_duration,
                   std::unique_ptr<GuidedPlanner> guide, std::unique_ptr<Planner> planner)
    : geometry_(geometry),
      shadow_(std::move(shadow)),
      world_(world),
      step_duration_(step_duration),
      guide_(std::move(guide)),
      planner_(std::move(planner)) {}

// The same objects; the hand where the arm has it; for a first candidate, where the arm's own would lead it.
Problem ArmStart::shadow_problem(const Problem& problem) const {
  const StateView view = geometry_.view(problem.x0);
  const std::size_t arm_joints = view.joints().size();
  Problem planar = problem;
  planar.world = world_;
  planar.iterations = std::min(problem.iterations, kMostIterations);
  planar.u_before.clear();
  std::vector<double> q(view.joints().begin(), view.joints().end());
  Place before = place_of(tool_pose(geometry_, problem.x0));
  const physics_pool::Hand& hand = *geometry_.robot.hand;
  planar.x0.q = {before.x, before.y, before.heading, q[static_cast<std::size_t>(hand.left)],
                 q[static_cast<std::size_t>(hand.right)]};
  planar.x0.v.assign(planar.x0.q.size(), 0.0);
  planar.x0.q.insert(planar.x0.q.end(), problem.x0.q.begin() + static_cast<std::ptrdiff_t>(arm_joints),
                     problem.x0.q.end());
  planar.x0.v.insert(planar.x0.v.end(), problem.x0.v.begin() + static_cast<std::ptrdiff_t>(arm_joints),
                     problem.x0.v.end());
  planar.initial = {.nu = static_cast<int>(kLimit.size())};
  for (int t = 0; t < problem.initial.steps(); ++t) {
    const auto u = problem.initial.step(t);
    for (std::size_t i = 0; i < u.size(); ++i) {
      for (const auto& [joint, factor] : geometry_.robot.axes[i].joints)
        q[static_cast<std::size_t>(joint)] += factor * u[i] * step_duration_;
    }
    const Place after = place_of(tool_pose(geometry_.robot, geometry_.base, q));
    const double turn = std::remainder(after.heading - before.heading, 2 * std::numbers::pi);
    const std::array speeds{(after.x - before.x) / step_duration_, (after.y - before.y) / step_duration_,
                            turn / step_duration_, 0.0};
    for (std::size_t i = 0; i < speeds.size(); ++i)
      planar.initial.values.push_back(std::clamp(speeds[i], -kLimit[i], kLimit[i]));
    before = after;
  }
  return planar;
}

Result<Plan> ArmStart::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  if (const auto* state = problem.objective.find("state"); state && !state->values.empty()) {
    return planner_->plan(problem, deadline, std::move(stop));
  }
  auto way_result = guide_->plan(shadow_problem(problem), deadline, stop);
  if (!way_result) return way_result;
  const double height = tool_pose(geometry_, problem.x0).translation().z();
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t t = 1; t < way_result->states.size(); ++t) {
    const std::vector<double>& q = way_result->states[t].q;
    poses.push_back(Eigen::Translation3d(q[0], q[1], height) *
                    Eigen::Isometry3d(Eigen::AngleAxisd(q[2], Eigen::Vector3d::UnitZ())));
  }
  ControlSequence initial = follow(geometry_, geometry_.view(problem.x0).joints(), poses, step_duration_);
  return plan_from(*planner_, problem, std::move(initial), *way_result, deadline, std::move(stop));
}

}  // namespace jostle::planners
