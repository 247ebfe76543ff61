#include "services/studies/train_coarse/examples.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "physics_pool/coarse/learned/learned_model.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/studies/train_coarse/episode.hpp"

namespace jostle::studies {
namespace {

using namespace physics_pool;

constexpr double kMoved = 0.001;                // m
constexpr double kPenetrationTolerance = 5e-4;  // m; F has as much

std::vector<double> planar(const std::array<float, kPlanarSize>& state, int sliders) {
  return {state.begin(), state.begin() + PlanarLayout{sliders}.size()};
}

struct Errors {
  std::vector<double> position, angle;
  double way = 0.0, all = 0.0, all_squares = 0.0, depths = 0.0, deepest = 0.0;
  std::size_t everything = 0, transitions = 0, penetrating = 0;
};

void add(Errors& errors, const DataOrigin& origin, const Transition& transition, std::span<const double> predicted) {
  const int count = static_cast<int>(transition.sliders);
  const PlanarLayout layout{count};
  std::array<float, kPlanarSize> state{};
  std::ranges::copy(predicted, state.begin());
  for (int i = 0; i < count; ++i) {
    const auto pose = static_cast<std::size_t>(layout.pose(i));
    const auto moved = [&](std::size_t axis) { return transition.after[axis] - transition.before[axis]; };
    const double way = std::hypot(moved(pose), moved(pose + 1));
    const auto wrong = [&](std::size_t axis) { return predicted[axis] - transition.after[axis]; };
    const double error = std::hypot(wrong(pose), wrong(pose + 1));
    errors.all += error;
    errors.all_squares += error * error;
    ++errors.everything;
    if (way < kMoved) continue;
    errors.way += way;
    errors.position.push_back(error);
    errors.angle.push_back(std::abs(std::remainder(wrong(pose + 2), 2 * std::numbers::pi)));
  }
  ++errors.transitions;
  const double depth = -clearance(origin, state, count);
  if (depth <= kPenetrationTolerance) return;
  ++errors.penetrating;
  errors.depths += depth;
  errors.deepest = std::max(errors.deepest, depth);
}

double share(double part, std::size_t whole) { return whole > 0 ? part / static_cast<double>(whole) : common::kNone; }

Accuracy summary(int sliders, const Errors& errors) {
  Accuracy row{.sliders = sliders, .pushed = errors.position.size()};
  row.all_mean = share(errors.all, errors.everything);
  row.all_rms = std::sqrt(share(errors.all_squares, errors.everything));
  row.penetrating = share(static_cast<double>(errors.penetrating), errors.transitions);
  row.deepest = errors.penetrating > 0 ? errors.deepest : common::kNone;
  row.mean_depth = share(errors.depths, errors.penetrating);
  row.mean_way = share(errors.way, row.pushed);
  double sum = 0.0;
  for (const double error : errors.position) sum += error;
  row.mean = share(sum, row.pushed);
  row.median = common::quantile(errors.position, 0.5);
  row.p90 = common::quantile(errors.position, 0.9);
  row.angle_median = common::quantile(errors.angle, 0.5);
  row.angle_p90 = common::quantile(errors.angle, 0.9);
  return row;
}

}  // namespace

PushBodies bodies_of(const DataOrigin& origin) {
  return {.pusher_radius = origin.pusher_radius,
          .slider_radius = origin.slider_radius,
          .slider_friction = origin.slider_friction};
}

bool is_part(Part part, double held_out, std::size_t transition) {
  if (part == Part::kAll) return true;
  const std::size_t round = transition / (kEpisodeSteps * kMaxSliders);
  const auto period = static_cast<std::size_t>(std::max(std::lround(1 / held_out), 2l));
  return (round % period == period - 1) == (part == Part::kHeldOut);
}

Examples examples_of(const TransitionFile& data, Part part, double held_out, const Parking& parking) {
  Examples examples;
  const PushBodies bodies = bodies_of(data.origin);
  std::array<float, kInputs> inputs;
  std::array<float, kOutputs> targets;
  for (std::size_t i = 0; i < data.transitions.size(); ++i) {
    if (!is_part(part, held_out, i)) continue;
    const Transition& transition = data.transitions[i];
    const int sliders = static_cast<int>(transition.sliders);
    const auto before = planar(transition.before, sliders), after = planar(transition.after, sliders);
    const PushView view(bodies, before, sliders, {transition.control[0], transition.control[1]}, data.origin.duration);
    if (view.slots() == 0) continue;
    view.inputs(parking, inputs);
    view.targets(before, after, targets);
    examples.inputs.insert(examples.inputs.end(), inputs.begin(), inputs.end());
    examples.targets.insert(examples.targets.end(), targets.begin(), targets.end());
    for (int slot = 0; slot < kSlots; ++slot) {
      const auto place = slot < view.slots() ? view.guess(slot) : parking[static_cast<std::size_t>(slot)];
      for (const double p : place) examples.places.push_back(static_cast<float>(p));
    }
    for (const double p : view.pusher_end()) examples.places.push_back(static_cast<float>(p));
    examples.places.push_back(static_cast<float>(view.slots()));
  }
  return examples;
}

std::vector<Accuracy> accuracy_of(const Network& network, const TransitionFile& data, Part part, double held_out) {
  std::array<std::unique_ptr<CoarseModel>, kMaxSliders> models;
  std::array<Errors, kMaxSliders> errors;
  for (std::size_t i = 0; i < data.transitions.size(); ++i) {
    if (!is_part(part, held_out, i)) continue;
    const Transition& transition = data.transitions[i];
    const int sliders = static_cast<int>(transition.sliders);
    auto& model = models[transition.sliders - 1];
    if (!model) {
      auto model_result = make_learned_model(network, training_scene(data.origin, sliders), "network");
      if (!model_result) return {};
      model = std::move(model_result).value();
    }
    auto state = planar(transition.before, sliders);
    model->advance(state, std::array<double, 2>{transition.control[0], transition.control[1]}, data.origin.duration);
    add(errors[transition.sliders - 1], data.origin, transition, state);
  }
  std::vector<Accuracy> rows;
  for (int sliders = 1; sliders <= kMaxSliders; ++sliders) {
    const Errors& of = errors[static_cast<std::size_t>(sliders - 1)];
    if (of.transitions > 0) rows.push_back(summary(sliders, of));
  }
  return rows;
}

std::string accuracy_table(const std::vector<Accuracy>& rows) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  std::string text = fmt::format(
      "{:>7} {:>8} {:>7} | {:>6} {:>6} {:>6} | {:>6} {:>6} | {:>6} {:>6} | {:>6} {:>6} {:>7}\n", "sliders", "pushed",
      "way mm", "mean", "median", "90 %", "median", "90 %", "mean", "rms", "pen. %", "mean", "deepest");
  text += fmt::format("{:>7} {:>8} {:>7} | {:^20} | {:^13} | {:^13} | {:^21}\n", "", "", "", "error of pushed, mm",
                      "angle, deg", "of all, mm", "penetration, mm");
  const auto number = [](double value, int digits, int width) {
    return fmt::format("{:>{}}", common::number_text(value, digits), width);
  };
  for (const Accuracy& row : rows) {
    text += fmt::format("{:>7} {:>8} {} | {} {} {} | ", row.sliders, row.pushed, number(1e3 * row.mean_way, 1, 7),
                        number(1e3 * row.mean, 2, 6), number(1e3 * row.median, 2, 6), number(1e3 * row.p90, 2, 6));
    text += fmt::format("{} {} | {} {} | {} {} {}\n", number(kDegrees * row.angle_median, 2, 6),
                        number(kDegrees * row.angle_p90, 2, 6), number(1e3 * row.all_mean, 2, 6),
                        number(1e3 * row.all_rms, 2, 6), number(1e2 * row.penetrating, 1, 6),
                        number(1e3 * row.mean_depth, 2, 6), number(1e3 * row.deepest, 2, 7));
  }
  return text;
}

}  // namespace jostle::studies
