#include "services/studies/bench/fleet_curve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "idl/text/json.hpp"
#include "services/common/charts/plot.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"

namespace jostle::studies {
namespace {

constexpr int kStep = 4;  // from one point of the curve to the next

// One row of `jostle bench lanes`.
struct Measured {
  int hosts = 1;
  int lanes = 1;  // of each
  double efficiency = 0.0, low = 0.0, high = 0.0;
  double tasks = 0.0;  // in all
};

struct Point {
  FleetOptions options;
  FleetResult result;
  std::optional<Measured> measured;
};

struct Measurements {
  std::vector<Measured> rows;
  int cores = 0;
};

Result<Measurements> read_measured(const std::filesystem::path& file) {
  auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  const auto json_result = parse_json(*text_result);
  if (!json_result)
    return Error{json_result.error().code, fmt::format("{}: {}", file.string(), json_result.error().message)};
  const nlohmann::json& json = *json_result;
  try {
    Measurements found{.cores = json.at("provenance").at("cores").get<int>()};
    for (const nlohmann::json& row : json.at("results")) {
      const nlohmann::json& details = row.at("details");
      const int hosts = details.at("workers").get<int>();
      found.rows.push_back({.hosts = hosts,
                            .lanes = details.at("lanes").get<int>() / std::max(hosts, 1),
                            .efficiency = row.at("ratio").get<double>(),
                            .low = row.at("interval").at(0).get<double>(),
                            .high = row.at("interval").at(1).get<double>(),
                            .tasks = details.at("tasks").get<double>()});
    }
    return found;
  } catch (const nlohmann::json::exception& error) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got {}, wanted what `jostle bench lanes --json` writes",
                                                     file.string(), error.what())};
  }
}

// One host that grows, then more of them.
std::vector<Point> points_of(const FleetOptions& largest, const Measurements& measured) {
  std::vector<Point> points;
  const auto add = [&](int hosts, int lanes) {
    Point& point = points.emplace_back();
    point.options = largest;
    point.options.hosts = hosts;
    point.options.lanes = lanes;
  };
  for (int lanes = 1; lanes < largest.lanes; lanes *= kStep) add(1, lanes);
  for (int hosts = 1; hosts < largest.hosts; hosts *= kStep) add(hosts, largest.lanes);
  add(largest.hosts, largest.lanes);
  for (const Measured& row : measured.rows) {
    add(row.hosts, row.lanes);
    Point& point = points.back();
    point.measured = row;
    point.options.shared_cores = measured.cores;
    point.options.deaths_per_minute = 0.0;
    point.options.samples_per_lane = std::max(static_cast<int>(row.tasks / (row.hosts * row.lanes)), 1);
  }
  return points;
}

int lanes_of(const Point& point) { return point.options.hosts * point.options.lanes; }

std::string row_of(const Point& point) {
  const FleetResult& result = point.result;
  std::string row =
      fmt::format("{:>5} {:>6} {:>7} {:>10.3f} {:>7.3f} {:>9.2f} {:>8.1f} {:>6} {:>8} {:>10}", point.options.hosts,
                  lanes_of(point), point.options.shared_cores ? std::to_string(point.options.shared_cores) : "own",
                  result.efficiency, result.client_busy, result.scheduler_us, result.samples_per_answer, result.deaths,
                  result.reissued, result.duplicates);
  if (point.measured) row += fmt::format("  measured {:.3f}", point.measured->efficiency);
  if (!result.finished) row += "  HUNG";
  return row;
}

nlohmann::json json_of(const Point& point) {
  const FleetResult& result = point.result;
  nlohmann::json object{{"hosts", point.options.hosts},
                        {"lanes", lanes_of(point)},
                        {"shared_cores", point.options.shared_cores},
                        {"deaths_per_minute", point.options.deaths_per_minute},
                        {"samples_per_lane", point.options.samples_per_lane},
                        {"efficiency", common::number_or_null(result.efficiency)},
                        {"seconds", result.seconds},
                        {"client_busy", common::number_or_null(result.client_busy)},
                        {"scheduler_us_per_sample", common::number_or_null(result.scheduler_us)},
                        {"samples_per_assignment", common::number_or_null(result.samples_per_assignment)},
                        {"samples_per_answer", common::number_or_null(result.samples_per_answer)},
                        {"heartbeats", result.heartbeats},
                        {"deaths", result.deaths},
                        {"reissued", result.reissued},
                        {"duplicates", result.duplicates},
                        {"finished", result.finished},
                        {"measured", nullptr}};
  if (point.measured) object["measured"] = point.measured->efficiency;
  return object;
}

Result<void> draw(const std::vector<Point>& points, const std::filesystem::path& picture) {
  common::Band cluster{.name = "simulated, cores of their own, hosts die"}, shared{.name = "simulated, cores shared"},
      measured{.name = "measured, cores shared"};
  const auto add = [](common::Band& band, double x, double low, double middle, double high) {
    band.x.push_back(x);
    band.low.push_back(low);
    band.middle.push_back(middle);
    band.high.push_back(high);
  };
  for (const Point& point : points) {
    add(point.measured ? shared : cluster, lanes_of(point), common::kNone, point.result.efficiency, common::kNone);
    if (!point.measured) continue;
    add(measured, lanes_of(point), point.measured->low, point.measured->efficiency, point.measured->high);
  }
  common::Panel panel{.x_label = "lanes", .y_label = "efficiency", .log_x = true, .bands = {cluster}};
  if (!measured.x.empty()) panel.bands.insert(panel.bands.end(), {shared, measured});
  return common::plot(
      picture,
      fmt::format("Part of the time in which lanes run samples of {:g} ms", 1e3 * points.front().options.sample),
      {panel});
}

}  // namespace

Result<void> bench_fleet(const FleetCurveOptions& options) {
  Measurements measured;
  if (!options.measured.empty()) {
    auto measured_result = read_measured(options.measured);
    if (!measured_result) return measured_result.error();
    measured = *std::move(measured_result);
  }
  std::vector<Point> points = points_of(options.fleet, measured);
  for (const Point& point : points) options.line->expect(1, lanes_of(point) * point.options.samples_per_lane);
  std::size_t done = 0;
  for (; done < points.size() && !options.stop.stop_requested(); ++done) {
    Point& point = points[done];
    point.result = simulate(point.options);
    options.line->step(fmt::format("{} lanes: {:.3f}", lanes_of(point), point.result.efficiency),
                       lanes_of(point) * point.options.samples_per_lane);
  }
  const bool complete = done == points.size();
  points.resize(done);
  options.line->end();

  fmt::print("hosts  lanes   cores efficiency  client sched, us s/answer deaths   again duplicates\n");
  for (const Point& point : points) fmt::print("{}\n", row_of(point));
  if (!options.json.empty() && done > 0) {
    nlohmann::json results{{"results", nlohmann::json::array()}};
    for (const Point& point : points) results["results"].push_back(json_of(point));
    if (!complete) results["partial"] = true;
    if (auto ok = common::write_results(options.json, std::move(results)); !ok) return ok;
  }
  if (!complete) return Error{Code::kCancelled, "interrupted"};
  if (options.picture.empty()) return {};
  return draw(points, options.picture);
}

namespace {

class FleetCurve final : public Benchmark {
 public:
  FleetCurve()
      : Benchmark("fleet", "simulated: efficiency from one lane to thousands on many hosts, some of which die", "2 min",
                  Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    FleetOptions& fleet = options_.fleet;
    app.add_option("--hosts", fleet.hosts, "Hosts of the largest fleet, with a worker process each")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--lanes", fleet.lanes, "Threads of each worker")->capture_default_str()->check(CLI::Range(1, 1024));
    app.add_option("--sample", fleet.sample, "Seconds that a sample takes")
        ->capture_default_str()
        ->check(CLI::Range(1e-4, 100.0));
    app.add_option("--samples", fleet.samples_per_lane, "Samples per lane, of one batch")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_option("--deaths", fleet.deaths_per_minute, "Share of the hosts that die in a minute")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 1.0));
    app.add_option("--measured", options_.measured, "What `jostle bench lanes --json` wrote, to be simulated as well");
    common::add_seed_option(app, "--seed", fleet.seed, "Seed of latencies and deaths");
    add_json(app);
    app.add_option("--plot", plot_, "File for a picture of efficiency over lanes: .png, .svg or .pdf");
  }

  Result<void> check() const override {
    if (auto ok = check_picture(plot_); !ok) return ok;
    return Benchmark::check();
  }

  Result<int> run(const Start& start) override {
    options_.picture = plot_;
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_fleet(options_));
  }

  const char* unit() const override { return "fleets"; }

 private:
  FleetCurveOptions options_;
  std::string plot_;
};

}  // namespace

std::unique_ptr<Benchmark> fleet_curve_benchmark() { return std::make_unique<FleetCurve>(); }

}  // namespace jostle::studies
