#pragma once
/// \file
/// Random worlds of Sec. 5.6: tasks that ask for more or less accuracy.

#include <cstdint>
#include <optional>
#include <string_view>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// The worlds of Fig. 5.1, 5.4 and 5.5.
enum class AdaptiveTask {
  kWide,      ///< a wide table with a large goal region: low accuracy
  kStrip,     ///< a thin strip with a small one: high accuracy
  kChanging,  ///< a wide table that narrows to a strip
  kL,         ///< two strips at a right angle
  kClutter,   ///< a target to grasp among other objects
};

std::optional<AdaptiveTask> parse_adaptive_task(std::string_view word);
const char* to_string(AdaptiveTask task);  ///< "wide", "strip", "changing", "l", "clutter"

struct GenerateAdaptiveOptions {
  AdaptiveTask task = AdaptiveTask::kWide;
  std::uint64_t seed = 1;
  int objects = 8;  ///< beside the target, 0 to 20; clutter only
};

/// Makes a world with the planar gripper, hand open. Shape (box or cylinder), sizes, mass and friction of an object are
/// drawn from the ranges of footnote 1 of Ch. 5, a box's as full extents, a cylinder's radius as a radius. The pushed
/// object is near the lower end of the table, in the middle (footnote 2): normal about it, sigma 1 cm, any yaw. The
/// hand is 1 to 2 cm behind it and looks along the table. Equal seeds give equal objects on all tables to push on.
/// `scenes/README.md` gives the measures that the thesis leaves out, and their reasons.
/// Errors   kInvalidArgument  objects out of range, or no place found for them
Result<Scene> generate_chapter5(const GenerateAdaptiveOptions& options);

}  // namespace jostle::physics_pool
