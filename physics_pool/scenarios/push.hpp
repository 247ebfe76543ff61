#pragma once
/// \file
/// Random worlds of Sec. 6.3 and 7.4: a pusher, sliders, a goal region.

#include <cstdint>
#include <string>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

struct GeneratePushOptions {
  std::uint64_t seed = 1;
  Shape shape = Shape::kCylinder;    ///< of every slider
  int objects = 3;                   ///< sliders beside the target, 0 to 3; Chapter 7 only
  std::string integrator = "euler";  ///< or "rk4"
};

/// Makes a world of one slider, the pusher 1 to 2 cm behind it as seen from the goal region, and an
/// obstacle halfway to that region, so that the straight push runs into it (Sec. 6.2).
/// `scenes/README.md` gives the measures and their reasons.
/// Errors   kInvalidArgument  an unknown integrator
Result<Scene> generate_chapter6(const GeneratePushOptions& options);

/// Makes the same without the obstacle, with other sliders near the target's way (Sec. 7.1.1). None
/// starts so near the goal region that the target could not be in it.
/// Errors   kInvalidArgument  objects out of range, an unknown integrator
Result<Scene> generate_chapter7(const GeneratePushOptions& options);

}  // namespace jostle::physics_pool
