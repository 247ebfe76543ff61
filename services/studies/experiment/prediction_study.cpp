#include "services/studies/experiment/prediction_study.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>
#include <numbers>

#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/levels.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/files.hpp"
#include "services/common/terminal/progress_line.hpp"

namespace jostle::studies {
namespace {

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

// What one case gave with one model; empty if nothing was pushed.
struct Made {
  std::vector<Distance> levels;  // [N + 1], from the truth
  double moved = 0.0;            // m, mean over sliders, in truth
  std::string problem;
};

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

Made make(const PredictionStudy& study, const PredictionCases& cases, std::size_t index, const std::string& model,
          physics_pool::Pool& pool, std::stop_token stop) {
  const PredictionCase& one = cases.cases[index];
  const Scene& scene = cases.scenes[one.scene];
  auto coarse_result = physics_pool::make_coarse_model(common::coarse_model_name(model), scene);
  if (!coarse_result) return {.problem = coarse_result.error().message};
  const physics_pool::PlanarUpdate update(scene);
  auto levels_result = physics_pool::predict_levels(pool, one.batch, update, **coarse_result,
                                                    std::chrono::steady_clock::now() + kPatience, stop);
  if (!levels_result) return {.problem = levels_result.error().message};
  Trajectory truth = levels_result->back();
  if (study.reality != physics_pool::Uncertainty::kNone) {
    auto real_result = happen(study, scene, one.batch, study.seed + index);
    if (!real_result) return {.problem = real_result.error().message};
    truth = std::move(real_result).value();
  }
  Made made;
  double farthest = 0.0;
  for (const ObjectSlot& slot : update.layout().objects) {
    const auto q = static_cast<std::size_t>(slot.q);
    const double way =
        std::hypot(truth.back().q[q] - truth.front().q[q], truth.back().q[q + 1] - truth.front().q[q + 1]);
    farthest = std::max(farthest, way);
    made.moved += way / static_cast<double>(update.layout().objects.size());
  }
  if (farthest < kMoved) return made;
  for (const Trajectory& level : *levels_result) made.levels.push_back(distance(update.layout(), level, truth));
  return made;
}

// All cases of one group with one model.
struct Cell {
  std::string group, model;
  std::vector<const Made*> made;

  int iterations() const { return static_cast<int>(made.front()->levels.size()) - 1; }

  template <class Value>
  std::vector<double> values(int k, Value value) const {
    std::vector<double> result;
    for (const Made* one : made) result.push_back(value(one->levels[static_cast<std::size_t>(k)]));
    return result;
  }
};

double translation(const Distance& d) { return d.translation_mm; }
double rotation(const Distance& d) { return d.rotation_deg; }
double positions(const Distance& d) { return d.positions_mm; }
double state(const Distance& d) { return d.state; }

class PredictionStudyRunner final : public Study {
 public:
  explicit PredictionStudyRunner(PredictionStudy study) : study_(std::move(study)) {}

  const std::string& title() const override { return study_.title; }

  Result<StudyReport> run(const StudyOptions& options) override {
    if (!options.levels.empty() || !options.controllers.empty() || options.timeout) {
      return Error{Code::kInvalidArgument,
                   "this study has no --levels, --controllers or --timeout, wanted --models, "
                   "--samples, --seeds FIRST"};
    }
    PredictionStudy study = study_;
    if (!options.models.empty()) study.models = options.models;
    if (options.samples) study.samples = *options.samples;
    if (options.seeds) study.seed = options.seeds->first;
    const PredictionCases cases = make_cases(study);
    physics_pool::ThreadPool pool(options.jobs);
    for (const Scene& scene : cases.scenes) {
      if (auto ok = pool.load(scene); !ok) return ok.error();
      for (const std::string& model : study.models) {
        if (auto ok = physics_pool::make_coarse_model(common::coarse_model_name(model), scene); !ok) return ok.error();
      }
    }

    const std::size_t total = cases.cases.size() * study.models.size();
    std::vector<Made> made(total);
    std::mutex reporting;
    std::size_t done = 0;
    const auto start = std::chrono::steady_clock::now();
    run_side_by_side(total, options.jobs, options.stop, [&](std::size_t i) {
      const std::size_t m = i % study.models.size();
      made[i] = make(study, cases, i / study.models.size(), study.models[m], pool, options.stop);
      const std::lock_guard lock(reporting);
      ++done;
      if (done % std::max<std::size_t>(total / 20, 1) != 0) return;
      const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      options.on_progress(common::progress_text("predictions", done, total, seconds));
    });
    if (options.stop.stop_requested()) return Error{Code::kCancelled, "experiment: stopped on request"};
    return report(study, cases, made);
  }

 private:
  static StudyReport report(const PredictionStudy& study, const PredictionCases& cases, const std::vector<Made>& made) {
    StudyReport result;
    std::map<std::pair<std::string, std::size_t>, Cell> cells;  // by group and model, groups in order of name
    std::vector<std::string> groups;
    int idle = 0;
    for (std::size_t i = 0; i < made.size(); ++i) {
      const PredictionCase& one = cases.cases[i / study.models.size()];
      const std::size_t model = i % study.models.size();
      if (!made[i].problem.empty()) {
        result.broken = true;
        result.table += fmt::format("FAILED: {}, {}: {}\n", one.group, study.models[model], made[i].problem);
        continue;
      }
      if (made[i].levels.empty()) {
        idle += model == 0 ? 1 : 0;
        continue;
      }
      if (std::ranges::find(groups, one.group) == groups.end()) groups.push_back(one.group);
      Cell& cell = cells[{one.group, model}];
      cell.group = one.group;
      cell.model = study.models[model];
      cell.made.push_back(&made[i]);
    }
    result.table = study.title + "\n" + result.table;
    result.json = {{"title", study.title}, {"models", nlohmann::json::array()}};
    for (const std::string& group : groups) {
      std::vector<Cell> row;
      for (std::size_t m = 0; m < study.models.size(); ++m) {
        if (const auto found = cells.find({group, m}); found != cells.end()) row.push_back(found->second);
      }
      add_group(study, row, result);
    }
    if (idle > 0)
      result.table += fmt::format("\n{} of {} cases left out: nothing was pushed.\n", idle, cases.cases.size());
    result.table += "\nMeans over the cases with 95 % intervals of the mean.\n";
    if (!study.remark.empty()) result.table += study.remark + "\n";
    // What a reader of one model finds at the top.
    if (!result.json["models"].empty()) {
      result.json["model"] = result.json["models"][0]["model"];
      result.json["rows"] = result.json["models"][0]["rows"];
    }
    return result;
  }

  static void add_group(const PredictionStudy& study, const std::vector<Cell>& row, StudyReport& result) {
    std::vector<double> moved;
    for (const Made* one : row.front().made) moved.push_back(1e3 * one->moved);
    const common::Mean way = common::mean_of(moved);
    double squares = 0.0;
    for (const double mm : moved) squares += (mm - way.value) * (mm - way.value);
    const double deviation = moved.size() > 1 ? std::sqrt(squares / static_cast<double>(moved.size() - 1)) : 0.0;
    result.table +=
        fmt::format("\n{}{} predictions per model; sliders moved {:.0f} ± {:.0f} mm\n",
                    row.front().group.empty() ? "" : row.front().group + ": ", moved.size(), way.value, deviation);
    result.table += fmt::format("{:<16}{:<11}{:<20}{:<20}{:<22}{}\n", "model", "iteration", "translation, mm",
                                "rotation, deg", "RMS positions, mm", "thesis, mm and deg");
    common::Panel panel{.x_label = (row.front().group.empty() ? "" : row.front().group + ": ") + "iteration",
                        .y_label = label(study.measure),
                        .log_y = true};
    for (const Cell& cell : row) {
      nlohmann::json entry{{"model", cell.model},
                           {"group", cell.group},
                           {"predictions", cell.made.size()},
                           {"moved_mm", way.value},
                           {"moved_deviation_mm", deviation}};
      common::Band band{.name = cell.model};
      for (int k = 0; k <= cell.iterations(); ++k) {
        const common::Mean mm = common::mean_of(cell.values(k, translation)),
                           deg = common::mean_of(cell.values(k, rotation));
        const common::Mean rms = common::mean_of(cell.values(k, positions)),
                           whole = common::mean_of(cell.values(k, state));
        std::string thesis = "-";
        const auto at = static_cast<std::size_t>(k);
        if (at < study.thesis_trans_mm.size() && at < study.thesis_rot_deg.size() && cell.model == study.models[0]) {
          thesis = fmt::format("{:.2f} / {:.2f}", study.thesis_trans_mm[at], study.thesis_rot_deg[at]);
        }
        result.table += fmt::format("{:<16}{:<11}{:<20}{:<20}{:<22}{}\n", k == 0 ? cell.model : "", k,
                                    fmt::format("{:.2f} ± {:.2f}", mm.value, mm.half_width),
                                    fmt::format("{:.2f} ± {:.2f}", deg.value, deg.half_width),
                                    fmt::format("{:.2f} ± {:.2f}", rms.value, rms.half_width), thesis);
        std::vector<double> by_slider;
        for (std::size_t i = 0; i < cell.made.front()->levels.front().by_slider_mm.size(); ++i) {
          by_slider.push_back(
              common::mean_of(cell.values(k, [i](const Distance& d) { return d.by_slider_mm[i]; })).value);
        }
        entry["rows"].push_back({{"iteration", k},
                                 {"trans_mm", mm.value},
                                 {"trans_mm_half_width", mm.half_width},
                                 {"rot_deg", deg.value},
                                 {"rot_deg_half_width", deg.half_width},
                                 {"rms_positions_mm", rms.value},
                                 {"rms_positions_mm_half_width", rms.half_width},
                                 {"rms_state", whole.value},
                                 {"rms_state_half_width", whole.half_width},
                                 {"rms_by_slider_mm", by_slider}});
        const common::Mean& shown = study.measure == PredictionStudy::Measure::kFinal   ? mm
                                    : study.measure == PredictionStudy::Measure::kState ? whole
                                                                                        : rms;
        if (shown.value <= 0) continue;  // exact: nowhere on a logarithmic axis
        band.x.push_back(k);
        band.low.push_back(std::max(shown.value - shown.half_width, 0.1 * shown.value));
        band.middle.push_back(shown.value);
        band.high.push_back(shown.value + shown.half_width);
      }
      result.json["models"].push_back(std::move(entry));
      if (!band.x.empty()) panel.bands.push_back(std::move(band));
    }
    if (!panel.bands.empty()) result.panels.push_back(std::move(panel));
  }

  static std::string label(PredictionStudy::Measure measure) {
    switch (measure) {
      case PredictionStudy::Measure::kFinal:
        return "distance of last states, mm";
      case PredictionStudy::Measure::kPositions:
        return "RMS error of positions, mm";
      case PredictionStudy::Measure::kState:
        return "RMS error of states (m, rad, m/s, rad/s)";
    }
    return "";
  }

  PredictionStudy study_;
};

}  // namespace

Result<std::unique_ptr<Study>> read_prediction_study(yaml::Fields& fields, const std::string& origin) {
  using Cases = PredictionStudy::Cases;
  using Measure = PredictionStudy::Measure;
  using physics_pool::Shape;
  using physics_pool::Uncertainty;
  PredictionStudy study;
  fields.required("title", study.title);
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
