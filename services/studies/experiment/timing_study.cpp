#include "services/studies/experiment/timing_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/levels.hpp"
#include "physics_pool/parareal/parareal_pool.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/files.hpp"
#include "services/studies/experiment/prediction_study.hpp"

namespace jostle::studies {
namespace {

using namespace physics_pool;

constexpr std::chrono::minutes kPatience{5};

class TimingStudy final : public Study {
 public:
  explicit TimingStudy(yaml::Fields& fields) {
    fields.required("title", title_);
    fields.optional("model", model_);
    fields.optional("runs", runs_);
    fields.optional("actions", actions_);
    fields.optional("threads", threads_);
  }

  const std::string& title() const override { return title_; }

  Result<StudyReport> run(const StudyOptions& options) override {
    if (!options.levels.empty() || !options.controllers.empty() || options.timeout || options.seeds ||
        options.models.size() > 1) {
      return Error{Code::kInvalidArgument,
                   "this study has no --levels, --controllers, --timeout or --seeds, wanted "
                   "one of --models, --samples"};
    }
    const std::string model = common::coarse_model_name(options.models.empty() ? model_ : options.models.front());
    const int runs = options.samples.value_or(runs_);
    const int threads = threads_ > 0 ? threads_ : options.jobs;
    PredictionCases cases = make_cases({.cases = PredictionStudy::Cases::kExamples, .actions = {actions_}});
    const auto found = std::ranges::find(cases.cases, "box side", &PredictionCase::group);
    const Scene& scene = cases.scenes[found->scene];
    const RolloutBatch& batch = found->batch;

    ThreadPool one(1), many(threads);
    if (auto ok = one.load(scene); !ok) return ok.error();
    // One of each in turn, so that what slows the machine slows all alike.
    std::vector<std::unique_ptr<PararealPool>> predictors;
    for (int k = 1; k <= actions_; ++k) {
      predictors.push_back(
          std::make_unique<PararealPool>(many, PararealOptions{.model = model, .stop = {.iterations = k}}));
      if (auto ok = predictors.back()->load(scene); !ok) return ok.error();
    }
    std::vector<std::vector<double>> times(predictors.size() + 1);  // ms; the last is the fine model's
    std::vector<double> slices;                                     // ms
    for (int run = -1; run < runs; ++run) {                         // the first one is not counted
      for (std::size_t i = 0; i <= predictors.size(); ++i) {
        Pool& pool = i < predictors.size() ? static_cast<Pool&>(*predictors[i]) : one;
        auto time_result = time(pool, batch, options.stop);
        if (!time_result) return time_result.error();
        if (run >= 0) times[i].push_back(*time_result);
      }
      auto slice_result = time(one, slice_batch(batch, batch.x0, batch.nominal.step(0)), options.stop);
      if (!slice_result) return slice_result.error();
      if (run >= 0) slices.push_back(*slice_result);
      if (run >= 0 && (run + 1) % std::max(runs / 10, 1) == 0)
        options.on_progress(fmt::format("[{:>4}/{}] runs", run + 1, runs));
    }
    auto coarse_result = time_coarse(model, scene, batch);
    if (!coarse_result) return coarse_result.error();
    return report(times, common::median(slices), *coarse_result, threads, runs);
  }

 private:
  static Result<double> time(Pool& pool, const RolloutBatch& batch, std::stop_token stop) {
    const auto start = std::chrono::steady_clock::now();
    auto reply_result = pool.run(batch, start + kPatience, stop);
    if (!reply_result) return reply_result.error();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  }

  static Result<double> time_coarse(const std::string& model, const Scene& scene, const RolloutBatch& batch) {
    auto coarse_result = make_coarse_model(model, scene);
    if (!coarse_result) return coarse_result.error();
    std::vector<double> x(static_cast<std::size_t>((*coarse_result)->layout().size()));
    constexpr int kRepeats = 200;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < kRepeats; ++i) {
      to_planar(layout_of(scene), batch.x0, x);
      (*coarse_result)->advance(x, batch.nominal.step(0), batch.step_duration);
    }
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count() / kRepeats;
  }

  StudyReport report(const std::vector<std::vector<double>>& times, double fine, double coarse, int threads,
                     int runs) const {
    StudyReport result;
    const common::Mean serial = common::mean_of(times.back());
    result.table = fmt::format("{}\n\n{:<22}{:<20}{:<18}{}\n", title_, "predictor", "time, ms", "Eq. 6.4, ms",
                               "share of the fine model's");
    result.json = {{"title", title_},
                   {"model", model_},
                   {"threads", threads},
                   {"runs", runs},
                   {"c_c_ms", coarse},
                   {"c_f_ms", fine},
                   {"rows", nlohmann::json::array()}};
    common::Band measured{.name = "measured"}, expected{.name = "Eq. 6.4"};
    for (std::size_t i = 0; i < times.size(); ++i) {
      const bool is_fine = i + 1 == times.size();
      const int k = static_cast<int>(i) + 1;
      const common::Mean mean = common::mean_of(times[i]);
      const double theory =
          is_fine ? actions_ * fine : actions_ * fine / parareal_speed_up(k, threads, actions_, coarse, fine);
      const std::string name = is_fine ? "fine, serial" : fmt::format("Parareal, K = {}", k);
      result.table +=
          fmt::format("{:<22}{:<20}{:<18.2f}{:.2f}\n", name,
                      fmt::format("{:.2f} ± {:.2f}", mean.value, mean.half_width), theory, mean.value / serial.value);
      result.json["rows"].push_back({{"predictor", name},
                                     {"iteration", is_fine ? 0 : k},
                                     {"ms", mean.value},
                                     {"ms_half_width", mean.half_width},
                                     {"ms_by_eq_6_4", theory},
                                     {"share", mean.value / serial.value}});
      if (is_fine) continue;
      measured.x.push_back(k);
      measured.low.push_back(mean.value - mean.half_width);
      measured.middle.push_back(mean.value);
      measured.high.push_back(mean.value + mean.half_width);
      expected.x.push_back(k);
      for (auto* line : {&expected.low, &expected.middle, &expected.high}) line->push_back(theory);
    }
    common::Band level{.name = "fine, serial", .x = measured.x};
    for (std::size_t i = 0; i < level.x.size(); ++i) {
      level.low.push_back(serial.value - serial.half_width);
      level.middle.push_back(serial.value);
      level.high.push_back(serial.value + serial.half_width);
    }
    result.panels = {
        {.x_label = "iterations K", .y_label = "prediction time, ms", .bands = {measured, expected, level}}};
    result.table += fmt::format(
        "\n{} slices on {} threads, coarse model {}; means of {} runs with 95 % intervals. Iterations skip what has\n"
        "converged, which Eq. 6.4 does not count. The thesis: 28 % with K = 1 on 4 cores.\n",
        actions_, threads, model_, runs);
    return result;
  }

  std::string title_, model_ = "planar";
  int runs_ = 100, actions_ = 4;
  int threads_ = 0;  // 0: as many as --jobs
};

}  // namespace

Result<std::unique_ptr<Study>> read_timing_study(yaml::Fields& fields, const std::string&) {
  return std::unique_ptr<Study>(std::make_unique<TimingStudy>(fields));
}

}  // namespace jostle::studies
