#pragma once
/// \file
/// `jostle bench pool`: what each worker did when.

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct PoolTimelineOptions {
  int workers = 1;         ///< processes of one thread each
  std::vector<int> cores;  ///< dealt to the workers in turn; empty: not pinned
  int clients = 1;         ///< with the same work, in longer and shorter samples
  bool urgent = false;     ///< whether the last client's batches are urgent
  int batches = 3;         ///< batches of each client, one after the other
  int domain = 0;
  std::filesystem::path picture;  ///< PNG, SVG or PDF; empty: none
  std::filesystem::path json;     ///< empty: none
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< where it is shown how far the work has come; never null
};

/// Runs batches of rollouts on worker processes, prints who was how busy, and draws it. After a stop request it does so
/// with what has come back until then.
/// Error kCancelled after that
Result<void> bench_pool(const PoolTimelineOptions& options);

}  // namespace jostle::studies
