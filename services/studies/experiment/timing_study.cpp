#include "services/studies/experiment/timing_study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <vector>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/levels.hpp"
#include "physics_pool/parareal/parareal_pool.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/studies/experiment/options.hpp"
#include "services/studies/experiment/prediction_study.hpp"

namespace jostle::studies {
namespace {

using namespace physics_pool;
using nlohmann::json;

constexpr std::chrono::minutes kPatience{5};

class TimingStudy final : public Study {
 public:
  explicit TimingStudy(yaml::Fields& fields) : Study(read_about(fields)) {
    fields.optional("model", model_);
    fields.optional("runs", runs_);
    fields.optional("actions", actions_);
    fields.optional("threads", threads_);
  }

  void add_options(CLI::App& app) override {
    if (threads_ == 0) add_jobs_option(app, threads_, "Threads of Parareal");
    app.add_option("--models", model_, "Coarse model, such as planar")->capture_default_str();
    app.add_option("--samples", runs_, "Runs of each predictor")->capture_default_str()->check(CLI::Range(1, 100000));
  }

  Result<std::vector<std::string>> prepare() override {
    cases_ = make_cases({.cases = PredictionStudy::Cases::kExamples, .actions = {actions_}});
    const auto found = std::ranges::find(cases_.cases, "box side", &PredictionCase::group);
    scene_ = cases_.scenes[found->scene];
    batch_ = found->batch;
    predictors_.clear();
    one_ = std::make_unique<ThreadPool>(1);
    many_ = std::make_unique<ThreadPool>(threads_);
    if (auto ok = one_->load(scene_); !ok) return ok.error();
    for (int k = 1; k <= actions_; ++k) {
      predictors_.push_back(std::make_unique<PararealPool>(
          *many_, PararealOptions{.model = common::coarse_model_name(model_), .stop = {.iterations = k}}));
      if (auto ok = predictors_.back()->load(scene_); !ok) return ok.error();
    }
    is_warm_ = false;
    std::vector<std::string> names;
    for (int run = 1; run <= runs_; ++run) names.push_back(fmt::format("run {}", run));
    return names;
  }

  json settings() const override { return {{"model", model_}, {"threads", threads_}}; }

  // One of each in turn, so that what slows the machine slows all alike.
  Result<json> run_case(std::size_t, std::stop_token stop) override {
    if (!is_warm_) {
      if (auto ok = time_all(stop); !ok) return ok;
      is_warm_ = true;
    }
    return time_all(stop);
  }

  std::string news_of(const json& run) const override {
    return fmt::format("K = 1 in {:.1f} ms", run["ms"][0].get<double>());
  }

  StudyReport report(const std::vector<json>& records) const override {
    std::vector<std::vector<double>> times(static_cast<std::size_t>(actions_) + 1);  // ms; the last is the fine model's
    std::vector<double> slices, coarse;                                              // ms
    for (const json& record : records) {
      if (record.is_null() || record.contains("error")) continue;
      for (std::size_t i = 0; i < times.size(); ++i) times[i].push_back(record["ms"][i]);
      slices.push_back(record["slice_ms"]);
      coarse.push_back(record["coarse_ms"]);
    }
    return report_of(times, common::median(slices), common::median(coarse));
  }

  bool has_figure() const override { return true; }

  std::vector<common::Panel> figure(const json& report) const override {
    common::Band measured{.name = "measured"}, expected{.name = "Eq. 6.4"}, level{.name = "fine, serial"};
    const auto add = [](common::Band& band, double x, double value, double half_width) {
      band.x.push_back(x);
      band.low.push_back(value - half_width);
      band.middle.push_back(value);
      band.high.push_back(value + half_width);
    };
    const json& rows = report.at("rows");
    const json& fine = rows.back();  // iteration 0: none
    for (const json& row : rows) {
      const double k = row.at("iteration");
      if (k == 0 || row.at("ms").is_null()) continue;
      add(measured, k, row.at("ms"), number(row.at("ms_half_width")));
      add(expected, k, row.at("ms_by_eq_6_4"), common::kNone);
      add(level, k, fine.at("ms"), number(fine.at("ms_half_width")));
    }
    if (measured.x.empty()) return {};
    return {{.x_label = "iterations K",
             .y_label = "prediction time, ms",
             .bands = {measured, expected, level},
             .counts_x = true}};
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

  Result<json> time_all(std::stop_token stop) {
    json ms = json::array();
    for (std::size_t i = 0; i <= predictors_.size(); ++i) {
      Pool& pool = i < predictors_.size() ? static_cast<Pool&>(*predictors_[i]) : *one_;
      auto time_result = time(pool, batch_, stop);
      if (!time_result) return time_result.error();
      ms.push_back(*time_result);
    }
    auto slice_result = time(*one_, slice_batch(batch_, batch_.x0, batch_.nominal.step(0)), stop);
    if (!slice_result) return slice_result.error();
    auto coarse_result = time_coarse(common::coarse_model_name(model_), scene_, batch_);
    if (!coarse_result) return coarse_result.error();
    return json{{"ms", std::move(ms)}, {"slice_ms", *slice_result}, {"coarse_ms", *coarse_result}};
  }

  static double number(const json& value) { return value.is_null() ? common::kNone : value.get<double>(); }

  StudyReport report_of(const std::vector<std::vector<double>>& times, double fine, double coarse) const {
    StudyReport result;
    const common::Mean serial = common::mean_of(times.back());
    result.json = {{"title", title()},
                   {"model", model_},
                   {"threads", threads_},
                   {"runs", serial.count},
                   {"c_c_ms", common::number_or_null(coarse)},
                   {"c_f_ms", common::number_or_null(fine)},
                   {"rows", json::array()}};
    std::vector<std::vector<std::string>> lines{{"predictor", "time, ms", "Eq. 6.4, ms", "share of the fine model's"}};
    for (std::size_t i = 0; i < times.size(); ++i) {
      const bool is_fine = i + 1 == times.size();
      const int k = static_cast<int>(i) + 1;
      const common::Mean mean = common::mean_of(times[i]);
      const double theory =
          is_fine ? actions_ * fine : actions_ * fine / parareal_speed_up(k, threads_, actions_, coarse, fine);
      const double share = mean.value / serial.value;
      const std::string name = is_fine ? "fine, serial" : fmt::format("Parareal, K = {}", k);
      lines.push_back({name, to_text(mean, 2), common::number_text(theory, 2), common::number_text(share, 2)});
      result.json["rows"].push_back({{"predictor", name},
                                     {"iteration", is_fine ? 0 : k},
                                     {"ms", common::number_or_null(mean.value)},
                                     {"ms_half_width", common::number_or_null(mean.half_width)},
                                     {"ms_by_eq_6_4", common::number_or_null(theory)},
                                     {"share", common::number_or_null(share)}});
    }
    result.table = fmt::format(
        "{}\n\n{}\n{} slices on {} threads, coarse model {}; means of {} runs, and 95 % intervals of the mean\n"
        "where there are two or more. Iterations skip what has converged, which Eq. 6.4 does not count.\n"
        "The thesis: 28 % with K = 1 on 4 cores.\n",
        title(), common::table(lines), actions_, threads_, model_, serial.count);
    return result;
  }

  std::string model_ = "planar";
  int runs_ = 100, actions_ = 4;
  int threads_ = 0;  // 0: one for each processor, or as --jobs says
  PredictionCases cases_;
  Scene scene_;
  RolloutBatch batch_;
  std::unique_ptr<ThreadPool> one_, many_;
  std::vector<std::unique_ptr<PararealPool>> predictors_;  // with 1, 2, … iterations
  bool is_warm_ = false;                                   // the first run of all is not counted
};

}  // namespace

Result<std::unique_ptr<Study>> read_timing_study(yaml::Fields& fields, const std::string&) {
  return std::unique_ptr<Study>(std::make_unique<TimingStudy>(fields));
}

}  // namespace jostle::studies
