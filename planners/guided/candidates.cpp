#include "planners/guided/candidates.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::planners {
namespace {

using physics_pool::TaskGeometry;

// Shares of the families, in order; the rest retreats.
constexpr double kLine = 0.35, kApproach = 0.75, kVia = 0.87;

constexpr std::array kLineScales{0.25, 0.5, 1.0, 2.0};  // of sigma
constexpr double kJitter = 0.125;                       // of sigma, on every drawn way
constexpr double kMostTurn = 1.2;                       // rad, of an approach against the straight one
constexpr double kBrisk = 0.5;  // of the speed limit, that ways keep to: beyond it objects are hit, not pushed

// The draws of one candidate, one after the other.
class Draws {
 public:
  Draws(std::uint64_t seed, const CandidateIndex& index) : seed_(seed), index_(index) {}

  double normal(double sigma) { return sigma * physics_pool::standard_normal(seed_, next()); }
  double uniform(double low, double high) { return low + (high - low) * physics_pool::standard_uniform(seed_, next()); }

 private:
  physics_pool::DrawIndex next() {
    // Axis 1 << 16 and up: no sampling law draws there.
    return {.stream = index_.stream, .sample = index_.number, .step = count_++, .axis = 1u << 16};
  }

  std::uint64_t seed_;
  CandidateIndex index_;
  std::uint32_t count_ = 0;
};

struct HandPose {
  double x = 0.0, y = 0.0, heading = 0.0;  // of G; m, rad
};

double nearest_turn(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

// A way of the hand through poses, as controls.
class Way {
 public:
  Way(const TaskGeometry& geometry, const CandidateLaw& law, const State& x) : geometry_(geometry), law_(law) {
    const Eigen::Isometry3d X_WG = tool_pose(geometry, x);
    start_ = {.x = X_WG.translation().x(), .y = X_WG.translation().y(), .heading = x.q[2]};
    const double dx = start_.x - geometry.base.translation().x() - x.q[0];
    const double dy = start_.y - geometry.base.translation().y() - x.q[1];
    const double c = std::cos(start_.heading), s = std::sin(start_.heading);
    offset_x_ = c * dx + s * dy, offset_y_ = c * dy - s * dx;
    poses_ = {start_};
  }

  const HandPose& start() const { return start_; }
  void add(const HandPose& pose) { poses_.push_back(pose); }

  double length() const {
    double sum = 0.0;
    for (std::size_t i = 1; i < poses_.size(); ++i) sum += length(i);
    return sum;
  }

  // The hand at a share of the whole way.
  HandPose at(double share) const {
    double left = share * length();
    for (std::size_t i = 1; i < poses_.size(); ++i) {
      const double here = length(i);
      if (left > here && i + 1 < poses_.size()) {
        left -= here;
        continue;
      }
      const double s = here > 0 ? std::min(left / here, 1.0) : 1.0;
      const HandPose &a = poses_[i - 1], &b = poses_[i];
      return {.x = a.x + s * (b.x - a.x),
              .y = a.y + s * (b.y - a.y),
              .heading = a.heading + s * nearest_turn(b.heading - a.heading)};
    }
    return start_;
  }

  // Goes it in `moving` of `steps` steps, and stands still after.
  void drive(int moving, int steps, ControlSequence& controls) const {
    HandPose before = start_;
    for (int t = 0; t < steps; ++t) {
      std::vector<double> u(static_cast<std::size_t>(controls.nu), 0.0);
      if (t < moving) {
        HandPose after = at(static_cast<double>(t + 1) / moving);
        after.heading = before.heading + nearest_turn(after.heading - before.heading);
        const auto [ax, ay] = joints(after);
        const auto [bx, by] = joints(before);
        u[static_cast<std::size_t>(geometry_.planar->x)] = (ax - bx) / law_.step_duration;
        u[static_cast<std::size_t>(geometry_.planar->y)] = (ay - by) / law_.step_duration;
        u[static_cast<std::size_t>(geometry_.planar->rotation)] = (after.heading - before.heading) / law_.step_duration;
        before = after;
      }
      controls.append(u);
    }
  }

 private:
  // A turn takes time as well: as a way of 0.15 m per rad, the limits' ratio.
  double length(std::size_t i) const {
    const double per_turn = law_.limit[static_cast<std::size_t>(geometry_.planar->x)] /
                            law_.limit[static_cast<std::size_t>(geometry_.planar->rotation)];
    const HandPose &a = poses_[i - 1], &b = poses_[i];
    return std::max(std::hypot(b.x - a.x, b.y - a.y), per_turn * std::abs(nearest_turn(b.heading - a.heading)));
  }
  std::pair<double, double> joints(const HandPose& hand) const {
    const double c = std::cos(hand.heading), s = std::sin(hand.heading);
    return {hand.x - c * offset_x_ + s * offset_y_, hand.y - s * offset_x_ - c * offset_y_};
  }

  const TaskGeometry& geometry_;
  const CandidateLaw& law_;
  HandPose start_;
  double offset_x_ = 0.0, offset_y_ = 0.0;  // G in the turning link, m
  std::vector<HandPose> poses_;
};

// Noise on all controls, of which each step keeps `persistence`.
void add_noise(const CandidateLaw& law, double scale, double persistence, int first, Draws& draws,
               ControlSequence& controls) {
  std::vector<double> noise(law.sigma.size(), 0.0);
  const double fresh = std::sqrt(1 - persistence * persistence);
  for (int t = first; t < controls.steps(); ++t) {
    for (std::size_t i = 0; i < noise.size(); ++i) {
      const double z = draws.normal(1.0);
      noise[i] = t == first ? z : persistence * noise[i] + fresh * z;
      controls.step(t)[i] += scale * law.sigma[i] * noise[i];
    }
  }
}

void clamp(const CandidateLaw& law, ControlSequence& controls) {
  for (int t = 0; t < controls.steps(); ++t) {
    for (std::size_t i = 0; i < law.limit.size(); ++i) {
      controls.step(t)[i] = std::clamp(controls.step(t)[i], -law.limit[i], law.limit[i]);
    }
  }
}

}  // namespace

ControlSequence draw_candidate(const TaskGeometry& geometry, const CandidateLaw& law, const ControlSequence& line,
                               const Beginning& beginning, const CandidateIndex& index) {
  Draws draws(law.seed, index);
  const double family = draws.uniform(0, 1);
  const int n = line.steps(), first = beginning.steps;
  ControlSequence controls{.nu = line.nu};
  if (family < kLine && first == 0) {
    controls = line;
    const double scale = kLineScales[static_cast<std::size_t>(draws.uniform(0, kLineScales.size()))];
    add_noise(law, scale, draws.uniform(0, 1) < 0.5 ? 0.0 : 0.8, 0, draws, controls);
    clamp(law, controls);
    return controls;
  }
  for (int t = 0; t < first; ++t) controls.append(beginning.so_far->step(t));

  const State& x = *beginning.x;
  const physics_pool::Hand& hand = *geometry.robot.hand;
  const double* target = geometry.view(x).target().position();
  Way way(geometry, law, x);
  HandPose from = way.start();
  if (family >= kVia) {  // back first
    const double back = draws.uniform(0.02, 0.1), heading = from.heading + draws.normal(0.3);
    from = {.x = from.x - back * std::cos(heading), .y = from.y - back * std::sin(heading), .heading = from.heading};
    way.add(from);
  }
  const auto bearing_from = [&](double px, double py) { return std::atan2(target[1] - py, target[0] - px); };
  double heading = bearing_from(from.x, from.y);
  if (family >= kApproach && family < kVia) {  // by way of a point beside
    const double along = draws.uniform(0.25, 0.75), beside = draws.normal(0.08);
    const HandPose via{.x = from.x + along * (target[0] - from.x) - beside * std::sin(heading),
                       .y = from.y + along * (target[1] - from.y) + beside * std::cos(heading),
                       .heading = heading + draws.normal(0.3)};
    way.add(via);
    heading = bearing_from(via.x, via.y) + draws.normal(0.15);
  } else {
    heading += std::clamp(draws.normal(0.5), -kMostTurn, kMostTurn);
  }
  const double depth = hand.depth + draws.uniform(-0.2, 0.2) * hand.finger_length, ahead = draws.uniform(0.0, 0.12);
  const double beside = draws.normal(0.1 * hand.stroke);
  const auto before_target = [&](double distance) {
    return HandPose{.x = target[0] - distance * std::cos(heading) - beside * std::sin(heading),
                    .y = target[1] - distance * std::sin(heading) + beside * std::cos(heading),
                    .heading = heading};
  };
  way.add(before_target(depth + ahead));
  way.add(before_target(depth));

  const double speed = kBrisk * law.limit[static_cast<std::size_t>(geometry.planar->x)] * law.step_duration;
  const int left = n - first;
  const int least =
      std::clamp(std::max(static_cast<int>(std::ceil(way.length() / speed)), law.min_steps + 1 - first), 1, left);
  const int moving = std::clamp(least + static_cast<int>(draws.uniform(0, left - least + 1)), 1, left);
  way.drive(moving, left, controls);
  const auto q = [&](int joint) { return x.q[static_cast<std::size_t>(joint)]; };
  controls.step(first)[static_cast<std::size_t>(hand.opening)] +=
      (hand.stroke - q(hand.left) - q(hand.right)) / law.step_duration;
  add_noise(law, kJitter, 0.0, first, draws, controls);
  clamp(law, controls);
  return controls;
}

ControlSequence draw_around(const CandidateLaw& law, const ControlSequence& centre, double scale,
                            const CandidateIndex& index) {
  Draws draws(law.seed, index);
  ControlSequence controls = centre;
  add_noise(law, scale, draws.uniform(0, 1) < 0.5 ? 0.0 : 0.8, 0, draws, controls);
  clamp(law, controls);
  return controls;
}

double distance_between(const TaskGeometry& geometry, const ControlSequence& a, const ControlSequence& b,
                        double step_duration) {
  const auto x = static_cast<std::size_t>(geometry.planar->x), y = static_cast<std::size_t>(geometry.planar->y);
  double dx = 0.0, dy = 0.0, most = 0.0;
  for (int t = 0; t < std::min(a.steps(), b.steps()); ++t) {
    dx += (a.step(t)[x] - b.step(t)[x]) * step_duration;
    dy += (a.step(t)[y] - b.step(t)[y]) * step_duration;
    most = std::max(most, std::hypot(dx, dy));
  }
  return most;
}

}  // namespace jostle::planners
