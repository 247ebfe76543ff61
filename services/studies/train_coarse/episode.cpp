#include "services/studies/train_coarse/episode.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::studies {
namespace {

using physics_pool::CounterStream;

constexpr double kPi = std::numbers::pi;

struct Point {
  double x = 0.0, y = 0.0;  // m
};

double distance(const Point& a, const Point& b) { return std::hypot(a.x - b.x, a.y - b.y); }

Point around(const Point& centre, double radius, double angle) {
  return {centre.x + radius * std::cos(angle), centre.y + radius * std::sin(angle)};
}

// m between rims; small gaps, where something happens, are the likelier ones.
double draw_gap(CounterStream& random, double largest) {
  const double share = random.uniform(0.0, 1.0);
  return largest * share * share;
}

bool is_free(const Point& point, const std::vector<Point>& sliders, double least) {
  return std::ranges::all_of(sliders, [&](const Point& slider) { return distance(point, slider) >= least; });
}

constexpr double kWorkspace = 0.25;  // m, half the side of where sliders lie
constexpr double kSliderGap = 0.08;  // m, of a slider placed near another
constexpr double kPusherGap = 0.06;  // m, between the pusher and its first slider
constexpr double kTogether = 0.75;   // share of sliders placed near another

std::vector<Point> draw_sliders(const DataOrigin& origin, int count, CounterStream& random) {
  const double touching = 2 * origin.slider_radius;
  std::vector<Point> sliders;
  while (static_cast<int>(sliders.size()) < count) {
    Point point{random.uniform(-kWorkspace, kWorkspace), random.uniform(-kWorkspace, kWorkspace)};
    if (!sliders.empty() && random.uniform(0.0, 1.0) < kTogether) {
      const auto other = static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(sliders.size())));
      const double radius = touching + draw_gap(random, kSliderGap);
      point = around(sliders[other], radius, random.uniform(-kPi, kPi));
    }
    if (is_free(point, sliders, touching)) sliders.push_back(point);
  }
  return sliders;
}

const Point& pick(const std::vector<Point>& sliders, CounterStream& random) {
  return sliders[static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(sliders.size())))];
}

// From around one of the sliders. A place that is hemmed in is given up for another.
Point draw_pusher(const DataOrigin& origin, const std::vector<Point>& sliders, CounterStream& random) {
  const double touching = origin.pusher_radius + origin.slider_radius;
  for (;;) {
    const Point& slider = pick(sliders, random);
    const double radius = touching + draw_gap(random, kPusherGap);
    const Point point = around(slider, radius, random.uniform(-kPi, kPi));
    if (is_free(point, sliders, touching)) return point;
  }
}

// The heading that passes a slider at an offset at which the pusher still touches it.
double draw_aim(const DataOrigin& origin, const Point& pusher, const std::vector<Point>& sliders,
                CounterStream& random) {
  // The next one is what a push is mostly about.
  const Point& nearest =
      *std::ranges::min_element(sliders, {}, [&](const Point& slider) { return distance(slider, pusher); });
  const Point& slider = random.uniform(0.0, 1.0) < 0.85 ? nearest : pick(sliders, random);
  const double touching = origin.pusher_radius + origin.slider_radius;
  const double offset = random.uniform(-touching, touching);
  const double away = std::max(distance(pusher, slider), touching);
  return std::atan2(slider.y - pusher.y, slider.x - pusher.x) + std::asin(offset / away);
}

// Where a step leaves things, roughly: what the pusher meets slides out of its way.
// Good enough to aim by.
void guess_step(const DataOrigin& origin, Point& pusher, std::vector<Point>& sliders, const double (&u)[2]) {
  constexpr int kParts = 20;
  const double touching = origin.pusher_radius + origin.slider_radius;
  for (int i = 0; i < kParts; ++i) {
    pusher = {pusher.x + u[0] * origin.duration / kParts, pusher.y + u[1] * origin.duration / kParts};
    for (Point& slider : sliders) {
      if (distance(slider, pusher) >= touching) continue;
      slider = around(pusher, touching, std::atan2(slider.y - pusher.y, slider.x - pusher.x));
    }
  }
}

}  // namespace

physics_pool::Scene training_scene(const DataOrigin& origin, int sliders) {
  physics_pool::Scene scene;
  scene.name = fmt::format("{} sliders to learn from", sliders);
  scene.surface = physics_pool::Surface::table(2.0, 2.0);
  scene.robot = physics_pool::pusher({.x = -0.5, .radius = origin.pusher_radius, .height = origin.pusher_height});
  for (int i = 0; i < sliders; ++i) {
    scene.objects.push_back({.name = fmt::format("slider_{}", i + 1),
                             .shape = physics_pool::Shape::kCylinder,
                             .radius = origin.slider_radius,
                             .height = origin.slider_height,
                             .mass = origin.slider_mass,
                             .friction = origin.slider_friction,
                             .y = 4 * origin.slider_radius * i});
  }
  scene.task = {.kind = "push", .target = "slider_1"};
  scene.physics.time_step = origin.time_step;
  return scene;
}

physics_pool::RolloutBatch draw_episode(const DataOrigin& origin, std::uint32_t episode, std::uint32_t attempt) {
  CounterStream random(origin.seed + (std::uint64_t{attempt} << 32), episode);
  const int count = episode_sliders(episode);
  const auto scene = training_scene(origin, count);
  const StateLayout layout = layout_of(scene);
  std::vector<Point> sliders = draw_sliders(origin, count, random);
  Point pusher = draw_pusher(origin, sliders, random);

  physics_pool::RolloutBatch batch;
  batch.world = scene_hash(scene);
  batch.x0 = initial_state(scene);
  batch.x0.q[0] = pusher.x;
  batch.x0.q[1] = pusher.y;
  for (std::size_t i = 0; i < sliders.size(); ++i) {
    double* q = batch.x0.q.data() + layout.objects[i].q;
    const double yaw = random.uniform(-kPi, kPi);
    q[0] = sliders[i].x;
    q[1] = sliders[i].y;
    q[3] = std::cos(yaw / 2);
    q[6] = std::sin(yaw / 2);
  }

  double heading = 0.0;
  batch.nominal.nu = layout.nu;
  for (int t = 0; t < kEpisodeSteps; ++t) {
    const double speed = random.uniform(0.0, origin.max_speed * std::numbers::sqrt2);
    const double kind = random.uniform(0.0, 1.0);
    if (t > 0 && kind < 0.35) {
      heading += random.normal(0.0, 0.35);
    } else if (kind < 0.92) {
      heading = draw_aim(origin, pusher, sliders, random);
    } else {
      heading = random.uniform(-kPi, kPi);
    }
    const double u[2] = {speed * std::cos(heading), speed * std::sin(heading)};
    batch.nominal.append(u);
    guess_step(origin, pusher, sliders, u);
  }
  batch.u_before.assign(2, 0.0);
  batch.step_duration = origin.duration;
  const double limit = 2 * origin.max_speed;
  batch.law = {.sigma = {0.0, 0.0}, .limit = {limit, limit}};
  batch.fidelity.freeze = true;  // the same physics, at half the price
  batch.stop_losers = false;
  batch.want_all_trajectories = true;
  return batch;
}

std::vector<Transition> transitions_of(const physics_pool::RolloutBatch& batch, const Trajectory& trajectory,
                                       int sliders) {
  const StateLayout layout = layout_of(training_scene({}, sliders));
  std::vector<double> exact(static_cast<std::size_t>(physics_pool::PlanarLayout{sliders}.size()));
  const auto planar = [&](const State& x) {
    physics_pool::to_planar(layout, x, exact);
    std::array<float, kPlanarSize> state{};
    std::ranges::transform(exact, state.begin(), [](double value) { return static_cast<float>(value); });
    return state;
  };
  std::vector<Transition> transitions;
  for (int t = 0; t + 1 < static_cast<int>(trajectory.size()); ++t) {
    const auto u = batch.nominal.step(t);
    const auto n = static_cast<std::size_t>(t);
    transitions.push_back({.before = planar(trajectory[n]),
                           .control = {static_cast<float>(u[0]), static_cast<float>(u[1])},
                           .after = planar(trajectory[n + 1]),
                           .sliders = static_cast<std::uint32_t>(sliders)});
  }
  return transitions;
}

double clearance(const DataOrigin& origin, const std::array<float, kPlanarSize>& state, int sliders) {
  const auto at = [&](int i) {
    const float* pose = state.data() + 2 + 3 * i;
    return Point{pose[0], pose[1]};
  };
  const Point pusher{state[0], state[1]};
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < sliders; ++i) {
    least = std::min(least, distance(pusher, at(i)) - origin.pusher_radius - origin.slider_radius);
    for (int j = i + 1; j < sliders; ++j) least = std::min(least, distance(at(i), at(j)) - 2 * origin.slider_radius);
  }
  return least;
}

}  // namespace jostle::studies
