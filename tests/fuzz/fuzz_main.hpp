#pragma once
/// \file
/// The command line of a fuzzer.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <string>
#include <vector>

namespace jostle::tests {

/// How many inputs of a kind.
struct FuzzCount {
  const char *option, *meaning;
  long* value;
};

/// Reads the counts and a seed, and runs the fuzzer with that seed. What it throws is told with the seed that makes it
/// again. Returns an exit code.
inline int fuzz_main(int argc, char** argv, const std::string& purpose, const std::vector<FuzzCount>& counts,
                     const std::function<void(std::uint64_t seed)>& run) {
  CLI::App app(purpose);
  std::uint64_t seed = 1;
  for (const FuzzCount& count : counts)
    app.add_option(count.option, *count.value, count.meaning)->capture_default_str();
  app.add_option("--seed", seed, "Of all random numbers")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    run(seed);
    return 0;
  } catch (const std::exception& failure) {
    fmt::print(stderr, "FAILED (--seed {}): {}\n", seed, failure.what());
    return 1;
  }
}

}  // namespace jostle::tests
