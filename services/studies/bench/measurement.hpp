#pragma once
/// \file
/// Two sides of one benchmark, run in turns, and what became of it.

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/hash.hpp"
#include "idl/types/result.hpp"
#include "services/common/charts/statistics.hpp"

namespace jostle::studies {

/// One run of one side.
struct Sample {
  double value = 0.0;  ///< in the measurement's unit, > 0
  Hash hash;           ///< that of what it computed
};

/// What a side is called, and one run of it.
struct Side {
  std::string name;
  std::function<Result<Sample>()> run;
};

/// Where the ratio should be. A wish: missing it breaks nothing.
struct Aim {
  enum class Kind { kAtLeast, kAtMost } kind = Kind::kAtLeast;
  double ratio = 1.0;

  bool met_by(double got) const { return kind == Kind::kAtLeast ? got >= ratio : got <= ratio; }
};

struct Measurement {
  std::string name;
  std::string name_a, name_b;
  std::string unit;
  std::vector<double> a, b;  ///< [repeats]; a[i] and b[i] were measured one after the other
  /// [repeats] CPU seconds of each run. Others on the machine hardly change
  /// them, so their ratio says what a side costs where times say nothing.
  std::vector<double> cpu_a, cpu_b;
  Hash hash_a, hash_b;
  bool agrees = true;  ///< every run of both sides computed the same
  int wanted = 0;      ///< repeats that were asked for; fewer were made if somebody asked to stop
  std::optional<Aim> aim;
  std::vector<std::pair<std::string, double>> details;  ///< further numbers, by name
  double load = 0.0;  ///< one-minute load average before; more than 0.1 is somebody else's

  /// Returns the median of a[i]/b[i]: what slows the machine for a while slows both.
  double ratio() const;
  common::Interval interval() const;
};

/// Returns the CPU seconds that this process has used.
double own_cpu_seconds();

struct Turns {
  int repeats = 1;
  std::stop_token stop;
  std::function<double()> cpu_seconds = own_cpu_seconds;  ///< CPU time used so far by all processes that take part
  std::function<void()> on_run = [] {};  ///< called after each run of a side; those that are not counted as well

  int runs() const { return 2 * (repeats + 1); }  ///< that one comparison takes, both sides together
};

/// Runs a, b, a, b, …, each `repeats` times after one run that is not counted. After a stop request the
/// measurement has the pairs that were complete.
/// Errors   a side's; kCancelled if no pair was complete
Result<Measurement> compare(const Side& a, const Side& b, const Turns& turns);

/// Writes one line, for people who wait for the next measurement.
std::string one_line(const Measurement& measurement);

/// Writes a few lines for people.
std::string to_text(const Measurement& measurement);

/// Writes a list for scripts: objects with name, ratio, interval, samples, a, b,
/// unit, hash_a, hash_b, aim and more; null where there is no number.
nlohmann::json to_json(const std::vector<Measurement>& measurements);

}  // namespace jostle::studies
