#pragma once
/// \file
/// Pushers and sliders whose motion one can work out by hand.

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "physics_pool/api/rollout.hpp"
#include "physics_pool/scene/scene.hpp"
#include "tests/support/planar.hpp"

namespace jostle::tests {

/// The author's cylinder (Ch. 7) and box (Ch. 6).
inline physics_pool::SceneObject slider_disc(std::string name, double x, double y) {
  return {.name = std::move(name),
          .shape = physics_pool::Shape::kCylinder,
          .radius = 0.05115,
          .height = 0.0245,
          .mass = 0.5,
          .friction = 0.2,
          .x = x,
          .y = y};
}

inline physics_pool::SceneObject slider_box(std::string name, double x, double y, double yaw = 0.0) {
  return {
      .name = std::move(name), .size = {0.109, 0.154, 0.011}, .mass = 0.5, .friction = 0.8, .x = x, .y = y, .yaw = yaw};
}

/// A pusher at (x, y) on a large table; the first slider is the target.
inline physics_pool::Scene pushing_scene(double x, double y, std::vector<physics_pool::SceneObject> sliders) {
  physics_pool::Scene scene;
  scene.name = "pushing";
  scene.surface = physics_pool::Surface::table(2.0, 2.0);
  scene.robot = physics_pool::pusher({.x = x, .y = y});
  scene.task = {.kind = "push", .target = sliders.front().name, .goal = {.x = 0.4, .y = 0.0, .radius = 0.05}};
  scene.objects = std::move(sliders);
  scene.physics.time_step = 0.001;
  return scene;
}

/// A pusher in front of four discs that will push each other.
inline physics_pool::Scene four_sliders() {
  return pushing_scene(-0.075, 0.01,
                       {slider_disc("s0", 0.0, 0.0), slider_disc("s1", 0.11, 0.04), slider_disc("s2", 0.12, -0.08),
                        slider_disc("s3", 0.22, 0.01)});
}

/// The same control `steps` times, `samples` times over with noise `sigma`, m/s.
inline physics_pool::RolloutBatch pushes(const physics_pool::Scene& scene, std::vector<double> u, int steps,
                                         double duration, std::uint32_t samples = 1, double sigma = 0.0) {
  physics_pool::RolloutBatch batch;
  batch.world = physics_pool::scene_hash(scene);
  batch.x0 = physics_pool::initial_state(scene);
  batch.nominal.nu = kPusherControls;
  for (int t = 0; t < steps; ++t) batch.nominal.append(u);
  batch.u_before = {0.0, 0.0};
  batch.step_duration = duration;
  batch.law = {.sigma = {sigma, sigma}, .limit = {0.2, 0.2}, .seed = 7};
  batch.samples = samples;
  batch.stop_losers = false;
  batch.want_all_trajectories = true;
  return batch;
}

}  // namespace jostle::tests
