#include "services/studies/bench/measurement.hpp"

#include <fmt/format.h>
#include <stdlib.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "services/common/results/results.hpp"

namespace jostle::studies {
namespace {

using common::number_or_null;

double load_average() {
  double load = 0.0;
  return getloadavg(&load, 1) == 1 ? load : common::kNone;
}

std::vector<double> ratios(const Measurement& measurement) {
  std::vector<double> result;
  std::ranges::transform(measurement.a, measurement.b, std::back_inserter(result), std::divides());
  return result;
}

std::string to_text(const Aim& aim) {
  return fmt::format("{} {:g}", aim.kind == Aim::Kind::kAtLeast ? ">=" : "<=", aim.ratio);
}

nlohmann::json to_object(const Measurement& measurement) {
  const common::Interval interval = measurement.interval();
  nlohmann::json samples = nlohmann::json::array();
  for (std::size_t i = 0; i < measurement.a.size(); ++i) {
    samples.push_back({measurement.a[i], measurement.b[i]});
  }
  nlohmann::json object{{"name", measurement.name},
                        {"ratio", number_or_null(measurement.ratio())},
                        {"interval", {number_or_null(interval.low), number_or_null(interval.high)}},
                        {"repeats", measurement.a.size()},
                        {"repeats_wanted", measurement.wanted},
                        {"samples", samples},
                        {"name_a", measurement.name_a},
                        {"name_b", measurement.name_b},
                        {"a", common::median(measurement.a)},
                        {"b", common::median(measurement.b)},
                        {"unit", measurement.unit},
                        {"cpu_a", common::median(measurement.cpu_a)},
                        {"cpu_b", common::median(measurement.cpu_b)},
                        {"hash_a", to_string(measurement.hash_a)},
                        {"hash_b", to_string(measurement.hash_b)},
                        {"agrees", measurement.agrees},
                        {"load", number_or_null(measurement.load)},
                        {"details", nlohmann::json::object()},
                        {"aim", nullptr}};
  for (const auto& [name, value] : measurement.details) object["details"][name] = number_or_null(value);
  if (measurement.aim) {
    object["aim"] = to_text(*measurement.aim);
    object["met"] = measurement.aim->met_by(measurement.ratio());
  }
  return object;
}

}  // namespace

double Measurement::ratio() const { return common::median(ratios(*this)); }

common::Interval Measurement::interval() const { return common::median_interval(ratios(*this)); }

double own_cpu_seconds() {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

Result<Measurement> compare(const Side& a, const Side& b, const Turns& turns) {
  Measurement measurement{.name_a = a.name, .name_b = b.name, .wanted = turns.repeats, .load = load_average()};
  for (int i = -1; i < turns.repeats; ++i) {
    Sample samples[2];
    double cpu[2];
    for (const int side : {0, 1}) {
      const double cpu_before = turns.cpu_seconds();
      // A side that fails because it was asked to stop has not failed.
      auto sample_result = turns.stop.stop_requested() ? Result<Sample>(Error{Code::kCancelled, "interrupted"})
                                                       : (side == 0 ? a : b).run();
      if (!sample_result && turns.stop.stop_requested()) {
        if (measurement.a.empty()) return Error{Code::kCancelled, "interrupted"};
        return measurement;
      }
      if (!sample_result) return sample_result.error();
      samples[side] = *sample_result;
      cpu[side] = turns.cpu_seconds() - cpu_before;
      turns.on_run();
    }
    if (i < 0) {
      measurement.hash_a = samples[0].hash;
      measurement.hash_b = samples[1].hash;
      measurement.agrees = measurement.hash_a == measurement.hash_b;
      continue;
    }
    if (samples[0].hash != measurement.hash_a || samples[1].hash != measurement.hash_b) measurement.agrees = false;
    measurement.a.push_back(samples[0].value);
    measurement.b.push_back(samples[1].value);
    measurement.cpu_a.push_back(cpu[0]);
    measurement.cpu_b.push_back(cpu[1]);
  }
  return measurement;
}

std::string one_line(const Measurement& measurement) {
  return fmt::format("{}: {} {:.5g} {}, {} {:.5g} {}, ratio {:.3f}", measurement.name, measurement.name_a,
                     common::median(measurement.a), measurement.unit, measurement.name_b, common::median(measurement.b),
                     measurement.unit, measurement.ratio());
}

std::string to_text(const Measurement& measurement) {
  const common::Interval interval = measurement.interval();
  const double ratio = measurement.ratio();
  const bool is_whole = std::ssize(measurement.a) == measurement.wanted;
  const std::string repeats = is_whole
                                  ? fmt::format("{} repeat{}", measurement.wanted, measurement.wanted == 1 ? "" : "s")
                                  : fmt::format("{} of {} repeats", measurement.a.size(), measurement.wanted);
  const std::string range =
      measurement.a.size() > 1 ? fmt::format("{:.3f} .. {:.3f}, ", interval.low, interval.high) : "";
  std::string text =
      fmt::format("{}: {} against {}\n  ratio {:.3f}  ({}{}, load {})", measurement.name, measurement.name_a,
                  measurement.name_b, ratio, range, repeats, common::number_text(measurement.load, 1));
  if (measurement.aim) {
    text += fmt::format("  aim {}: {}", to_text(*measurement.aim), measurement.aim->met_by(ratio) ? "met" : "missed");
  }
  const auto side = [&](const std::string& name, const std::vector<double>& values, const std::vector<double>& cpu,
                        const Hash& hash) {
    text += fmt::format("\n  {:<18} {:>12.5g} {}  {:.3f} cpu s  {}", name, common::median(values), measurement.unit,
                        common::median(cpu), to_string(hash));
  };
  side(measurement.name_a, measurement.a, measurement.cpu_a, measurement.hash_a);
  side(measurement.name_b, measurement.b, measurement.cpu_b, measurement.hash_b);
  for (const auto& [name, value] : measurement.details) {
    text += fmt::format("\n  {:<18} {:>12}", name, std::isfinite(value) ? fmt::format("{:.5g}", value) : "-");
  }
  if (!measurement.agrees) text += "\n  WRONG: not every run computed the same";
  return text + "\n";
}

nlohmann::json to_json(const std::vector<Measurement>& measurements) {
  nlohmann::json list = nlohmann::json::array();
  for (const Measurement& measurement : measurements) list.push_back(to_object(measurement));
  return list;
}

}  // namespace jostle::studies
