#include "services/studies/bench/measurement.hpp"

#include <fmt/format.h>
#include <stdlib.h>
#include <time.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace jostle::studies {
namespace {

double load_average() {
  double load = 0.0;
  getloadavg(&load, 1);
  return load;
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
                        {"ratio", measurement.ratio()},
                        {"interval", {interval.low, interval.high}},
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
                        {"load", measurement.load},
                        {"details", nlohmann::json::object()},
                        {"aim", nullptr}};
  for (const auto& [name, value] : measurement.details) object["details"][name] = value;
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
  Measurement measurement{.name_a = a.name, .name_b = b.name, .load = load_average()};
  for (int i = -1; i < turns.repeats; ++i) {
    for (const Side* side : {&a, &b}) {
      if (turns.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      const double cpu_before = turns.cpu_seconds();
      auto sample_result = side->run();
      if (!sample_result) return sample_result.error();
      const bool is_a = side == &a;
      Hash& hash = is_a ? measurement.hash_a : measurement.hash_b;
      if (i < 0) {
        hash = sample_result->hash;
        continue;
      }
      if (hash != sample_result->hash) measurement.agrees = false;
      (is_a ? measurement.a : measurement.b).push_back(sample_result->value);
      (is_a ? measurement.cpu_a : measurement.cpu_b).push_back(turns.cpu_seconds() - cpu_before);
    }
  }
  if (measurement.hash_a != measurement.hash_b) measurement.agrees = false;
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
  std::string text = fmt::format("{}: {} against {}\n  ratio {:.3f}  ({:.3f} .. {:.3f}, {} repeats, load {:.1f})",
                                 measurement.name, measurement.name_a, measurement.name_b, ratio, interval.low,
                                 interval.high, measurement.a.size(), measurement.load);
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
  for (const auto& [name, value] : measurement.details) text += fmt::format("\n  {:<18} {:>12.5g}", name, value);
  if (!measurement.agrees) text += "\n  WRONG: not every run computed the same";
  return text + "\n";
}

nlohmann::json to_json(const std::vector<Measurement>& measurements) {
  nlohmann::json list = nlohmann::json::array();
  for (const Measurement& measurement : measurements) list.push_back(to_object(measurement));
  return list;
}

}  // namespace jostle::studies
