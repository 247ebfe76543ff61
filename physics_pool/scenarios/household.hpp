#pragma once
/// \file
/// Things of a kitchen, of primitives.

#include <string>

#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

enum class Household {
  kSoupCan,
  kCoffeeCan,
  kChipsCan,
  kMug,
  kBowl,
  kCrackerBox,
  kSugarBox,
  kMustardBottle,
  kPuddingBox,
  kGelatinBox,
  kMeatCan,
};
inline constexpr int kHouseholds = 11;

const char* to_string(Household thing);  ///< "soup_can", "mug"

/// Returns a thing at the origin. Cans are cylinders, boxes and a bottle are boxes, a mug is a cylinder with a box for
/// a handle, a bowl a disc with a ring of boxes for a wall.
///
/// Sizes and masses are those of the YCB set, of full packages: Calli et al., "Benchmarking in Manipulation Research
/// Using the Yale-CMU-Berkeley Object and Model Set", IEEE Robotics & Automation Magazine 2015, its table of objects.
/// The handle of the mug and the thickness of the bowl are ours.
SceneObject household_object(Household thing, std::string name, double friction);

}  // namespace jostle::physics_pool
