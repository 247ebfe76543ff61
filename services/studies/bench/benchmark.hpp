#pragma once
/// \file
/// A benchmark: its name, its options, and one run of it.

#include <CLI/CLI.hpp>
#include <stop_token>
#include <string>
#include <utility>

#include "idl/types/result.hpp"
#include "services/common/process/exit_codes.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

/// What a benchmark is started with.
struct Start {
  int domain = 0;
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< never null
};

/// A benchmark, its options and its results.
class Benchmark {
 public:
  enum class Uses { kNothing, kDomain };

  Benchmark(std::string its_name, std::string its_purpose, std::string it_takes, Uses what)
      : name(std::move(its_name)), purpose(std::move(its_purpose)), takes(std::move(it_takes)), uses(what) {}
  virtual ~Benchmark() = default;

  virtual void add_options(CLI::App& app) = 0;

  /// What can be told before the work begins. Error kInvalidArgument, kIo
  virtual Result<void> check() const { return check_output(json); }

  /// Returns an exit code.
  virtual Result<int> run(const Start& start) = 0;

  virtual const char* unit() const { return "runs"; }  ///< what is counted while it runs

  const std::string name, purpose;
  const std::string takes;  ///< with its defaults, on two cores; empty: it is no benchmark that a user starts
  const Uses uses;

 protected:
  void add_json(CLI::App& app) { app.add_option("--json", json, "File for all numbers"); }

  /// Whether the files that it writes can be written; empty ones are not.
  static Result<void> check_output(const std::string& file);
  static Result<void> check_picture(const std::string& file);

  std::string json;
};

/// Returns the exit code of what was measured.
inline Result<int> exit_code(const Result<void>& measured) {
  if (!measured) return measured.error();
  return int{common::kExitOk};
}

}  // namespace jostle::studies
