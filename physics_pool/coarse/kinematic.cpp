#include "physics_pool/coarse/kinematic.hpp"

#include <cmath>

namespace jostle::physics_pool {
namespace {

constexpr double kTouch = 1e-5;  // m; closer counts as contact
constexpr int kMarch = 64;       // steps along the way; a glancing disc needs most

// Where the pusher is relative to a slider when they touch.
struct Touch {
  double travelled = 0.0;           // d_free, m
  double arm_x = 0.0, arm_y = 0.0;  // r_c in the world's axes, m
};

}  // namespace

KinematicModel::KinematicModel(const Scene& scene, double rotation_gain)
    : layout_{static_cast<int>(scene.objects.size())},
      pusher_radius_(disc_radius(scene.robot.model).value()),
      rotation_gain_(rotation_gain) {
  for (const SceneObject& object : scene.objects) outlines_.push_back(outline(object));
}

void KinematicModel::advance(std::span<double> states, std::span<const double> controls, double duration) {
  const auto width = static_cast<std::size_t>(layout_.size());
  for (std::size_t k = 0; k * width < states.size(); ++k) {
    advance_one(&states[k * width], &controls[2 * k], duration);
  }
}

void KinematicModel::advance_one(double* x, const double* u, double duration) const {
  const double speed = std::hypot(u[0], u[1]), distance = speed * duration;
  for (int i = 0; i < layout_.sliders; ++i) {
    double* const pose = x + layout_.pose(i);
    const double c = std::cos(pose[2]), s = std::sin(pose[2]);
    // In the slider's axes: the pusher's place, and the direction it goes.
    double px = c * (x[0] - pose[0]) + s * (x[1] - pose[1]);
    double py = -s * (x[0] - pose[0]) + c * (x[1] - pose[1]);
    const double dx = speed > 0 ? (c * u[0] + s * u[1]) / speed : 0.0;
    const double dy = speed > 0 ? (-s * u[0] + c * u[1]) / speed : 0.0;
    Touch touch;
    bool touches = false;
    for (int step = 0; step < kMarch && touch.travelled <= distance; ++step) {
      const Nearest near = nearest(outlines_[static_cast<std::size_t>(i)], px, py);
      const double gap = near.distance - pusher_radius_;
      if (gap < kTouch) {
        // One that moves away, or along, pushes nothing.
        touches = near.normal_x * dx + near.normal_y * dy < 0;
        const double bx = near.distance * near.normal_x - px, by = near.distance * near.normal_y - py;
        touch.arm_x = c * bx - s * by;
        touch.arm_y = s * bx + c * by;
        break;
      }
      touch.travelled += gap;
      px += gap * dx;
      py += gap * dy;
    }
    if (!touches || touch.travelled >= distance) continue;
    const double p_c = (distance - touch.travelled) / distance;
    const double arm = std::hypot(touch.arm_x, touch.arm_y);
    // |u| sin(theta) = (u x r_c)/|r_c|
    const double omega = arm > 0 ? rotation_gain_ * (u[0] * touch.arm_y - u[1] * touch.arm_x) / (arm * arm) : 0.0;
    pose[0] += u[0] * p_c * duration;
    pose[1] += u[1] * p_c * duration;
    pose[2] += omega * p_c * duration;
    double* const velocity = x + layout_.velocity(i);
    velocity[0] = u[0];
    velocity[1] = u[1];
    velocity[2] = omega;
  }
  x[0] += u[0] * duration;
  x[1] += u[1] * duration;
  x[layout_.pusher_velocity()] = u[0];
  x[layout_.pusher_velocity() + 1] = u[1];
}

}  // namespace jostle::physics_pool
