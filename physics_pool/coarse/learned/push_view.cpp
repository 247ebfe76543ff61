#include "physics_pool/coarse/learned/push_view.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace jostle::physics_pool {
namespace {

constexpr double kGravity = 9.81;  // m/s^2
constexpr double kStill = 1e-6;    // m; a shorter way moves nothing
constexpr double kFastest = 1.5;   // shares of the pusher's speed that a slider may get
constexpr double kTouch = 0.002;   // m; closer than this counts as touched, about the network's error

// Between a point and the segment from a to b.
double segment_distance(double x, double y, double ax, double ay, double bx, double by) {
  const double dx = bx - ax, dy = by - ay, length2 = dx * dx + dy * dy;
  const double along = length2 > 0 ? std::clamp(((x - ax) * dx + (y - ay) * dy) / length2, 0.0, 1.0) : 0.0;
  return std::hypot(x - ax - along * dx, y - ay - along * dy);
}

// Which way a slider goes that is pushed along n by what moves along a hint. Friction
// with the surface is a pyramid: a force between two axes moves things along the
// diagonal, one along an axis anywhere within 45 degrees of it. In between a contact's
// own friction decides. The constants are a rough fit to the fine model; the
// network knows better.
std::array<double, 2> escape(double nx, double ny, double hint_x, double hint_y) {
  constexpr double kQuarter = std::numbers::pi / 4;
  constexpr double kBlur = 0.07;  // rad from an axis at which the way is half a diagonal's
  constexpr double kCone = 0.35;  // rad from an axis within which contact friction matters
  const double normal = std::atan2(ny, nx);
  const double axis = 2 * kQuarter * std::round(normal / (2 * kQuarter)), off = normal - axis;
  const double hint = std::remainder(std::atan2(hint_y, hint_x) - axis, 2 * std::numbers::pi);
  const bool is_along = off * hint > 0;
  const double y = std::abs(off) / (kBlur * (is_along ? std::clamp(1 - std::abs(hint) / 1.2, 0.15, 1.0) : 1.0));
  const double z = y * (1 + y / 12);
  double way = std::copysign(kQuarter * z / (1 + z), off);
  if (!is_along && std::abs(off) < kCone) way *= std::clamp(1.1 - std::abs(hint), 0.1, 1.0);
  return {std::cos(axis + way), std::sin(axis + way)};
}

double wrapped(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

}  // namespace

std::array<double, 2> PushBodies::coasting(double vx, double vy) const {
  const double x = std::abs(vx), y = std::abs(vy), fast = std::max(x, y), slow = std::min(x, y);
  const double braking = slider_friction * kGravity;
  // Until both axes are as fast as the slower one, and from there on.
  const double along_fast = (fast * fast - slow * slow) / (2 * braking) + slow * slow / braking;
  const double along_slow = slow * (fast - slow) / braking + slow * slow / braking;
  return {std::copysign(x >= y ? along_fast : along_slow, vx), std::copysign(x >= y ? along_slow : along_fast, vy)};
}

std::array<double, 2> PushView::fold(double x, double y) const {
  x *= sign_x_;
  y *= sign_y_;
  return swap_ ? std::array{y, x} : std::array{x, y};
}

std::array<double, 2> PushView::unfold(double x, double y) const {
  if (swap_) std::swap(x, y);
  return {sign_x_ * x, sign_y_ * y};
}

PushView::PushView(const PushBodies& bodies, std::span<const double> state, int sliders, std::array<double, 2> u,
                   double duration)
    : bodies_(bodies), sliders_(sliders), u_(u), duration_(duration), speed_(std::hypot(u[0], u[1])) {
  way_ = speed_ * duration;
  if (!(way_ > kStill)) return;
  sign_x_ = std::signbit(u[0]) ? -1.0 : 1.0;
  sign_y_ = std::signbit(u[1]) ? -1.0 : 1.0;
  swap_ = std::abs(u[1]) > std::abs(u[0]);
  handedness_ = sign_x_ * sign_y_ * (swap_ ? -1.0 : 1.0);
  const auto ahead = fold(u[0], u[1]);
  cos_ = ahead[0] / speed_;
  sin_ = ahead[1] / speed_;

  const PlanarLayout layout{sliders};
  const double reach = bodies.pusher_reach();
  double least = way_;
  int first = -1;
  for (int i = 0; i < sliders; ++i) {
    const double* pose = state.data() + layout.pose(i);
    const double* velocity = state.data() + layout.velocity(i);
    const auto p = fold(pose[0] - state[0], pose[1] - state[1]);
    const auto v = fold(velocity[0], velocity[1]);
    x_[at(i)] = p[0];
    y_[at(i)] = p[1];
    vx_[at(i)] = v[0];
    vy_[at(i)] = v[1];
    omega_[at(i)] = handedness_ * velocity[2];
    const double along = cos_ * p[0] + sin_ * p[1], aside = cos_ * p[1] - sin_ * p[0];
    if (along <= 0 || std::abs(aside) >= reach) continue;
    const double free = along - std::sqrt(reach * reach - aside * aside);
    if (free >= least) continue;
    least = free;
    first = i;
  }
  if (first < 0) return;
  least = std::max(least, 0.0);  // less is a touch already, a little deep
  for (int i = 0; i < sliders; ++i) {
    x_[at(i)] -= least * cos_;
    y_[at(i)] -= least * sin_;
  }
  way_ -= least;
  choose_side(first);
  fill_slots(first);
}

// A push exactly along an axis or a diagonal folds in two ways; the one with the first
// slider on its left is taken.
void PushView::choose_side(int first) {
  if (cos_ * y_[at(first)] - sin_ * x_[at(first)] >= 0) return;
  if (std::abs(u_[0]) == std::abs(u_[1])) {
    swap_ = !swap_;
    std::swap(x_, y_);
    std::swap(vx_, vy_);
  } else if (sin_ == 0) {
    double& sign = swap_ ? sign_x_ : sign_y_;
    sign = -sign;
    for (double& y : y_) y = -y;
    for (double& vy : vy_) vy = -vy;
  } else {
    return;
  }
  handedness_ = -handedness_;
  for (double& omega : omega_) omega = -omega;
}

void PushView::fill_slots(int first) {
  std::array<bool, kSlots> in_reach{};
  std::array<double, kSlots> key{};
  in_reach[at(first)] = true;
  for (int i = 0; i < sliders_; ++i) {
    key[at(i)] = segment_distance(x_[at(i)], y_[at(i)], 0, 0, way_ * cos_, way_ * sin_);
    if (key[at(i)] < bodies_.pusher_reach() + kTouch) in_reach[at(i)] = true;
  }
  // Hardly anything moves farther than the pusher: the rest is a matter of who could meet whom.
  for (int round = 1; round < sliders_; ++round) {
    for (int i = 0; i < sliders_; ++i) {
      for (int j = 0; j < sliders_; ++j) {
        if (!in_reach[at(i)] || in_reach[at(j)]) continue;
        const double apart = std::hypot(x_[at(i)] - x_[at(j)], y_[at(i)] - y_[at(j)]);
        in_reach[at(j)] = apart < bodies_.slider_reach() + way_ + kTouch;
      }
    }
  }
  for (int i = 0; i < sliders_; ++i) {
    if (!in_reach[at(i)]) continue;
    int slot = slots_++;
    for (; slot > 0 && key[at(slider_[at(slot - 1)])] > key[at(i)]; --slot) slider_[at(slot)] = slider_[at(slot - 1)];
    slider_[at(slot)] = i;
  }
  const auto sort = [&](std::array<double, kSlots>& values) {
    const std::array<double, kSlots> old = values;
    for (int slot = 0; slot < slots_; ++slot) values[at(slot)] = old[at(slider_[at(slot)])];
  };
  for (auto* values : {&x_, &y_, &vx_, &vy_, &omega_}) sort(*values);
  guess_ways();
}

// Pushes in small parts: whoever overlaps is moved out along escape().
void PushView::guess_ways() {
  constexpr int kParts = 32;
  std::array<double, kSlots> x = x_, y = y_;
  // Moves slot j out of something at (px, py) that comes along (hint_x, hint_y).
  const auto push = [&](double px, double py, double reach, double hint_x, double hint_y, int j) {
    const double nx = x[at(j)] - px, ny = y[at(j)] - py, apart = std::hypot(nx, ny);
    if (!(apart < reach) || apart == 0) return;
    const auto way = escape(nx / apart, ny / apart, hint_x, hint_y);
    const double length = (reach - apart) / (way[0] * nx + way[1] * ny) * apart;
    x[at(j)] += length * way[0];
    y[at(j)] += length * way[1];
  };
  for (int part = 1; part <= kParts; ++part) {
    const double along = way_ * part / kParts;
    const std::array<double, kSlots> old_x = x, old_y = y;
    for (int i = 0; i < slots_; ++i) push(along * cos_, along * sin_, bodies_.pusher_reach(), cos_, sin_, i);
    for (int round = 1; round < slots_; ++round) {
      for (int i = 0; i < slots_; ++i) {
        const double dx = x[at(i)] - old_x[at(i)], dy = y[at(i)] - old_y[at(i)], moved = std::hypot(dx, dy);
        if (moved == 0) continue;
        for (int j = 0; j < slots_; ++j) {
          // Who moved more pushes who moved less.
          if (j == i || std::hypot(x[at(j)] - old_x[at(j)], y[at(j)] - old_y[at(j)]) >= moved) continue;
          push(x[at(i)], y[at(i)], bodies_.slider_reach(), dx / moved, dy / moved, j);
        }
      }
    }
  }
  for (int i = 0; i < slots_; ++i) {
    guess_x_[at(i)] = x[at(i)] - x_[at(i)];
    guess_y_[at(i)] = y[at(i)] - y_[at(i)];
  }
}

void PushView::inputs(const Parking& parking, std::span<float> values) const {
  float* value = values.data();
  for (const double v : {way_, way_ * cos_, way_ * sin_, std::atan2(sin_, cos_), speed_})
    *value++ = static_cast<float>(v);
  for (int slot = 0; slot < kSlots; ++slot) {
    if (slot >= slots_) {
      const auto [x, y] = parking[at(slot)];
      for (const double v : {x, y, x, y, 0.0, 0.0, 0.0, 0.0, 0.0}) *value++ = static_cast<float>(v);
      continue;
    }
    const double x = x_[at(slot)], y = y_[at(slot)];
    for (const double v : {x, y, cos_ * x + sin_ * y, cos_ * y - sin_ * x, vx_[at(slot)], vy_[at(slot)],
                           omega_[at(slot)], guess_x_[at(slot)], guess_y_[at(slot)]}) {
      *value++ = static_cast<float>(v);
    }
  }
}

void PushView::targets(std::span<const double> before, std::span<const double> after, std::span<float> values) const {
  std::ranges::fill(values, 0.0f);
  const PlanarLayout layout{sliders_};
  for (int slot = 0; slot < slots_; ++slot) {
    const double* old_pose = before.data() + layout.pose(slider(slot));
    const double* pose = after.data() + layout.pose(slider(slot));
    const double* velocity = after.data() + layout.velocity(slider(slot));
    const auto step = fold(pose[0] - old_pose[0], pose[1] - old_pose[1]);
    const auto v = fold(velocity[0], velocity[1]);
    // Faster than the pusher is who moved before: of no use for a push.
    const auto share = [&](double speed) {
      return static_cast<float>(std::clamp(speed / speed_, -kFastest, kFastest));
    };
    float* value = values.data() + slot * kSlotOutputs;
    value[0] = static_cast<float>(step[0] - guess_x_[at(slot)]);
    value[1] = static_cast<float>(step[1] - guess_y_[at(slot)]);
    value[2] = static_cast<float>(handedness_ * wrapped(pose[2] - old_pose[2]));
    value[3] = share(v[0]);
    value[4] = share(v[1]);
    value[5] = share(handedness_ * velocity[2] * bodies_.slider_radius);
  }
}

void PushView::touched(std::span<const float> outputs, std::array<bool, kSlots>& is_touched) const {
  const auto end = pusher_end();
  is_touched = {};
  for (int slot = 0; slot < slots_; ++slot) {
    is_touched[at(slot)] =
        segment_distance(x_[at(slot)], y_[at(slot)], 0, 0, end[0], end[1]) < bodies_.pusher_reach() + kTouch;
  }
  for (int round = 1; round < slots_; ++round) {
    for (int i = 0; i < slots_; ++i) {
      const float* moved = outputs.data() + i * kSlotOutputs;
      for (int j = 0; j < slots_; ++j) {
        if (!is_touched[at(i)] || is_touched[at(j)]) continue;
        is_touched[at(j)] = segment_distance(x_[at(j)], y_[at(j)], x_[at(i)], y_[at(i)], guess(i)[0] + moved[0],
                                             guess(i)[1] + moved[1]) < bodies_.slider_reach() + kTouch;
      }
    }
  }
}

void PushView::apply(std::span<const float> outputs, std::span<double> state) const {
  const PlanarLayout layout{sliders_};
  std::array<bool, kSlots> slot_touched{}, moved{};
  touched(outputs, slot_touched);
  for (int slot = 0; slot < slots_; ++slot) {
    if (!slot_touched[at(slot)]) continue;
    const float* change = outputs.data() + slot * kSlotOutputs;
    double* pose = state.data() + layout.pose(slider(slot));
    double* velocity = state.data() + layout.velocity(slider(slot));
    const auto step = unfold(guess_x_[at(slot)] + change[0], guess_y_[at(slot)] + change[1]);
    const auto v = unfold(speed_ * change[3], speed_ * change[4]);
    pose[0] += step[0];
    pose[1] += step[1];
    pose[2] = wrapped(pose[2] + handedness_ * change[2]);
    velocity[0] = v[0];
    velocity[1] = v[1];
    velocity[2] = handedness_ * speed_ * change[5] / bodies_.slider_radius;
    moved[at(slider(slot))] = true;
  }
  for (int i = 0; i < sliders_; ++i) {
    if (moved[at(i)]) continue;
    double* pose = state.data() + layout.pose(i);
    double* velocity = state.data() + layout.velocity(i);
    const auto way = bodies_.coasting(velocity[0], velocity[1]);
    pose[0] += way[0];
    pose[1] += way[1];
    std::fill_n(velocity, 3, 0.0);
  }
  for (int axis = 0; axis < 2; ++axis) {
    state[at(axis)] += u_[at(axis)] * duration_;
    state[at(layout.pusher_velocity() + axis)] = u_[at(axis)];
  }
}

}  // namespace jostle::physics_pool
