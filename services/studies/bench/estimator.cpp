#include "services/studies/bench/estimator.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <vector>

#include "idl/types/transform.hpp"
#include "perception/estimator/estimator.hpp"
#include "perception/estimator/source_clock.hpp"
#include "physics_pool/feasible/nearest_state.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"

namespace jostle::studies {
namespace {

using namespace perception;
using Eigen::Vector3d;
using nlohmann::json;
using physics_pool::Scene;
using physics_pool::SceneObject;

constexpr double kDuration = 20.0, kWarmUp = 1.0;  // s
constexpr double kTick = 0.01;                     // s, between two looks at the estimate
constexpr double kFrame = 0.02;                    // s, of each sensor
constexpr double kSpeed = 0.1, kPush = 0.8;        // m/s; s there, and as long back
constexpr double kNinetyFive = 12.592;             // chi-squared of 6 degrees of freedom
constexpr int kSensors = 2;

struct Trouble {
  const char* name;
  double noise = 0.01;    // m; of rotations 4 rad/m of it
  double hidden = 0.0;    // share of the time
  double swapped = 0.0;   // share of the time, of the first two objects
  double outliers = 0.0;  // share of sightings
  double latency = 0.0;   // s, at most
  double clocks = 0.0;    // s that the sensors' are apart
};

constexpr Trouble kTroubles[] = {
    {.name = "noise 5 mm", .noise = 0.005},
    {.name = "noise 10 mm"},
    {.name = "noise 15 mm", .noise = 0.015},
    {.name = "hidden 30 %", .hidden = 0.3},
    {.name = "swapped 20 %", .swapped = 0.2},
    {.name = "outliers 30 %", .outliers = 0.3},
    {.name = "late by up to 100 ms", .latency = 0.1},
    {.name = "clocks 2 s apart", .latency = 0.1, .clocks = 2.0},
    {.name = "all of it, 15 mm",
     .noise = 0.015,
     .hidden = 0.3,
     .swapped = 0.2,
     .outliers = 0.3,
     .latency = 0.1,
     .clocks = 2.0},
};

// A world whose objects go to and fro in turns.
class World {
 public:
  explicit World(std::mt19937_64& random) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    scene_.name = "bench";
    for (int i = 0; i < 6; ++i) {
      SceneObject object{.name = fmt::format("object{}", i), .size = {0.06, 0.05, 0.1}};
      if (i % 2 == 1)
        object = {.name = object.name, .shape = physics_pool::Shape::kCylinder, .radius = 0.03, .height = 0.1};
      // The next one is 1 cm away or farther at any time.
      object.x = 0.18 * (i % 3 - 1) + 0.01 * uniform(random);
      object.y = (i < 3 ? 0.0 : 0.09) + 0.01 * uniform(random);
      object.yaw = 0.3 * uniform(random);
      scene_.objects.push_back(object);
    }
  }

  const Scene& scene() const { return scene_; }

  // m/s along x.
  double speed(std::size_t object, double time) const {
    const double t = since_push(object, time);
    return t < 0 || t > 2 * kPush ? 0.0 : (t < kPush ? kSpeed : -kSpeed);
  }

  Pose pose(std::size_t index, double time) const {
    const SceneObject& object = scene_.objects[index];
    const double t = std::clamp(since_push(index, time), 0.0, 2 * kPush);
    const double way = kSpeed * (t < kPush ? t : 2 * kPush - t);
    return {.position = {object.x + way, object.y, object.rest_height()}, .orientation = turned_about_z(object.yaw)};
  }

 private:
  double since_push(std::size_t object, double time) const { return time - 2.0 - 3.0 * static_cast<double>(object); }

  Scene scene_;
};

struct Arrival {
  double stamp = 0.0, arrival = 0.0;  // s; of the sensor's clock, of ours
  int sensor = 0;
  std::vector<Sighting> seen;
};

class Sensors {
 public:
  Sensors(const World& world, const Trouble& trouble, std::mt19937_64& random)
      : world_(world), trouble_(trouble), random_(random) {}

  std::vector<Arrival> all() {
    std::vector<Arrival> arrivals;
    for (int sensor = 0; sensor < kSensors; ++sensor) {
      for (int frame = 0; frame * kFrame < kDuration; ++frame) {
        const double time = frame * kFrame + sensor * kFrame / kSensors;
        const double skew = sensor * trouble_.clocks;
        // The clocks are compared by the quickest message, and no message is quicker than a millisecond.
        const double latency = trouble_.latency > 0 ? between(0.001, trouble_.latency) : 0.0;
        arrivals.push_back({time + skew, time + latency, sensor, seen(time)});
      }
    }
    std::ranges::stable_sort(arrivals, {}, &Arrival::arrival);
    return arrivals;
  }

 private:
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Vector3d draw(double sigma) {
    std::normal_distribution<double> normal(0, sigma);
    return {normal(random_), normal(random_), normal(random_)};
  }

  // Whether it is the time for it: a span in every two seconds, the same for both sensors.
  static bool within(double share, double time, double phase) { return std::fmod(time + phase, 2.0) < 2.0 * share; }

  std::vector<Sighting> seen(double time) {
    std::vector<Sighting> sightings;
    const std::size_t count = world_.scene().objects.size();
    for (std::size_t i = 0; i < count; ++i) {
      if (time > kWarmUp && within(trouble_.hidden, time, 0.7 * static_cast<double>(i))) continue;
      const bool is_swapped = i < 2 && time > kWarmUp && within(trouble_.swapped, time, 0.3);
      Pose pose = world_.pose(is_swapped ? 1 - i : i, time);
      if (between(0, 1) < trouble_.outliers) {
        pose.position = {between(-0.3, 0.3), between(-0.3, 0.3), between(0, 0.2)};
        pose.orientation = turned_about_z(between(-M_PI, M_PI));
      }
      Eigen::Isometry3d X = transform(pose);
      X.translation() += draw(trouble_.noise);
      const Vector3d turn = draw(4 * trouble_.noise);
      X.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * X.linear();
      Explanation explanation{.X_WB = pose_of(X)};
      for (std::size_t j = 0; j < 6; ++j) explanation.covariance[7 * j] = std::pow((j < 3 ? 1 : 4) * trouble_.noise, 2);
      sightings.push_back({world_.scene().objects[i].name, {explanation}});
    }
    return sightings;
  }

  const World& world_;
  const Trouble& trouble_;
  std::mt19937_64& random_;
};

// Errors of one way to know where objects are.
struct Record {
  std::vector<double> rest_mm, moving_mm;
  double along = 0.0, squares = 0.0;  // sums of error times velocity, and of velocity squared
  int states = 0, overlapping = 0, impossible = 0, not_standing = 0;
  int judged = 0, inside = 0;  // 95 % ellipsoids
  double most_moved = 0.0;

  void note(const World& world, std::size_t object, double time, const std::array<double, 3>& p) {
    const Vector3d off = Vector3d(world.pose(object, time).position.data()) - Vector3d(p.data());
    const double speed = world.speed(object, time);
    (speed == 0 ? rest_mm : moving_mm).push_back(1e3 * off.norm());
    along += off.x() * speed;
    squares += speed * speed;
  }

  // Of those that stand.
  void note_overlaps(const Scene& scene, const std::vector<Pose>& poses, const std::vector<bool>& stands) {
    std::vector<SceneObject> placed = scene.objects;
    bool overlap = false;
    for (std::size_t i = 0; i < placed.size(); ++i) {
      placed[i].x = poses[i].position[0], placed[i].y = poses[i].position[1];
      placed[i].yaw = yaw_of(poses[i].orientation.data());
      not_standing += !stands[i];
      for (std::size_t j = 0; j < i && !overlap; ++j)
        overlap = stands[i] && stands[j] && physics_pool::overlap(placed[i], placed[j]);
    }
    ++states;
    overlapping += overlap;
  }

  json to_json() const {
    using common::median;
    using common::quantile;
    return {{"rest_mm", {{"median", median(rest_mm)}, {"p95", quantile(rest_mm, 0.95)}}},
            {"moving_mm", {{"median", median(moving_mm)}, {"p95", quantile(moving_mm, 0.95)}}},
            {"lag_ms", 1e3 * along / std::max(squares, 1e-12)},
            {"states", states},
            {"overlapping", overlapping},
            {"not_standing", not_standing},
            {"impossible", impossible}};
  }
};

struct Records {
  Record last, estimate, feasible;
};

void judge(const World& world, std::size_t object, double time, const Estimate& estimate, Record& record) {
  const Eigen::Isometry3d X = transform({estimate.reading.position, estimate.reading.orientation});
  const Eigen::Isometry3d X_true = transform(world.pose(object, time));
  const Eigen::AngleAxisd turn(X_true.linear() * X.linear().transpose());
  Eigen::Matrix<double, 6, 1> off;
  off << X_true.translation() - X.translation(), turn.angle() * turn.axis();
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> covariance(estimate.covariance.data());
  ++record.judged;
  record.inside += off.dot(covariance.ldlt().solve(off)) < kNinetyFive;
}

void look(const World& world, double time, const Estimator& estimator, const std::map<std::string, Pose>& last,
          Records& records) {
  const std::vector<Estimate> estimates = estimator.at(time);
  const std::size_t count = world.scene().objects.size();
  if (estimates.size() < count || last.size() < count) return;
  std::vector<Pose> last_poses, poses;
  std::vector<physics_pool::MeasuredObject> measured;
  for (std::size_t i = 0; i < count; ++i) {
    const Estimate& estimate = estimates[i];  // by name, as the scene has them
    const Pose& as_it_came = last.at(estimate.reading.name);
    records.last.note(world, i, time, as_it_came.position);
    records.estimate.note(world, i, time, estimate.reading.position);
    judge(world, i, time, estimate, records.estimate);
    last_poses.push_back(as_it_came);
    poses.push_back({estimate.reading.position, estimate.reading.orientation});
    measured.push_back({estimate.reading.name, poses.back(), estimate.covariance});
  }
  std::vector<bool> stands(count, true);
  records.last.note_overlaps(world.scene(), last_poses, stands);
  records.estimate.note_overlaps(world.scene(), poses, stands);
  const auto nearest_result = physics_pool::nearest_state(world.scene(), measured);
  if (!nearest_result) {
    ++records.feasible.impossible;
    return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    poses[i] = (*nearest_result)[i].X_WB;
    stands[i] = (*nearest_result)[i].stands;
    records.feasible.note(world, i, time, poses[i].position);
    records.feasible.most_moved = std::max(records.feasible.most_moved, (*nearest_result)[i].moved);
  }
  records.feasible.note_overlaps(world.scene(), poses, stands);
}

void watch(const World& world, const Trouble& trouble, std::mt19937_64& random, Records& records) {
  const std::vector<Arrival> arrivals = Sensors(world, trouble, random).all();
  Estimator estimator;
  SourceClock clocks[kSensors];
  std::map<std::string, Pose> last;
  auto next = arrivals.begin();
  for (int tick = 0; tick * kTick < kDuration; ++tick) {
    const double time = tick * kTick;
    for (; next != arrivals.end() && next->arrival <= time; ++next) {
      // Every number is one: nothing is refused.
      (void)estimator.take(clocks[next->sensor].to_host(next->stamp, next->arrival), next->seen);
      for (const Sighting& sighting : next->seen) last[sighting.name] = sighting.explanations[0].X_WB;
    }
    if (time > kWarmUp) look(world, time, estimator, last, records);
  }
}

void print(const json& row) {
  fmt::print("{}\n", row["trouble"].get<std::string>());
  for (const char* who : {"last", "estimate", "feasible"}) {
    const json& it = row[who];
    fmt::print(
        "  {:<9} rest {:>6.2f} {:>6.2f} mm   moving {:>6.2f} {:>6.2f} mm   lag {:>5.1f} ms   overlapping {:>5}/{}\n",
        who, it["rest_mm"]["median"].get<double>(), it["rest_mm"]["p95"].get<double>(),
        it["moving_mm"]["median"].get<double>(), it["moving_mm"]["p95"].get<double>(), it["lag_ms"].get<double>(),
        it["overlapping"].get<int>(), it["states"].get<int>());
  }
  fmt::print("  in 95 % ellipsoid {:.1f} %, moved by at most {:.1f} sigma, impossible {}\n",
             100 * row["in_95_percent_ellipsoid"].get<double>(), row["most_moved_sigma"].get<double>(),
             row["feasible"]["impossible"].get<int>());
}

}  // namespace

Result<void> bench_estimator(const EstimatorBenchOptions& options) {
  options.line->expect(std::size(kTroubles) * static_cast<std::size_t>(options.worlds));
  std::mt19937_64 random(options.seed);
  json rows = json::array();
  for (const Trouble& trouble : kTroubles) {
    Records records;
    for (int i = 0; i < options.worlds; ++i) {
      if (options.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      watch(World(random), trouble, random, records);
      options.line->step();
    }
    rows.push_back({{"trouble", trouble.name},
                    {"noise_m", trouble.noise},
                    {"last", records.last.to_json()},
                    {"estimate", records.estimate.to_json()},
                    {"feasible", records.feasible.to_json()},
                    {"in_95_percent_ellipsoid",
                     static_cast<double>(records.estimate.inside) / std::max(records.estimate.judged, 1)},
                    {"most_moved_sigma", std::sqrt(records.feasible.most_moved)}});
  }
  options.line->end();
  for (const json& row : rows) print(row);
  if (options.json.empty()) return {};
  return common::write_results(options.json,
                               {{"worlds", options.worlds}, {"seed", options.seed}, {"results", std::move(rows)}});
}

namespace {

class EstimatorBenchmark final : public Benchmark {
 public:
  EstimatorBenchmark()
      : Benchmark("estimator",
                  "the estimate of objects against the last measurement: error, lag, overlaps, under every trouble",
                  "1 min", Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    app.add_option("--worlds", options_.worlds, "Worlds of each kind of trouble, 20 s each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.seed, "Of the worlds and of what sensors say of them");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_estimator(options_));
  }

  const char* unit() const override { return "worlds"; }

 private:
  EstimatorBenchOptions options_;
};

}  // namespace

std::unique_ptr<Benchmark> estimator_benchmark() { return std::make_unique<EstimatorBenchmark>(); }

}  // namespace jostle::studies
