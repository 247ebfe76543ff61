#include "services/world/link/mocap_faults.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <utility>

namespace jostle::world {
namespace {

constexpr double kSpell = 50;       // frames, mean
constexpr double kTurning = 4.0;    // rad/m
constexpr double kMostShare = 0.9;  // hidden all the time is not there

}  // namespace

void add_mocap_fault_options(CLI::App& app, MocapFaultOptions& options) {
  app.add_option("--mocap-noise", options.noise,
                 "Standard deviation of the simulated motion capture's coordinates, m; of rotations, 4 rad/m of it")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--mocap-hidden", options.hidden,
                 "Share of the frames in which it does not see an object, in spells of 50 frames in the mean")
      ->capture_default_str()
      ->check(CLI::Range(0.0, kMostShare));
  app.add_option("--mocap-swapped", options.swapped,
                 "Share of the frames in which it takes two objects for each other, in such spells")
      ->capture_default_str()
      ->check(CLI::Range(0.0, kMostShare));
  app.add_option("--mocap-latency", options.latency, "Each of its frames comes late by up to so many seconds")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 10.0));
  app.add_option("--mocap-seed", options.seed, "Of these faults")->capture_default_str();
}

std::vector<std::string> arguments_of(const MocapFaultOptions& options) {
  if (options.are_none()) return {};
  return {"--mocap-noise",   fmt::format("{}", options.noise),   "--mocap-hidden",  fmt::format("{}", options.hidden),
          "--mocap-swapped", fmt::format("{}", options.swapped), "--mocap-latency", fmt::format("{}", options.latency),
          "--mocap-seed",    fmt::format("{}", options.seed)};
}

// A chain whose share of time in the spell is `share`, and whose spells last kSpell frames.
bool MocapFaults::next(bool is_on, double share) {
  if (share == 0) return false;
  return is_on ? !chance(1 / kSpell) : chance(share / (1 - share) / kSpell);
}

void MocapFaults::shake(perception::natnet::Body& body) {
  std::normal_distribution<double> normal;
  for (float& value : body.position) value += static_cast<float>(options_.noise * normal(random_));
  const double sigma = kTurning * options_.noise;
  const Eigen::Vector3d turn(sigma * normal(random_), sigma * normal(random_), sigma * normal(random_));
  const auto& q = body.orientation;
  const Eigen::Quaterniond R =
      Eigen::AngleAxisd(turn.norm(), turn.normalized()) * Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  body.orientation = {static_cast<float>(R.w()), static_cast<float>(R.x()), static_cast<float>(R.y()),
                      static_cast<float>(R.z())};
  body.mean_error = static_cast<float>(options_.noise);
}

void MocapFaults::spoil(perception::natnet::Frame& frame) {
  hidden_.resize(frame.bodies.size(), false);
  if (options_.noise > 0) {
    for (perception::natnet::Body& body : frame.bodies) shake(body);
  }
  const bool was_swapped = is_swapped_;
  is_swapped_ = frame.bodies.size() > 1 && next(is_swapped_, options_.swapped);
  if (is_swapped_ && !was_swapped) {
    first_ = std::uniform_int_distribution<std::size_t>(0, frame.bodies.size() - 1)(random_);
    second_ = (first_ + std::uniform_int_distribution<std::size_t>(1, frame.bodies.size() - 1)(random_)) %
              frame.bodies.size();
  }
  if (is_swapped_) std::swap(frame.bodies[first_].id, frame.bodies[second_].id);
  for (std::size_t i = 0; i < frame.bodies.size(); ++i) {
    hidden_[i] = next(hidden_[i], options_.hidden);
    if (hidden_[i]) frame.bodies[i] = {.id = frame.bodies[i].id, .tracked = false};
  }
}

double MocapFaults::latency() {
  return options_.latency > 0 ? std::uniform_real_distribution<double>(0, options_.latency)(random_) : 0.0;
}

}  // namespace jostle::world
