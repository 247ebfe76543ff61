// jostle bag plot: recorded runs as charts.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <limits>

#include "services/bags/plot/curves.hpp"
#include "services/common/charts/gnuplot.hpp"
#include "services/common/charts/lanes.hpp"
#include "services/common/charts/plot.hpp"
#include "services/common/process/program.hpp"

namespace jostle::bags {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExample =
    "Examples\n"
    "  jostle bag plot run1                       run1.png: costs, distance, speeds and idle times\n"
    "  jostle bag plot run1 -o run1.pdf --goal chapter3-15-7-1\n"
    "Exit codes: 0 drawn, 2 wrong arguments, or a bag without such a run, 3 the picture cannot be written.";

int fail(const Error& error) {
  fmt::print(stderr, "jostle bag plot: {}\n", error.message);
  return error.code == Code::kInvalidArgument || error.code == Code::kNotFound ? common::kExitUsage
                                                                               : common::kExitBroken;
}

common::Band band_of(const std::string& name, const Curve* curve) {
  // Every panel has all names, for they share the legend; a name without values draws nothing.
  const bool is_drawn = curve != nullptr && !curve->time.empty();
  const std::vector<double> none{std::numeric_limits<double>::quiet_NaN()};
  const std::vector<double>& value = is_drawn ? curve->value : none;
  return {name, is_drawn ? curve->time : std::vector<double>{0.0}, value, value, value};
}

// A panel of curves, some of which may not belong into it.
common::Panel panel_of(const std::string& y_label, const Curve* cost, const Curve* target, const Curve* hand,
                       const Curve* robot = nullptr) {
  return {.x_label = "time on the world's clock (s)",
          .y_label = y_label,
          .bands = {band_of("plan", cost), band_of("target", target), band_of("hand", hand), band_of("robot", robot)}};
}

std::vector<common::Panel> panels_of(const RunCurves& curves) {
  const std::string distance = fmt::format("distance of the target to the {} (m)", curves.has_goal ? "goal" : "hand");
  return {panel_of("cost of the plan", &curves.cost, nullptr, nullptr),
          panel_of(distance, nullptr, &curves.distance, nullptr),
          panel_of("speed (m/s)", nullptr, &curves.target_speed, &curves.hand_speed),
          panel_of("stands still before an action (s)", nullptr, nullptr, nullptr, &curves.idle)};
}

Result<RecordedRun> run_of(BagReader& reader, const std::string& goal) {
  auto runs_result = read_runs(reader);
  if (!runs_result) return runs_result.error();
  runs_result = select_runs(std::move(runs_result).value(), goal);
  if (!runs_result) return runs_result.error();
  if (runs_result->size() == 1) return std::move(runs_result->front());
  std::string ids;
  for (const RecordedRun& run : *runs_result) ids += (ids.empty() ? "" : ", ") + run.run.goal().goal_id();
  return Error{Code::kInvalidArgument, fmt::format("{}: got {} runs, wanted --goal with one of {}",
                                                   reader.info().path.string(), runs_result->size(), ids)};
}

std::string title_of(const RecordedRun& run, const RunCurves& curves) {
  const std::string end = run.result ? run.result->reason() : "the recording ends before the run";
  return fmt::format("{}: {}, {}", run.run.goal().goal_id(), curves.task, end);
}

int plot(const fs::path& bag, const fs::path& picture, const std::string& goal) {
  if (auto ok = common::check_picture(picture); !ok) return fail(ok.error());
  auto reader_result = BagReader::open(bag);
  if (!reader_result) return fail(reader_result.error());
  auto run_result = run_of(**reader_result, goal);
  if (!run_result) return fail(run_result.error());
  const auto curves_result = curves_of(**reader_result, *run_result);
  if (!curves_result) return fail(curves_result.error());
  if (curves_result->unreadable > 0) {
    fmt::print(stderr, "jostle bag plot: {} states of the bag cannot be read\n", curves_result->unreadable);
  }
  if (auto ok = common::plot(picture, title_of(*run_result, *curves_result), panels_of(*curves_result)); !ok) {
    return fail(ok.error());
  }
  fmt::print("{}\n", picture.string());
  return common::kExitOk;
}

// "run1/" and "run1/run1_0.mcap" are run1.png here.
fs::path default_picture(const fs::path& bag) {
  const fs::path whole = fs::absolute(bag).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).stem().string() + ".png";
}

}  // namespace
}  // namespace jostle::bags

int main(int argc, char** argv) {
  using namespace jostle;
  CLI::App app{
      "Draws a recorded run over time: the cost of its plans, the distance of the target, speeds, and how long the "
      "robot stood still.",
      "jostle bag plot"};
  app.footer(bags::kExample);
  std::string bag, picture, goal;
  app.add_option("bag", bag, "a bag's folder, or one of its files")->required();
  app.add_option("-o,--output", picture, "picture; its ending says its kind (default: the bag's name and .png)");
  app.add_option("--goal", goal, "goal id, where a bag has several runs");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  return bags::plot(bag, picture.empty() ? bags::default_picture(bag) : std::filesystem::path(picture), goal);
}
