#pragma once
/// \file
/// A plant that does exactly what it is told, for tests of controllers.

#include <algorithm>

#include "robot_bridge/robotiq/gripper.hpp"
#include "robot_bridge/ur_sim/plant.hpp"

namespace jostle::tests {

class ExactPlant final : public robot_bridge::ur_sim::Plant {
 public:
  using Joints = robot_bridge::ur_sim::Joints;

  ExactPlant() = default;
  explicit ExactPlant(const Joints& q) : q_(q) {}

  Result<void> step(const Joints& speeds, double opening_rate, double duration) override {
    qd_ = is_stuck ? Joints{} : speeds;
    for (std::size_t j = 0; j < q_.size(); ++j) q_[j] += qd_[j] * duration;
    const double next =
        std::clamp(opening_ + opening_rate * duration, std::min(narrowest, opening_), robot_bridge::robotiq::kStroke);
    opening_velocity_ = (next - opening_) / duration;
    opening_ = next;
    return {};
  }
  Joints positions() const override { return q_; }
  Joints velocities() const override { return qd_; }
  double opening() const override { return opening_; }
  double opening_velocity() const override { return opening_velocity_; }

  bool is_stuck = false;   ///< the joints do not move
  double narrowest = 0.0;  ///< m: what is between the fingers

 private:
  Joints q_{0, -1.5, 1.5, -1.5, -1.5, 0}, qd_{};
  double opening_ = robot_bridge::robotiq::kStroke, opening_velocity_ = 0.0;
};

}  // namespace jostle::tests
