#pragma once
/// \file
/// `jostle run` in a folder and a DDS domain of its own.

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <memory>
#include <regex>
#include <string>
#include <vector>

#include "tests/support/program_process.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {

/// For whatever must happen, on however busy a machine.
inline constexpr std::chrono::seconds kPatience{60};

class RunFixture : public ::testing::Test {
 protected:
  RunFixture() {
    easy = folder.write("easy.yaml", physics_pool::to_yaml(three_objects()));
    plain = folder.write("plain.yaml", "control: {many_iterations: 10}\n");
    endless = folder.write("endless.yaml",
                           "objective: {success_cost: 1.0e-9}\n"
                           "control: {many_iterations: 100000}\n");
  }

  /// Never the same twice in a test: start it, then look at `run`.
  ProgramProcess& start(std::vector<std::string> arguments) {
    arguments.push_back("--headless");
    return *(run = program("jostle_run", arguments));
  }

  std::unique_ptr<ProgramProcess> program(const std::string& name, const std::vector<std::string>& arguments) {
    return std::make_unique<ProgramProcess>(
        name, arguments, folder,
        ProgramProcess::Environment{{"ROS_DOMAIN_ID", std::to_string(domain)}, {"TMPDIR", folder.path()}});
  }

  /// Runs to its end and gives the exit code, -1 if it takes too long.
  int finish(std::vector<std::string> arguments) { return start(std::move(arguments)).wait(kPatience).value_or(-1); }

  /// A run that plans until it is told to end, its first rollouts done.
  void start_planning(std::vector<std::string> more = {}) {
    more.insert(more.begin(), {easy, "--workers", "2", "--parameters", endless});
    start(std::move(more));
    ASSERT_TRUE(searches()) << run->err();
  }

  /// Waits until the run has an iteration behind it, whichever it shows first.
  bool searches() const {
    static const std::regex under_way("planning +iteration +[1-9]");
    soon(kPatience, [&] { return std::regex_search(run->err(), under_way) || run->code(); });
    return !run->code();
  }

  /// A run whose world takes its time, one action done. Six actions take
  /// 6 s / `rate`.
  void start_acting(double rate = 1.0) {
    start({easy, "--workers", "2", "--rate", fmt::format("{}", rate), "--parameters", plain});
    ASSERT_TRUE(soon(kPatience, [&] { return executed(1) || run->code(); })) << run->err();
    ASSERT_FALSE(run->code()) << run->err();
  }

  bool executed(int actions) const {
    return run->err().find(fmt::format("actions {:>2}", actions)) != std::string::npos;
  }

  /// What a run left in the folder for temporary files.
  std::vector<std::filesystem::path> run_folders() const {
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
      if (entry.path().filename().string().starts_with("jostle-run-")) found.push_back(entry.path());
    }
    return found;
  }

  /// A log of the present run, "sim.log" or "coordinator.log".
  std::string log(const std::string& name) const {
    const auto folders = run_folders();
    return folders.empty() ? "" : contents(folders.front() / name);
  }

  const int domain = test_domain();
  const TempFolder folder;
  std::string easy;     ///< scene: the straight way to the target is free
  std::string plain;    ///< parameters: few iterations
  std::string endless;  ///< parameters: no plan is ever good enough
  std::unique_ptr<ProgramProcess> run;
};

}  // namespace jostle::tests
