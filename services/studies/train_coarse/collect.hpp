#pragma once
/// \file
/// Collects transitions from a pool into a file.

#include <functional>
#include <stop_token>

#include "physics_pool/api/pool.hpp"
#include "services/studies/train_coarse/transitions.hpp"

namespace jostle::studies {

struct CollectOptions {
  DataOrigin origin;
  std::uint64_t samples = 1000;  ///< transitions the file is to have, rounded up to whole episodes
  int in_flight = 2;             ///< episodes asked of the pool at a time
};

struct CollectProgress {
  std::uint64_t found = 0;    ///< in the file when collecting began
  std::uint64_t done = 0;     ///< in the file
  std::uint64_t samples = 0;  ///< wanted
};

/// Goes on with a file until it has enough transitions. What is in it depends on
/// the origin alone: neither on interruptions, nor on the pool and its speed.
/// `report` is called from one thread at a time.
/// Errors   those of the pool and the file; kCancelled after a stop request, with
///          every finished episode kept.
Result<CollectProgress> collect(physics_pool::Pool& pool, const std::filesystem::path& file,
                                const CollectOptions& options, std::stop_token stop,
                                const std::function<void(const CollectProgress&)>& report = {});

}  // namespace jostle::studies
