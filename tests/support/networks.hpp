#pragma once
/// \file
/// Networks that know nothing, and scenes they fit.

#include <string>

#include "physics_pool/coarse/learned/network.hpp"
#include "physics_pool/sampling/counter_rng.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::tests {

/// Random weights in one hidden layer of `width`: answers of some millimetres.
inline physics_pool::Network random_network(int width = 12, std::uint64_t seed = 1) {
  using namespace physics_pool;
  CounterStream random(seed, 0);
  Network network;
  network.slider_height = 0.0245;
  network.slider_mass = 0.5;
  network.longest_way = 0.14;
  network.samples = 1000;
  network.input_mean.assign(kInputs, 0.01f);
  network.input_scale.assign(kInputs, 0.1f);
  network.output_scale.assign(kOutputs, 0.01f);
  int inputs = kInputs;
  for (const int outputs : {width, kOutputs}) {
    NetworkLayer layer{.inputs = inputs, .outputs = outputs};
    for (int i = 0; i < inputs * outputs; ++i) layer.weights.push_back(static_cast<float>(random.normal(0.0, 0.2)));
    for (int i = 0; i < outputs; ++i) layer.biases.push_back(static_cast<float>(random.normal(0.0, 0.2)));
    network.layers.push_back(std::move(layer));
    inputs = outputs;
  }
  return network;
}

/// A pusher and as many sliders, of the sizes of random_network.
inline physics_pool::Scene slider_scene(int sliders) {
  physics_pool::Scene scene;
  scene.name = "sliders";
  scene.surface = physics_pool::Surface::table(2.0, 2.0);
  scene.robot = physics_pool::pusher({.x = -0.5});
  for (int i = 0; i < sliders; ++i) {
    scene.objects.push_back({.name = "slider_" + std::to_string(i),
                             .shape = physics_pool::Shape::kCylinder,
                             .radius = 0.05115,
                             .height = 0.0245,
                             .mass = 0.5,
                             .friction = 0.2,
                             .y = 0.2 * i});
  }
  scene.task = {.kind = "push", .target = "slider_0"};
  return scene;
}

}  // namespace jostle::tests
