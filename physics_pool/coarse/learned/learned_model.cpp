#include "physics_pool/coarse/learned/learned_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "physics_pool/coarse/learned/forward.hpp"

namespace jostle::physics_pool {
namespace {

constexpr int kMaxParts = 1000;  // of a step; beyond it nothing is predicted

class LearnedModel final : public CoarseModel {
 public:
  LearnedModel(const Network& network, int sliders)
      : bodies_(network.bodies),
        parking_(network.parking),
        duration_(network.duration),
        longest_way_(network.longest_way),
        layout_{sliders},
        forward_(network) {
    views_.reserve(kMaxBatch);
    inputs_.resize(static_cast<std::size_t>(kMaxBatch) * kInputs);
    outputs_.resize(static_cast<std::size_t>(kMaxBatch + 1) * kOutputs);
  }

  std::string_view name() const override { return "learned"; }
  PlanarLayout layout() const override { return layout_; }

  void advance(std::span<double> states, std::span<const double> controls, double duration) override {
    const std::size_t count = controls.size() / 2;
    int most = 1;
    for (std::size_t k = 0; k < count; ++k) {
      const double way = std::hypot(controls[2 * k], controls[2 * k + 1]) * duration;
      const double wanted = std::ceil(way / (longest_way_ * (1 + 1e-9)));
      // Neither NaN nor what would take for ever: its state becomes NaN, in one part.
      const bool is_possible = wanted <= kMaxParts;
      parts_[k] = is_possible ? std::max(static_cast<int>(wanted), 1) : 1;
      if (!is_possible) std::ranges::fill(state_of(states, k), std::numeric_limits<double>::quiet_NaN());
      most = std::max(most, parts_[k]);
    }
    for (int part = 0; part < most; ++part) advance_part(states, controls, duration, part);
  }

 private:
  std::span<double> state_of(std::span<double> states, std::size_t k) const {
    const auto size = static_cast<std::size_t>(layout_.size());
    return states.subspan(k * size, size);
  }

  // Advances all states that have such a part, by a step of the training's duration over the part's distance.
  void advance_part(std::span<double> states, std::span<const double> controls, double duration, int part) {
    views_.clear();
    std::size_t asked = 0;
    for (std::size_t k = 0; k < controls.size() / 2; ++k) {
      if (part >= parts_[k]) continue;
      const double pace = duration / (parts_[k] * duration_);
      const PushView& view =
          views_.emplace_back(bodies_, state_of(states, k), layout_.sliders,
                              std::array{controls[2 * k] * pace, controls[2 * k + 1] * pace}, duration_);
      if (view.slots() > 0) view.inputs(parking_, std::span(inputs_).subspan(kInputs * asked++, kInputs));
    }
    forward_.run(std::span(inputs_).first(asked * kInputs), std::span(outputs_).first(asked * kOutputs));
    std::size_t next = 0, answered = 0;
    for (std::size_t k = 0; k < controls.size() / 2; ++k) {
      if (part >= parts_[k]) continue;
      const double pace = duration / (parts_[k] * duration_);
      const PushView& view = views_[next++];
      const auto state = state_of(states, k);
      view.apply(std::span(outputs_).subspan(kOutputs * answered, kOutputs), state);
      if (view.slots() > 0) ++answered;
      const auto velocities = state.subspan(static_cast<std::size_t>(layout_.pusher_velocity()));
      for (double& velocity : velocities) velocity /= pace;
      std::copy_n(controls.begin() + static_cast<std::ptrdiff_t>(2 * k), 2, velocities.begin());
    }
  }

  const PushBodies bodies_;
  const Parking parking_;
  const double duration_, longest_way_;
  const PlanarLayout layout_;
  Forward forward_;
  std::vector<PushView> views_;          // [kMaxBatch]
  std::array<int, kMaxBatch> parts_{};   // that a state's step is taken in
  std::vector<float> inputs_, outputs_;  // [kMaxBatch] of the views that meet something
};

bool is_near(double a, double b) { return std::abs(a - b) <= 1e-6; }  // m

// Why a network does not fit a scene.
std::optional<std::string> objection(const Network& network, const Scene& scene) {
  const auto radius = disc_radius(scene.robot.model);
  if (!radius) return fmt::format("robot.model: got {}, wanted a disc, as the pusher is", scene.robot.model.name);
  if (!is_near(*radius, network.bodies.pusher_radius)) {
    return fmt::format("robot.radius: got {} m, wanted the {} m it was trained with", *radius,
                       network.bodies.pusher_radius);
  }
  if (scene.objects.empty() || scene.objects.size() > kSlots) {
    return fmt::format("objects: got {}, wanted 1 to {}", scene.objects.size(), kSlots);
  }
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const SceneObject& object = scene.objects[i];
    if (object.shape != Shape::kCylinder) return fmt::format("objects[{}].shape: got box, wanted cylinder", i);
    if (!is_near(object.radius, network.bodies.slider_radius)) {
      return fmt::format("objects[{}].radius: got {} m, wanted the {} m it was trained with", i, object.radius,
                         network.bodies.slider_radius);
    }
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<CoarseModel>> make_learned_model(const Network& network, const Scene& scene,
                                                        const std::string& origin) {
  if (const auto why = objection(network, scene)) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("{}: does not fit scene '{}': {}; choose another coarse model: kinematic, limit-surface or "
                    "planar (jostle train-coarse makes models of cylinders only)",
                    origin, scene.name, *why)};
  }
  return std::unique_ptr<CoarseModel>(new LearnedModel(network, static_cast<int>(scene.objects.size())));
}

Result<std::unique_ptr<CoarseModel>> load_learned_model(const std::filesystem::path& file, const Scene& scene) {
  auto network_result = load_network(file);
  if (!network_result) return network_result.error();
  return make_learned_model(*network_result, scene, file.string());
}

}  // namespace jostle::physics_pool
