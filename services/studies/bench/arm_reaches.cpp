#include "services/studies/bench/arm_reaches.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "physics_pool/local/inspection.hpp"
#include "physics_pool/local/simulator.hpp"
#include "physics_pool/sampling/counter_rng.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "physics_pool/task/task_geometry.hpp"
#include "planners/approach/straight_reach.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"

namespace jostle::studies {
namespace {

using nlohmann::json;
using physics_pool::Inspection;

constexpr std::uint32_t kStream = 0xa4e;
constexpr int kReachesPerShelf = 10;
constexpr double kLook = 0.004;       // s between two looks
constexpr double kControl = 0.02;     // s of one control
constexpr double kStand = 0.5;        // s that the arm stands at the end
constexpr double kNoise = 0.15;       // rad/s, one draw for each joint and reach
constexpr double kFastest = 3.14159;  // rad/s, of a joint
constexpr double kDeep = 0.001;       // m

// A world, as stiff as a trial has it.
struct Kind {
  double speed = 1.0, time_step = 0.002, contact_time = 0.02;
};

// What came of the reaches of one kind.
struct Record {
  int reaches = 0, diverged = 0, deep = 0, over_torque = 0, grown = 0;
  std::vector<double> deepest_mm, in_fixture_mm, behind_mm, fastest;  // of each reach that did not diverge
  std::vector<double> torque = std::vector<double>(6, 0.0);           // largest share of each joint's limit
};

class Reach {
 public:
  Reach(const physics_pool::WorldPtr& world, const Kind& kind)
      : world_(*world), kind_(kind), simulator_(world), inspector_(world), x_(initial_state(world->scene())) {}

  void go(physics_pool::CounterStream& random, Record& record) {
    const ControlSequence controls = draw(random);
    ++record.reaches;
    for (int t = 0; t < controls.steps(); ++t) {
      if (!hold(controls.step(t), kControl)) return void(++record.diverged);
    }
    const Eigen::Isometry3d X = physics_pool::tool_pose(world_.geometry(), x_);
    is_standing_ = true;
    const std::vector<double> still(7, 0.0);
    if (!hold(still, kStand)) return void(++record.diverged);
    record.deepest_mm.push_back(1e3 * deepest_);
    record.in_fixture_mm.push_back(1e3 * in_fixture_);
    record.behind_mm.push_back(1e3 * (X.translation() - wanted_).norm());
    record.fastest.push_back(fastest_);
    record.deep += deepest_ > kDeep;
    record.over_torque += *std::ranges::max_element(torque_) > 1;
    record.grown += grown_;
    for (std::size_t j = 0; j < torque_.size(); ++j) record.torque[j] = std::max(record.torque[j], torque_[j]);
  }

 private:
  // From the start straight to somewhere in the middle of the shelf, and a little off it.
  ControlSequence draw(physics_pool::CounterStream& random) {
    const physics_pool::TaskGeometry& geometry = world_.geometry();
    const Eigen::Isometry3d from = physics_pool::tool_pose(geometry, x_);
    const Eigen::Vector3d way(random.uniform(0.0, 0.1) - from.translation().x(), random.uniform(-0.16, 0.16), 0);
    const int steps = std::max(static_cast<int>(std::ceil(way.norm() / kind_.speed / kControl)), 1);
    std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(steps), from);
    for (int t = 0; t < steps; ++t) poses[static_cast<std::size_t>(t)].translation() += way * (t + 1) / steps;
    ControlSequence controls = planners::follow(geometry, geometry.view(x_).joints(), poses, kControl);
    std::vector<double> noise;
    for (int j = 0; j < 6; ++j) noise.push_back(random.normal(0, kNoise));
    std::vector<double> q(geometry.view(x_).joints().begin(), geometry.view(x_).joints().end());
    for (int t = 0; t < steps; ++t) {
      const auto u = controls.step(t);
      for (std::size_t j = 0; j < noise.size(); ++j) {
        u[j] = std::clamp(u[j] + noise[j], -kFastest, kFastest);
        q[j] += u[j] * kControl;
      }
    }
    wanted_ = physics_pool::tool_pose(geometry.robot, geometry.base, q).translation();
    return controls;
  }

  // Whether physics came through.
  bool hold(std::span<const double> u, double duration) {
    const int looks = static_cast<int>(std::lround(duration / kLook));
    for (int i = 0; i < looks; ++i) {
      const Eigen::Vector3d before = physics_pool::tool_pose(world_.geometry(), x_).translation();
      if (!simulator_.advance(x_, u, static_cast<int>(std::lround(kLook / kind_.time_step))).diverged.empty())
        return false;
      auto seen_result = inspector_.look(x_, u);
      if (!seen_result) return false;
      note(*seen_result, (physics_pool::tool_pose(world_.geometry(), x_).translation() - before).norm() / kLook);
    }
    return true;
  }

  void note(const Inspection& seen, double speed) {
    constexpr double kSpring = 1e-3;  // J: contacts store what they take, and give it back
    const auto& joints = world_.scene().robot.model.joints;
    deepest_ = std::max(deepest_, seen.deepest);
    in_fixture_ = std::max(in_fixture_, seen.in_fixture);
    fastest_ = std::max(fastest_, speed);
    for (std::size_t j = 0; j < torque_.size(); ++j)
      torque_[j] = std::max(torque_[j], std::abs(seen.drive[j]) / joints[j].force_limit);
    if (!is_standing_) return;
    // While the arm comes to a stop its drives may do work; 0.1 s is ten of their time constants.
    constexpr int kStopped = 25;
    if (++standing_looks_ > kStopped) grown_ |= seen.energy > least_energy_ + kSpring;
    if (standing_looks_ >= kStopped) least_energy_ = std::min(least_energy_, seen.energy);
  }

  const physics_pool::World& world_;
  const Kind kind_;
  physics_pool::Simulator simulator_;
  physics_pool::Inspector inspector_;
  State x_;
  Eigen::Vector3d wanted_;
  double deepest_ = 0.0, in_fixture_ = 0.0, fastest_ = 0.0, least_energy_ = 1e9;
  std::vector<double> torque_ = std::vector<double>(6, 0.0);
  int standing_looks_ = 0;
  bool is_standing_ = false, grown_ = false;
};

Result<Record> try_out(const Kind& kind, const ArmReachesOptions& options) {
  Record record;
  physics_pool::WorldPtr world;
  for (int i = 0; i < options.reaches; ++i) {
    if (options.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    if (i % kReachesPerShelf == 0) {
      auto scene_result = physics_pool::generate_chapter4_arm(
          {.seed = options.seed + static_cast<std::uint64_t>(i / kReachesPerShelf)});
      if (!scene_result) return scene_result.error();
      scene_result->physics.time_step = kind.time_step;
      scene_result->physics.contact_time = kind.contact_time;
      auto world_result = physics_pool::World::compile(*scene_result);
      if (!world_result) return world_result.error();
      world = std::move(world_result).value();
    }
    physics_pool::CounterStream random(options.seed + static_cast<std::uint64_t>(i), kStream);
    Reach(world, kind).go(random, record);
    options.line->step();
  }
  return record;
}

json spread(const std::vector<double>& values) {
  if (values.empty()) return nullptr;
  return {{"median", common::median(values)},
          {"p95", common::quantile(values, 0.95)},
          {"most", *std::ranges::max_element(values)}};
}

json to_json(const Kind& kind, const Record& record) {
  return {{"speed", kind.speed},
          {"time_step", kind.time_step},
          {"contact_time", kind.contact_time},
          {"reaches", record.reaches},
          {"diverged", record.diverged},
          {"deeper_than_1_mm", record.deep},
          {"deepest_mm", spread(record.deepest_mm)},
          {"in_fixture_mm", spread(record.in_fixture_mm)},
          {"behind_mm", spread(record.behind_mm)},
          {"fastest_m_per_s", spread(record.fastest)},
          {"over_torque", record.over_torque},
          {"torque_share", record.torque},
          {"energy_grew", record.grown}};
}

void print(const json& row) {
  const auto of = [&](const char* what, const char* which) {
    return row[what].is_null() ? std::nan("") : row[what][which].get<double>();
  };
  fmt::print(
      "{:>5.1f} {:>7.3f} {:>7.4f} {:>6}/{:<6} {:>6} {:>8.2f} {:>8.2f} {:>8.2f} {:>8.2f} {:>8.1f} {:>7.2f} {:>7} "
      "{:>6}\n",
      row["speed"].get<double>(), row["time_step"].get<double>(), row["contact_time"].get<double>(),
      row["diverged"].get<int>(), row["reaches"].get<int>(), row["deeper_than_1_mm"].get<int>(),
      of("deepest_mm", "median"), of("deepest_mm", "p95"), of("deepest_mm", "most"), of("in_fixture_mm", "most"),
      of("behind_mm", "p95"), of("fastest_m_per_s", "median"), row["over_torque"].get<int>(),
      row["energy_grew"].get<int>());
}

}  // namespace

Result<void> bench_arm_reaches(const ArmReachesOptions& options) {
  std::vector<Kind> kinds;
  for (const double time_step : options.time_steps) {
    for (const double contact_time : options.contact_times) {
      for (const double speed : options.speeds) kinds.push_back({speed, time_step, contact_time});
    }
  }
  options.line->expect(kinds.size() * static_cast<std::size_t>(options.reaches));
  json rows = json::array();
  for (const Kind& kind : kinds) {
    auto record_result = try_out(kind, options);
    if (!record_result) return record_result.error();
    rows.push_back(to_json(kind, *record_result));
  }
  options.line->end();
  fmt::print(
      "speed    step contact  diverged     >1 mm  in each other, mm         in board behind fastest over    energy\n"
      "  m/s       s       s                     median      95%     most  most,mm  95%,mm     m/s torque   grew\n");
  for (const json& row : rows) print(row);
  if (options.json.empty()) return {};
  return common::write_results(options.json, {{"seed", options.seed}, {"results", std::move(rows)}});
}

namespace {

class ArmReachesBenchmark final : public Benchmark {
 public:
  ArmReachesBenchmark()
      : Benchmark(
            "arm-reaches",
            "fast random reaches of an arm into shelves: what diverges, what is inside what, which torques it takes",
            "10 min", Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    app.add_option("--reaches", options_.reaches, "Reaches of each kind")
        ->capture_default_str()
        ->check(CLI::Range(1, 1'000'000));
    app.add_option("--speeds", options_.speeds, "Speeds of the hand, m/s")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(0.05, 5.0));
    app.add_option("--time-steps", options_.time_steps, "Steps of the engine, s")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(2e-4, 4e-3));
    app.add_option("--contact-times", options_.contact_times,
                   "Times in which bodies in contact part, s; at least 2 steps")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(4e-4, 0.1));
    common::add_seed_option(app, "--seed", options_.seed, "Of the first shelf; 10 reaches in each");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_arm_reaches(options_));
  }

  const char* unit() const override { return "reaches"; }

 private:
  ArmReachesOptions options_;
};

}  // namespace

std::unique_ptr<Benchmark> arm_reaches_benchmark() { return std::make_unique<ArmReachesBenchmark>(); }

}  // namespace jostle::studies
