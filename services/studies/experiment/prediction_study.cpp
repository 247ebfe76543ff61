#include "services/studies/experiment/prediction_study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/levels.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/studies/experiment/options.hpp"

namespace jostle::studies {
namespace {

using nlohmann::json;
using physics_pool::PlanarLayout;
using physics_pool::Scene;

constexpr std::chrono::hours kPatience{24};
constexpr double kMoved = 0.001;  // m; a slider that came less far was not pushed

// How far one trajectory is from another.
struct Distance {
  double translation_mm = 0.0, rotation_deg = 0.0;  // of the last states, mean over sliders
  double positions_mm = 0.0;                        // RMS along the trajectory, all sliders
  double state = 0.0;                               // RMS along the trajectory, all entries
  std::vector<double> by_slider_mm;                 // RMS along the trajectory
};

Distance distance(const StateLayout& layout, const Trajectory& a, const Trajectory& b) {
  const PlanarLayout at{static_cast<int>(layout.objects.size())};
  const auto sliders = static_cast<std::size_t>(at.sliders);
  std::vector<double> p(static_cast<std::size_t>(at.size())), q = p;
  Distance result{.by_slider_mm = std::vector<double>(sliders, 0.0)};
  double squares = 0.0;
  const std::size_t steps = a.size() - 1;
  for (std::size_t n = 1; n <= steps; ++n) {
    physics_pool::to_planar(layout, a[n], p);
    physics_pool::to_planar(layout, b[n], q);
    result.translation_mm = result.rotation_deg = 0.0;
    for (std::size_t i = 0; i < sliders; ++i) {
      const auto pose = static_cast<std::size_t>(at.pose(static_cast<int>(i)));
      const auto velocity = static_cast<std::size_t>(at.velocity(static_cast<int>(i)));
      const double dx = p[pose] - q[pose], dy = p[pose + 1] - q[pose + 1];
      const double turn = std::remainder(p[pose + 2] - q[pose + 2], 2 * std::numbers::pi);
      const double range = std::hypot(dx, dy);
      result.by_slider_mm[i] += range * range;
      squares += dx * dx + dy * dy + turn * turn;
      for (std::size_t k = 0; k < 3; ++k) squares += std::pow(p[velocity + k] - q[velocity + k], 2);
      result.translation_mm += 1e3 * range / static_cast<double>(sliders);
      result.rotation_deg += std::abs(turn) * 180 / std::numbers::pi / static_cast<double>(sliders);
    }
  }
  double all = 0.0;
  for (double& mm : result.by_slider_mm) {
    all += mm;
    mm = 1e3 * std::sqrt(mm / static_cast<double>(steps));
  }
  const auto entries = static_cast<double>(steps * sliders);
  result.positions_mm = 1e3 * std::sqrt(all / entries);
  result.state = std::sqrt(squares / (6 * entries));
  return result;
}

json to_json(const Distance& d) {
  return {{"translation_mm", d.translation_mm},
          {"rotation_deg", d.rotation_deg},
          {"positions_mm", d.positions_mm},
          {"state", d.state},
          {"by_slider_mm", d.by_slider_mm}};
}

// The scene with everything where a state has it.
Scene located(const Scene& scene, const State& x) {
  Scene result = scene;
  const StateLayout layout = physics_pool::layout_of(scene);
  const PlanarLayout at{static_cast<int>(scene.objects.size())};
  std::vector<double> planar(static_cast<std::size_t>(at.size()));
  physics_pool::to_planar(layout, x, planar);
  result.robot.q = {planar[0], planar[1]};
  for (int i = 0; i < at.sliders; ++i) {
    auto& object = result.objects[static_cast<std::size_t>(i)];
    const auto pose = static_cast<std::size_t>(at.pose(i));
    object.x = planar[pose];
    object.y = planar[pose + 1];
    object.yaw = planar[pose + 2];
  }
  return result;
}

// What happens in a world that is not quite as believed (Sec. 7.4.3).
Result<Trajectory> happen(const PredictionStudy& study, const Scene& scene, const physics_pool::RolloutBatch& batch,
                          std::uint64_t seed) {
  const Scene real = physics_pool::perturb(located(scene, batch.x0), study.reality, seed);
  auto world_result = physics_pool::World::compile(real);
  if (!world_result) return world_result.error();
  physics_pool::ExecutionWorld world(*world_result,
                                     {.sigma = physics_pool::velocity_noise(study.reality), .seed = seed});
  Trajectory trajectory{world.state()};
  const long steps = std::lround(study.duration / study.time_step);
  for (int t = 0; t < batch.nominal.steps(); ++t) {
    world.begin(batch.nominal.step(t));
    for (long i = 0; i < steps; ++i) {
      if (auto ok = world.step(); !ok) return ok.error();
    }
    trajectory.push_back(world.state());
  }
  return trajectory;
}

// What one case gives with one model; no levels if nothing was pushed.
Result<json> predict(const PredictionStudy& study, const PredictionCases& cases, std::size_t index,
                     const std::string& model, physics_pool::Pool& pool, std::stop_token stop) {
  const PredictionCase& one = cases.cases[index];
  const Scene& scene = cases.scenes[one.scene];
  auto coarse_result = physics_pool::make_coarse_model(common::coarse_model_name(model), scene);
  if (!coarse_result) return coarse_result.error();
  const physics_pool::PlanarUpdate update(scene);
  auto levels_result = physics_pool::predict_levels(pool, one.batch, update, **coarse_result,
                                                    std::chrono::steady_clock::now() + kPatience, stop);
  if (!levels_result) return levels_result.error();
  Trajectory truth = levels_result->back();
  if (study.reality != physics_pool::Uncertainty::kNone) {
    auto real_result = happen(study, scene, one.batch, study.seed + index);
    if (!real_result) return real_result.error();
    truth = std::move(real_result).value();
  }
  double farthest = 0.0, sum = 0.0;
  for (const ObjectSlot& slot : update.layout().objects) {
    const auto q = static_cast<std::size_t>(slot.q);
    const double way =
        std::hypot(truth.back().q[q] - truth.front().q[q], truth.back().q[q + 1] - truth.front().q[q + 1]);
    farthest = std::max(farthest, way);
    sum += way;
  }
  json levels = json::array();
  if (farthest >= kMoved) {
    for (const Trajectory& level : *levels_result) levels.push_back(to_json(distance(update.layout(), level, truth)));
  }
  return json{{"group", one.group},
              {"model", model},
              {"moved_m", sum / static_cast<double>(update.layout().objects.size())},
              {"levels", std::move(levels)}};
}

// All cases of one group with one model.
struct Cell {
  std::string group, model;
  std::vector<const json*> made;

  std::size_t iterations() const { return made.front()->at("levels").size() - 1; }

  std::vector<double> values(std::size_t iteration, const char* key) const {
    std::vector<double> result;
    for (const json* one : made) result.push_back(one->at("levels")[iteration][key]);
    return result;
  }

  common::Mean mean(std::size_t iteration, const char* key) const { return common::mean_of(values(iteration, key)); }
};

constexpr const char *kTranslation = "translation_mm", *kRotation = "rotation_deg", *kPositions = "positions_mm",
                     *kState = "state", *kBySlider = "by_slider_mm";

class PredictionStudyRunner final : public Study {
 public:
  explicit PredictionStudyRunner(PredictionStudy study) : Study(study.about), study_(std::move(study)) {}

  void add_options(CLI::App& app) override {
    add_jobs_option(app, jobs_, "Predictions at a time");
    app.add_option("--models", study_.models, "Coarse models, such as planar,learned")
        ->delimiter(',')
        ->capture_default_str();
    if (study_.cases == PredictionStudy::Cases::kExamples) return;  // they are what they are
    app.add_option("--samples", study_.samples, "Initial states per group")
        ->capture_default_str()
        ->check(CLI::Range(1, 100000));
    app.add_option("--seeds", seed_, fmt::format("First seed of the initial states (default: {})", study_.seed));
  }

  Result<std::vector<std::string>> prepare() override {
    if (!seed_.empty()) {
      auto seeds_result = parse_seeds(seed_);
      if (!seeds_result) return seeds_result.error();
      study_.seed = seeds_result->first;
    }
    cases_ = make_cases(study_);
    pool_ = std::make_unique<physics_pool::ThreadPool>(jobs_);
    for (const Scene& scene : cases_.scenes) {
      if (auto ok = pool_->load(scene); !ok) return ok.error();
      for (const std::string& model : study_.models) {
        if (auto ok = physics_pool::make_coarse_model(common::coarse_model_name(model), scene); !ok) return ok.error();
      }
    }
    std::vector<std::string> names;
    for (std::size_t i = 0; i < cases_.cases.size(); ++i) {
      const std::string& group = cases_.cases[i].group;
      for (const std::string& model : study_.models) {
        names.push_back(fmt::format("{}state {}, {}", group.empty() ? "" : group + ", ", i, model));
      }
    }
    return names;
  }

  json settings() const override { return {{"samples", study_.samples}, {"seeds", seed_}}; }
  int at_a_time() const override { return jobs_; }

  Result<json> run_case(std::size_t index, std::stop_token stop) override {
    return predict(study_, cases_, index / study_.models.size(), study_.models[index % study_.models.size()], *pool_,
                   std::move(stop));
  }

  std::string news_of(const json&) const override { return "predicted"; }

  StudyReport report(const std::vector<json>& records) const override {
    StudyReport result{.table = title() + "\n", .json = {{"title", title()}, {"models", json::array()}}};
    std::size_t idle = 0, left = 0, broken = 0;
    for (const json& record : records) {
      if (record.is_null() || record.contains("error"))
        ++(record.is_null() ? left : broken);
      else if (record["levels"].empty())
        ++idle;
    }
    for (const std::string& group : groups_of(records)) add_group(rows_of(group, records), result);
    if (idle > 0)
      result.table +=
          fmt::format("\n{} of {} predictions left out: nothing was pushed.\n", idle, records.size() - left);
    if (broken > 0)
      result.table += fmt::format("\nParts of the system failed in {} more, which count nowhere.\n", broken);
    result.table += "\nMeans over the predictions, and 95 % intervals of the mean where there are two or more.\n";
    if (!study_.remark.empty()) result.table += study_.remark + "\n";
    result.json["left_out"] = idle;
    result.json["broken"] = broken;
    // What a reader of one model finds at the top.
    if (!result.json["models"].empty()) {
      result.json["model"] = result.json["models"][0]["model"];
      result.json["rows"] = result.json["models"][0]["rows"];
    }
    return result;
  }

  bool has_figure() const override { return true; }

  std::vector<common::Panel> figure(const json& report) const override {
    const std::string key = study_.measure == Measure::kFinal   ? "trans_mm"
                            : study_.measure == Measure::kState ? "rms_state"
                                                                : "rms_positions_mm";
    std::vector<common::Panel> panels;
    std::string group;
    for (const json& model : report.at("models")) {
      if (panels.empty() || model.at("group") != group) {
        group = model.at("group");
        panels.push_back({.x_label = (group.empty() ? "" : group + ": ") + "iteration",
                          .y_label = label(study_.measure),
                          .log_y = true,
                          .counts_x = true,
                          .zero = "exact"});
      }
      common::Band band{.name = model.at("model")};
      const bool has_interval = model.at("predictions") > 1;
      for (const json& row : model.at("rows")) {
        const double value = row.at(key),
                     half = has_interval ? row.at(key + "_half_width").get<double>() : common::kNone;
        band.x.push_back(row.at("iteration"));
        band.low.push_back(value - half);
        band.middle.push_back(value);
        band.high.push_back(value + half);
      }
      panels.back().bands.push_back(std::move(band));
    }
    return panels;
  }

 private:
  using Measure = PredictionStudy::Measure;

  // In the order of the cases; without those in which nothing was pushed.
  std::vector<std::string> groups_of(const std::vector<json>& records) const {
    std::vector<std::string> groups;
    for (const json& record : records) {
      if (!counts(record)) continue;
      const std::string group = record["group"];
      if (std::ranges::find(groups, group) == groups.end()) groups.push_back(group);
    }
    return groups;
  }

  std::vector<Cell> rows_of(const std::string& group, const std::vector<json>& records) const {
    std::vector<Cell> row;
    for (const std::string& model : study_.models) {
      Cell cell{.group = group, .model = model, .made = {}};
      for (const json& record : records) {
        if (counts(record) && record["group"] == group && record["model"] == model) cell.made.push_back(&record);
      }
      if (!cell.made.empty()) row.push_back(std::move(cell));
    }
    return row;
  }

  static bool counts(const json& record) {
    return !record.is_null() && !record.contains("error") && !record["levels"].empty();
  }

  std::string thesis_of(const Cell& cell, std::size_t iteration) const {
    const std::vector<double>&mm = study_.thesis_trans_mm, &deg = study_.thesis_rot_deg;
    if (iteration >= mm.size() || iteration >= deg.size() || cell.model != study_.models[0]) return "-";
    return fmt::format("{:.2f} / {:.2f}", mm[iteration], deg[iteration]);
  }

  void add_group(const std::vector<Cell>& row, StudyReport& result) const {
    const std::string& group = row.front().group;
    std::vector<double> moved;
    for (const json* one : row.front().made) moved.push_back(1e3 * one->at("moved_m").get<double>());
    const common::Mean way = common::mean_of(moved);
    double squares = 0.0;
    for (const double mm : moved) squares += (mm - way.value) * (mm - way.value);
    const double deviation =
        moved.size() > 1 ? std::sqrt(squares / static_cast<double>(moved.size() - 1)) : common::kNone;
    result.table +=
        fmt::format("\n{}{} predictions per model; sliders moved {} mm\n", group.empty() ? "" : group + ": ",
                    moved.size(), to_text(common::Mean{.value = way.value, .half_width = deviation}, 0));
    std::vector<std::vector<std::string>> lines{
        {"model", "iteration", "translation, mm", "rotation, deg", "RMS positions, mm", "thesis, mm and deg"}};
    for (const Cell& cell : row) {
      json entry{{"model", cell.model},
                 {"group", cell.group},
                 {"predictions", cell.made.size()},
                 {"moved_mm", way.value},
                 {"moved_deviation_mm", common::number_or_null(deviation)}};
      for (std::size_t k = 0; k <= cell.iterations(); ++k) {
        lines.push_back({k == 0 ? cell.model : std::string(), std::to_string(k), to_text(cell.mean(k, kTranslation), 2),
                         to_text(cell.mean(k, kRotation), 2), to_text(cell.mean(k, kPositions), 2),
                         thesis_of(cell, k)});
        json numbers{{"iteration", k}, {"rms_by_slider_mm", by_slider(cell, k)}};
        for (const auto& [name, key] : {std::pair{"trans_mm", kTranslation}, std::pair{"rot_deg", kRotation},
                                        std::pair{"rms_positions_mm", kPositions}, std::pair{"rms_state", kState}}) {
          const common::Mean mean = cell.mean(k, key);
          numbers[name] = mean.value;
          numbers[std::string(name) + "_half_width"] = common::number_or_null(mean.half_width);
        }
        entry["rows"].push_back(std::move(numbers));
      }
      result.json["models"].push_back(std::move(entry));
    }
    result.table += common::table(lines);
  }

  static std::vector<double> by_slider(const Cell& cell, std::size_t iteration) {
    std::vector<double> means;
    for (std::size_t i = 0; i < cell.made.front()->at("levels").front()[kBySlider].size(); ++i) {
      std::vector<double> values;
      for (const json* one : cell.made) values.push_back(one->at("levels")[iteration][kBySlider][i]);
      means.push_back(common::mean_of(values).value);
    }
    return means;
  }

  static std::string label(Measure measure) {
    switch (measure) {
      case Measure::kFinal:
        return "distance of last states, mm";
      case Measure::kPositions:
        return "RMS error of positions, mm";
      case Measure::kState:
        return "RMS error of states (m, rad, m/s, rad/s)";
    }
    return "";
  }

  PredictionStudy study_;
  int jobs_ = 1;
  std::string seed_;
  PredictionCases cases_;
  std::unique_ptr<physics_pool::ThreadPool> pool_;
};

}  // namespace

Result<std::unique_ptr<Study>> read_prediction_study(yaml::Fields& fields, const std::string& origin) {
  using Cases = PredictionStudy::Cases;
  using Measure = PredictionStudy::Measure;
  using physics_pool::Shape;
  using physics_pool::Uncertainty;
  PredictionStudy study{.about = read_about(fields)};
  fields.required("models", study.models);
  fields.choice<Cases>("cases", study.cases,
                       {{"open-loop", Cases::kOpenLoop}, {"examples", Cases::kExamples}, {"random", Cases::kRandom}});
  fields.choice<Measure>("measure", study.measure,
                         {{"final", Measure::kFinal}, {"positions", Measure::kPositions}, {"state", Measure::kState}});
  fields.choice<Shape>("shape", study.shape, {{"box", Shape::kBox}, {"cylinder", Shape::kCylinder}});
  fields.choice<Uncertainty>("reality", study.reality,
                             {{"none", Uncertainty::kNone},
                              {"low", Uncertainty::kLow},
                              {"medium", Uncertainty::kMedium},
                              {"high", Uncertainty::kHigh}});
  fields.optional("sliders", study.sliders);
  fields.optional("actions", study.actions);
  fields.optional("duration", study.duration);
  fields.optional("speed", study.speed);
  fields.optional("angles_deg", study.angles_deg);
  fields.optional("samples", study.samples);
  fields.optional("seed", study.seed);
  fields.optional("integrator", study.integrator);
  fields.optional("time_step", study.time_step);
  fields.optional("remark", study.remark);
  fields.section("thesis", false, [&](yaml::Fields& thesis) {
    thesis.optional("trans_mm", study.thesis_trans_mm);
    thesis.optional("rot_deg", study.thesis_rot_deg);
  });
  if (study.models.empty() || study.samples < 1) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got {} models and {} samples, wanted at least one of each",
                                                     origin, study.models.size(), study.samples)};
  }
  return std::unique_ptr<Study>(std::make_unique<PredictionStudyRunner>(std::move(study)));
}

}  // namespace jostle::studies
