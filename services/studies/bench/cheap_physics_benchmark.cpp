#include "services/common/process/files.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/studies/bench/cheap_physics.hpp"

namespace jostle::studies {
namespace {

class CheapPhysicsBenchmark final : public Benchmark {
 public:
  CheapPhysicsBenchmark()
      : Benchmark("cheap-physics",
                  "freezing, screening, pruning: candidates per second, truth, success; and PBSTO's peers", "an hour",
                  Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    app.add_option("--parts", options_.parts, "What to measure")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::IsMember(options_.parts));
    app.add_option("--repeats", options_.repeats, "Measurements of speed in each world")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_option("--worlds", options_.executed_worlds, "Worlds of 15 objects that are planned and executed")
        ->capture_default_str()
        ->check(CLI::Range(1, 1000));
    add_json(app);
    app.add_option("--plot", plot_, "File for a figure of cost against rollouts and time: .png, .svg or .pdf");
  }

  Result<void> check() const override {
    if (auto ok = check_picture(plot_); !ok) return ok;
    return Benchmark::check();
  }

  Result<int> run(const Start& start) override {
    options_.line = start.line;
    return exit_code(bench_cheap_physics(options_, {.json = json, .plot = plot_},
                                         common::data_file("experiments/grasping.yaml"), start.stop));
  }

 private:
  CheapPhysicsOptions options_;
  std::string plot_;
};

}  // namespace

std::unique_ptr<Benchmark> cheap_physics_benchmark() { return std::make_unique<CheapPhysicsBenchmark>(); }

}  // namespace jostle::studies
