#include "services/studies/bench/tags.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <array>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <vector>

#include "idl/types/transform.hpp"
#include "perception/estimator/estimator.hpp"
#include "perception/rendering/renderer.hpp"
#include "perception/tags/detector.hpp"
#include "perception/tags/pose.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/studies/bench/measurement.hpp"

namespace jostle::studies {
namespace {

using namespace perception;
using Eigen::Vector3d;
using nlohmann::json;

constexpr double kDistances[] = {0.6, 0.9, 1.4};  // m
constexpr int kColumns = 5, kRows = 3;            // of tags
constexpr double kSize = 0.05;                    // m
constexpr double kMostTilt = M_PI / 3;
constexpr double kNinetyFive = 12.592;  // chi-squared of 6 degrees of freedom
constexpr double kDegrees = 180 / M_PI;
constexpr int kLooks = 10;                // images of the same tags that one estimate is made of
constexpr double kLookPeriod = 1 / 30.0;  // s

// A lens of about 70 degrees with a common distortion.
Camera camera() {
  return {.name = "bench",
          .width = 1280,
          .height = 720,
          .fx = 905,
          .fy = 905,
          .cx = 639.5,
          .cy = 359.5,
          .distortion = {-0.12, 0.05, 0.0008, -0.0005, 0}};
}

// Tags in a grid that fills the image; the world is the camera's frame.
View draw_view(double distance, std::mt19937_64& random) {
  const Camera eye = camera();
  std::uniform_real_distribution<double> uniform(0, 1);
  View view;
  for (int i = 0; i < kColumns * kRows; ++i) {
    const int column = i % kColumns, row = i / kColumns;
    const double x = (column + 0.5 + 0.1 * (uniform(random) - 0.5)) / kColumns - 0.5;
    const double y = (row + 0.5 + 0.1 * (uniform(random) - 0.5)) / kRows - 0.5;
    Eigen::Isometry3d X_CT = Eigen::Isometry3d::Identity();
    X_CT.translation() = distance * Vector3d(0.95 * x * eye.width / eye.fx, 0.95 * y * eye.height / eye.fy, 1);
    const double about = 2 * M_PI * uniform(random);
    X_CT.rotate(Eigen::AngleAxisd(kMostTilt * uniform(random), Vector3d(std::cos(about), std::sin(about), 0)));
    X_CT.rotate(Eigen::AngleAxisd(2 * M_PI * uniform(random), Vector3d::UnitZ()));
    view.stickers.push_back({.id = i, .size = kSize, .X_WT = pose_of(X_CT)});
  }
  return view;
}

// What one detector did at one distance.
struct Record {
  std::vector<double> position_mm, rotation_deg;     // of every tag that was found
  std::vector<double> normalised;                    // squared errors by the covariance, of those that are not flipped
  std::vector<double> corner_squares;                // pixels^2 of a coordinate
  std::vector<double> cpu_ms, wall_ms;               // of every frame: detection and poses
  int shown = 0, found = 0, wrong = 0, flipped = 0;  // tags
};

double rotation_between(const Pose& a, const Pose& b) {
  return angle_between(a.orientation.data(), b.orientation.data());
}

double normalised_error(const Pose& pose, const std::array<double, 36>& of, const Pose& truth) {
  const Eigen::Isometry3d X = transform(pose), X_true = transform(truth);
  const Eigen::AngleAxisd turn(X_true.linear() * X.linear().transpose());
  Eigen::Matrix<double, 6, 1> off;
  off << X_true.translation() - X.translation(), turn.angle() * turn.axis();
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> covariance(of.data());
  return off.dot(covariance.ldlt().solve(off));
}

void note_corners(const Detection& seen, const Sticker& truth, Record& record) {
  const auto corners = tag_corners(truth.size);
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector3d p = transform(truth.X_WT) * Vector3d(corners[i].data());
    const Pixel pixel = project(camera(), {p.x(), p.y(), p.z()}).pixel;
    record.corner_squares.push_back(std::pow(seen.corners[i].x - pixel.x, 2));
    record.corner_squares.push_back(std::pow(seen.corners[i].y - pixel.y, 2));
  }
}

// `pose`, of this covariance, is what became of an estimate.
void note_pose(const Pose& pose, const std::array<double, 36>& covariance, const PoseEstimate& estimate,
               const Pose& truth, Record& record) {
  record.position_mm.push_back(1e3 * (transform(pose).translation() - transform(truth).translation()).norm());
  record.rotation_deg.push_back(kDegrees * rotation_between(pose, truth));
  const auto off = [&](const Fit& fit, const Pose& from) { return rotation_between(fit.X_CB, from); };
  if (estimate.other && (off(estimate.best, truth) < off(*estimate.other, truth)) !=
                            (off(estimate.best, pose) <= off(*estimate.other, pose))) {
    ++record.flipped;
  } else {
    record.normalised.push_back(normalised_error(pose, covariance, truth));
  }
}

void look(Detector& detector, const GreyImage& image, const View& view, Record& record) {
  std::vector<std::pair<Detection, Result<PoseEstimate>>> found;
  const auto begin = std::chrono::steady_clock::now();
  const double cpu = own_cpu_seconds();
  for (const Detection& detection : detector.detect(image)) {
    const TagView tag{.corners = detection.corners, .size = kSize};
    found.emplace_back(detection, estimate_pose(camera(), {&tag, 1}));
  }
  record.cpu_ms.push_back(1e3 * (own_cpu_seconds() - cpu));
  record.wall_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  record.shown += static_cast<int>(view.stickers.size());
  for (const auto& [detection, estimate] : found) {
    if (detection.id >= static_cast<int>(view.stickers.size()) || !estimate) {
      ++record.wrong;
      continue;
    }
    ++record.found;
    const Sticker& truth = view.stickers[static_cast<std::size_t>(detection.id)];
    note_corners(detection, truth, record);
    note_pose(estimate->best.X_CB, estimate->covariance, *estimate, truth.X_WT, record);
  }
}

Sighting sighting_of(int id, const PoseEstimate& estimate) {
  Sighting sighting{.name = std::to_string(id),
                    .explanations = {{.X_WB = estimate.best.X_CB, .covariance = estimate.covariance}},
                    .steady = kSteadyShare};
  if (estimate.other) {
    sighting.explanations.push_back({.X_WB = estimate.other->X_CB,
                                     .covariance = estimate.covariance,
                                     .surprise = surprise_of(*estimate.other, estimate)});
  }
  return sighting;
}

// What the estimator makes of tags at rest in several images, whose noise alone differs.
Result<void> look_again(Detector& detector, const SceneCamera& eye, const View& view, std::mt19937_64& random,
                        Record& record) {
  Estimator estimator;
  std::map<std::string, PoseEstimate> newest;
  double time = 0.0;
  for (int i = 0; i < kLooks; ++i, time += kLookPeriod) {
    const GreyImage image = eye.render(view, random());
    const double cpu = own_cpu_seconds();
    std::vector<Sighting> sightings;
    for (const Detection& detection : detector.detect(image)) {
      const TagView tag{.corners = detection.corners, .size = kSize};
      const auto estimate = estimate_pose(camera(), {&tag, 1});
      if (detection.id >= static_cast<int>(view.stickers.size()) || !estimate) continue;
      sightings.push_back(sighting_of(detection.id, *estimate));
      newest.insert_or_assign(sightings.back().name, *estimate);
    }
    if (auto ok = estimator.take(time, sightings); !ok) return ok;
    record.cpu_ms.push_back(1e3 * (own_cpu_seconds() - cpu));
  }
  record.shown += static_cast<int>(view.stickers.size());
  for (const Estimate& estimate : estimator.at(time)) {
    ++record.found;
    const Pose& truth = view.stickers[static_cast<std::size_t>(std::stoi(estimate.reading.name))].X_WT;
    note_pose({.position = estimate.reading.position, .orientation = estimate.reading.orientation}, estimate.covariance,
              newest.at(estimate.reading.name), truth, record);
  }
  return {};
}

json to_json(const Record& record) {
  using common::median;
  using common::quantile;
  const double found = std::max(record.found, 1);
  const auto inside = std::ranges::count_if(record.normalised, [](double value) { return value < kNinetyFive; });
  double squares = 0;
  for (const double square : record.corner_squares) squares += square;
  return {{"shown", record.shown},
          {"found", record.found},
          {"no_such_tag", record.wrong},
          {"flipped_share", record.flipped / found},
          {"position_mm", {{"median", median(record.position_mm)}, {"p95", quantile(record.position_mm, 0.95)}}},
          {"rotation_deg", {{"median", median(record.rotation_deg)}, {"p95", quantile(record.rotation_deg, 0.95)}}},
          {"corner_rms_px", std::sqrt(squares / std::max(static_cast<double>(record.corner_squares.size()), 1.0))},
          {"normalised_error_median", median(record.normalised)},  // of chi-squared, 6 degrees: 5.35
          {"in_95_percent_ellipsoid",
           static_cast<double>(inside) / std::max(static_cast<double>(record.normalised.size()), 1.0)},
          {"cpu_ms", {{"median", median(record.cpu_ms)}, {"p95", quantile(record.cpu_ms, 0.95)}}},
          {"wall_ms",
           {{"median", common::number_or_null(median(record.wall_ms))},
            {"p95", common::number_or_null(quantile(record.wall_ms, 0.95))}}}};
}

void print(const json& row) {
  fmt::print(
      "{:<10} {:>4.1f} m  {:>4}/{:<4} {:>6.2f} {:>6.2f} mm  {:>5.2f} {:>6.2f} deg  {:>5.1f} % flipped  {:>5.1f} % in "
      "95 %  {:>5.3f} px  {:>5.1f} ms CPU\n",
      row["settings"].get<std::string>(), row["distance_m"].get<double>(), row["found"].get<int>(),
      row["shown"].get<int>(), row["position_mm"]["median"].get<double>(), row["position_mm"]["p95"].get<double>(),
      row["rotation_deg"]["median"].get<double>(), row["rotation_deg"]["p95"].get<double>(),
      100 * row["flipped_share"].get<double>(), 100 * row["in_95_percent_ellipsoid"].get<double>(),
      row["corner_rms_px"].get<double>(), row["cpu_ms"]["median"].get<double>());
}

}  // namespace

Result<void> bench_tags(const TagsOptions& options) {
  options.line->expect(std::size(kDistances) * static_cast<std::size_t>(options.frames));
  const SceneCamera eye(camera());
  struct Contender {
    const char* name;
    Detector detector;
  };
  std::vector<Contender> contenders;
  contenders.push_back({"ours", Detector()});
  contenders.push_back({"all pixels", Detector({.decimation = 1.0})});
  contenders.push_back({"defaults", Detector({.decimation = 2.0, .correctable_bits = 2, .least_contrast = 5})});
  std::mt19937_64 random(options.seed);
  json rows = json::array();
  for (const double distance : kDistances) {
    std::vector<Record> records(contenders.size());
    Record estimates;
    for (int frame = 0; frame < options.frames; ++frame) {
      if (options.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      const View view = draw_view(distance, random);
      const GreyImage image = eye.render(view, random());
      for (std::size_t i = 0; i < contenders.size(); ++i) look(contenders[i].detector, image, view, records[i]);
      if (auto ok = look_again(contenders[0].detector, eye, view, random, estimates); !ok) return ok;
      options.line->step();
    }
    const auto add = [&](const char* name, const Record& record) {
      rows.push_back(to_json(record));
      rows.back()["settings"] = name;
      rows.back()["distance_m"] = distance;
    };
    for (std::size_t i = 0; i < contenders.size(); ++i) add(contenders[i].name, records[i]);
    add("estimate", estimates);
  }
  options.line->end();
  for (const json& row : rows) print(row);
  if (options.json.empty()) return {};
  return common::write_results(options.json, {{"frames", options.frames},
                                              {"seed", options.seed},
                                              {"tag_size_m", kSize},
                                              {"corner_sigma_px", kCornerSigma},
                                              {"results", std::move(rows)}});
}

namespace {

class Tags final : public Benchmark {
 public:
  Tags()
      : Benchmark(
            "tags",
            "poses of tags in rendered images, before and after the estimator: errors, flips, honest covariances, time",
            "1 min", Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    app.add_option("--frames", options_.frames, "Frames of 15 tags at each of three distances")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.seed, "Of the tags' poses and the images' noise");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_tags(options_));
  }

  const char* unit() const override { return "frames"; }

 private:
  TagsOptions options_;
};

}  // namespace

std::unique_ptr<Benchmark> tags_benchmark() { return std::make_unique<Tags>(); }

}  // namespace jostle::studies
