#pragma once
/// \file
/// All benchmarks. Whoever adds one declares it here, unless it is a Ratio, and names it in all_benchmarks().

#include <memory>
#include <vector>

#include "services/studies/bench/benchmark.hpp"

namespace jostle::studies {

/// In the order of their names; last those that no user starts.
std::vector<std::unique_ptr<Benchmark>> all_benchmarks();

std::unique_ptr<Benchmark> arm_reaches_benchmark();
std::unique_ptr<Benchmark> chaos_benchmark();
std::unique_ptr<Benchmark> cheap_physics_benchmark();
std::unique_ptr<Benchmark> coarse_grasp_benchmark();
std::unique_ptr<Benchmark> estimator_benchmark();
std::unique_ptr<Benchmark> first_plan_benchmark();
std::unique_ptr<Benchmark> fleet_curve_benchmark();
std::unique_ptr<Benchmark> idle_benchmark();
std::unique_ptr<Benchmark> pool_timeline_benchmark();
std::unique_ptr<Benchmark> record_benchmark();
std::unique_ptr<Benchmark> tags_benchmark();
std::unique_ptr<Benchmark> echo_server_benchmark();  ///< the other process of `round-trip`
std::unique_ptr<Benchmark> publisher_benchmark();    ///< and that of `record`

}  // namespace jostle::studies
