#pragma once
/// \file
/// `jostle bench pool`: what each worker did when.

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::studies {

struct PoolTimelineOptions {
  int workers = 1;         ///< processes of one thread each
  std::vector<int> cores;  ///< dealt to the workers in turn; empty: not pinned
  int clients = 1;         ///< with the same work, in longer and shorter samples
  bool urgent = false;     ///< whether the last client's batches are urgent
  int batches = 3;         ///< batches of each client, one after the other
  int domain = 0;
  std::filesystem::path picture;  ///< PNG or SVG; empty: none
  std::filesystem::path json;     ///< empty: none
  std::stop_token stop;
};

/// Runs batches of rollouts on worker processes, prints who was how busy, and draws it.
Result<void> bench_pool(const PoolTimelineOptions& options);

}  // namespace jostle::studies
