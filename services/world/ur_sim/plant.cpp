#include "services/world/ur_sim/plant.hpp"

#include <algorithm>
#include <array>

namespace jostle::world {

using robot_bridge::ur_sim::Joints;

Result<void> WorldPlant::step(const Joints& speeds, double opening_rate, double duration) {
  std::array<double, kArm + 1> u;
  std::ranges::copy(speeds, u.begin());
  u.back() = opening_rate;
  world_.begin(u);
  const long steps = std::max(1L, std::lround(duration / world_.world().time_step()));
  for (long i = 0; i < steps; ++i) {
    if (auto ok = world_.step(); !ok) return ok;
  }
  return {};
}

Joints WorldPlant::positions() const {
  Joints q;
  std::copy_n(world_.state().q.begin(), q.size(), q.begin());
  return q;
}

Joints WorldPlant::velocities() const {
  Joints v;
  std::copy_n(world_.state().v.begin(), v.size(), v.begin());
  return v;
}

}  // namespace jostle::world
