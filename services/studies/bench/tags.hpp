#pragma once
/// \file
/// How exact the poses of tags are in images whose truth is known, how honest their covariances, and what they cost.

#include <filesystem>
#include <stop_token>

#include "idl/types/result.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {

struct TagsOptions {
  int frames = 60;  ///< at each distance, >= 1; of 15 tags each
  std::uint64_t seed = 1;
  std::filesystem::path json;  ///< empty: none
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< never null
};

/// Renders frames of 1280x720 with 15 tags of 50 mm, tilted by up to 60 degrees, at 0.6, 0.9 and 1.4 m; finds the tags
/// and their poses with our settings, with ours at full resolution, and with libapriltag's own, in turns; then the
/// same tags with our settings in ten images more, of which the estimator makes one estimate. Prints how far all of
/// them are from the truth. Errors   kCancelled, kIo
Result<void> bench_tags(const TagsOptions& options);

}  // namespace jostle::studies
