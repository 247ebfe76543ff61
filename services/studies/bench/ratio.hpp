#pragma once
/// \file
/// Benchmarks that compare two sides in turns.

#include <string>
#include <utility>

#include "services/studies/bench/benchmark.hpp"
#include "services/studies/bench/benchmarks.hpp"

namespace jostle::studies {

/// Two sides in turns, as most of them are.
class Ratio : public Benchmark {
 public:
  using Measure = Result<void> (*)(const Settings&);

  Ratio(std::string its_name, std::string its_purpose, std::string it_takes, Uses what, int repeats, Measure measure)
      : Benchmark(std::move(its_name), std::move(its_purpose), std::move(it_takes), what), measure_(measure) {
    settings_.repeats = repeats;
  }

  void add_options(CLI::App& app) override;

  Result<int> run(const Start& start) override;

 protected:
  Settings settings_;

 private:
  const Measure measure_;
};

/// The same for several numbers of workers.
class RatioOfWorkers final : public Ratio {
 public:
  using Ratio::Ratio;

  void add_options(CLI::App& app) override;
};

/// The same for several numbers of hosts with a worker of many threads each.
class RatioOfLanes final : public Ratio {
 public:
  using Ratio::Ratio;

  void add_options(CLI::App& app) override;
};

}  // namespace jostle::studies
