// What a prediction study predicts.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics_pool/sampling/counter_rng.hpp"
#include "services/studies/experiment/prediction_study.hpp"

namespace jostle::studies {
namespace {

using physics_pool::CounterStream;
using physics_pool::RolloutBatch;
using physics_pool::Scene;
using physics_pool::SceneObject;
using physics_pool::Shape;

// The sliders of the author's program (wisdomagboh/parareal-manip).
SceneObject slider(Shape shape, const std::string& name) {
  if (shape == Shape::kCylinder) {
    return {.name = name, .shape = shape, .radius = 0.05115, .height = 0.0245, .mass = 0.5, .friction = 0.2};
  }
  return {.name = name, .shape = shape, .size = {0.109, 0.154, 0.011}, .mass = 0.5, .friction = 0.8};
}

Scene scene_of(const PredictionStudy& study, Shape shape, int sliders) {
  Scene scene;
  scene.name = fmt::format("{} {}", sliders, shape == Shape::kBox ? "boxes" : "cylinders");
  scene.surface = physics_pool::Surface::table(4.0, 4.0);  // nothing falls here
  scene.robot = physics_pool::pusher({.x = -1.0});
  for (int i = 0; i < sliders; ++i) {
    scene.objects.push_back(slider(shape, fmt::format("slider{}", i)));
    scene.objects.back().x = 0.5 * i;
  }
  scene.task = {.kind = "push", .target = "slider0"};
  scene.physics.integrator = study.integrator;
  scene.physics.time_step = study.time_step;
  return scene;
}

RolloutBatch still_batch(const Scene& scene, double duration) {
  RolloutBatch batch;
  batch.world = physics_pool::scene_hash(scene);
  batch.x0 = physics_pool::initial_state(scene);
  batch.nominal.nu = 2;
  batch.u_before = {0.0, 0.0};
  batch.step_duration = duration;
  batch.law = {.sigma = {0.0, 0.0}, .limit = {1.0, 1.0}};
  batch.stop_losers = false;
  return batch;
}

std::vector<double> velocity(double speed, double angle) { return {speed * std::cos(angle), speed * std::sin(angle)}; }

// The pusher `across` metres beside the middle of the first slider's near side, touching it.
void touch(const Scene& scene, double across, RolloutBatch& batch) {
  const SceneObject& object = scene.objects.front();
  const double radius = *physics_pool::disc_radius(scene.robot.model);
  const double reach = object.radius + radius;
  const double ahead = object.shape == Shape::kBox ? object.size[0] / 2 + radius
                                                   : std::sqrt(std::max(reach * reach - across * across, 0.0));
  batch.x0.q[0] = object.x - ahead;
  batch.x0.q[1] = object.y + across;
}

double half_side(const SceneObject& object) { return object.shape == Shape::kBox ? object.size[1] / 2 : object.radius; }

// Footnote 2 of Ch. 6: the pusher's place across its motion is uniform within the edges.
void add_open_loop(const PredictionStudy& study, int actions, PredictionCases& result) {
  result.scenes.push_back(scene_of(study, study.shape, 1));
  const Scene& scene = result.scenes.back();
  CounterStream random(study.seed, 0);
  const double side = half_side(scene.objects.front());
  for (int i = 0; i < study.samples; ++i) {
    const double across = random.uniform(-side, side);
    for (const double angle : study.angles_deg) {
      PredictionCase one{.group = "", .scene = result.scenes.size() - 1, .batch = still_batch(scene, study.duration)};
      touch(scene, across, one.batch);
      for (int t = 0; t < actions; ++t) {
        one.batch.nominal.append(velocity(study.speed, angle * std::numbers::pi / 180));
      }
      result.cases.push_back(std::move(one));
    }
  }
}

void add_examples(const PredictionStudy& study, int actions, PredictionCases& result) {
  for (const auto& [shape, name] : {std::pair(Shape::kCylinder, "cylinder"), std::pair(Shape::kBox, "box")}) {
    result.scenes.push_back(scene_of(study, shape, 1));
    const Scene& scene = result.scenes.back();
    for (const auto& [place, part] : {std::pair("centre", 0.0), std::pair("side", 0.5)}) {
      PredictionCase one{.group = fmt::format("{} {}", name, place),
                         .scene = result.scenes.size() - 1,
                         .batch = still_batch(scene, study.duration)};
      touch(scene, part * half_side(scene.objects.front()), one.batch);
      for (int t = 0; t < actions; ++t) one.batch.nominal.append(velocity(study.speed, 0.0));
      result.cases.push_back(std::move(one));
    }
  }
}

// Sliders anywhere within kRoom of the first, nothing overlapping; the pusher up to
// 2 cm from one of them, and controls roughly towards it.
RolloutBatch random_case(const PredictionStudy& study, const Scene& scene, int actions, CounterStream& random) {
  const double kRoom = scene.objects.size() > 1 ? 0.16 : 0.0;  // m
  for (;;) {
    Scene drawn = scene;
    for (SceneObject& object : drawn.objects) {
      object.x = random.uniform(-kRoom, kRoom);
      object.y = random.uniform(-kRoom, kRoom);
      object.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);
    }
    const auto aim = std::min(static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(drawn.objects.size()))),
                              drawn.objects.size() - 1);
    const double from = random.uniform(-std::numbers::pi, std::numbers::pi);
    const SceneObject& target = drawn.objects[aim];
    const double reach = target.shape == Shape::kBox ? std::hypot(target.size[0], target.size[1]) / 2 : target.radius;
    const double away = reach + *physics_pool::disc_radius(drawn.robot.model) + random.uniform(0.001, 0.02);
    drawn.robot.q = {target.x + away * std::cos(from), target.y + away * std::sin(from)};
    RolloutBatch batch = still_batch(scene, study.duration);
    batch.x0 = physics_pool::initial_state(drawn);
    const double heading = from + std::numbers::pi + random.normal(0.0, 0.4);
    for (int t = 0; t < actions; ++t) {
      batch.nominal.append(velocity(random.uniform(0.2, 1.0) * study.speed, heading + random.normal(0.0, 0.3)));
    }
    if (physics_pool::validate(drawn, "drawn")) return batch;
  }
}

}  // namespace

PredictionCases make_cases(const PredictionStudy& study) {
  PredictionCases result;
  for (const int actions : study.actions) {
    if (study.cases == PredictionStudy::Cases::kOpenLoop) add_open_loop(study, actions, result);
    if (study.cases == PredictionStudy::Cases::kExamples) add_examples(study, actions, result);
    if (study.cases != PredictionStudy::Cases::kRandom) continue;
    for (const int sliders : study.sliders) {
      result.scenes.push_back(scene_of(study, study.shape, sliders));
      CounterStream random(study.seed, static_cast<std::uint32_t>(100 * sliders + actions));
      for (int i = 0; i < study.samples; ++i) {
        result.cases.push_back(
            {.group = fmt::format("{} slider{}, {} actions", sliders, sliders == 1 ? "" : "s", actions),
             .scene = result.scenes.size() - 1,
             .batch = random_case(study, result.scenes.back(), actions, random)});
      }
    }
  }
  return result;
}

}  // namespace jostle::studies
