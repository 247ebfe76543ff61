#pragma once
/// \file
/// A `jostle run` as a process of its own, beside which other things happen.

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "services/common/process/child_process.hpp"
#include "services/studies/bench/measurement.hpp"

namespace jostle::studies {

struct RunProcess {
  std::filesystem::path folder;        ///< for its log and its result
  std::vector<std::string> arguments;  ///< beside --headless, --json and --domain
  std::string seconds;                 ///< key of the result that is measured
  int domain = 0;
  std::stop_token stop;
};

/// What happens beside a run; called over and over until it has ended.
using Meanwhile = std::function<Result<void>(common::ChildProcess&)>;

/// Runs it once; the value is its time, s, the hash that of its first plan.
/// Errors   kUnavailable  it broke, or made no plan; its last words
///          kCancelled    after a stop request
///          those of `meanwhile`
Result<Sample> run_once(const RunProcess& run, const Meanwhile& meanwhile);

/// Returns the CPU time of all processes that were started and have ended, and of those that they started, s.
double children_cpu_seconds();

}  // namespace jostle::studies
