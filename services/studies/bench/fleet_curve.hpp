#pragma once
/// \file
/// `jostle bench fleet`: efficiency from one lane to thousands, simulated, and measured where it was.

#include <filesystem>
#include <stop_token>

#include "idl/types/result.hpp"
#include "services/studies/bench/fleet.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct FleetCurveOptions {
  FleetOptions fleet;              ///< the largest
  std::filesystem::path measured;  ///< what `jostle bench lanes --json` wrote; empty: nothing to compare with
  std::filesystem::path json;      ///< empty: none
  std::filesystem::path picture;   ///< PNG, SVG or PDF; empty: none
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< where it is shown how far the work has come; never null
};

/// Simulates one host with 1, 4, 16, … lanes, then 1, 4, 16, … hosts up to the largest fleet, every host with cores of
/// its own; and what was measured, on as many cores as it was measured on. Prints a table, writes and draws it.
/// Errors   kIo               a file cannot be read or written
///          kInvalidArgument  `measured` is not from `jostle bench lanes`
///          kCancelled        a stop was requested, after what had been simulated was printed
Result<void> bench_fleet(const FleetCurveOptions& options);

}  // namespace jostle::studies
