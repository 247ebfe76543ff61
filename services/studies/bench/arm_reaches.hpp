#pragma once
/// \file
/// Whether physics stays sane when an arm reaches fast into a shelf of things.

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <vector>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct ArmReachesOptions {
  int reaches = 1000;                              ///< of each kind, >= 1
  std::vector<double> speeds{0.5, 1.0, 2.0, 3.0};  ///< m/s, of the hand along its way; joints may be too slow for it
  std::vector<double> time_steps{0.002};           ///< s
  std::vector<double> contact_times{0.02, 0.004};  ///< s, >= 2 time steps
  std::uint64_t seed = 1;                          ///< of the first shelf
  std::filesystem::path json;                      ///< empty: none
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< never null
};

/// Has an arm reach at random into shelves of Chapter 4, straight and level but for noise, and stop there. Prints for
/// every speed, time step and contact time how many reaches diverged, how deep bodies were in each other, how far the
/// hand was behind, how many reaches took more torque than a joint has, and whether energy grew once the arm stood.
/// Errors   kCancelled, kIo
Result<void> bench_arm_reaches(const ArmReachesOptions& options);

}  // namespace jostle::studies
