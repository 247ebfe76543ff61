#pragma once
/// \file
/// What is wrong with the values of a scene.

#include <string>
#include <vector>

#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

struct SceneProblem {
  std::string path;   ///< "objects[3].pose.x", as a file spells the field
  std::string shown;  ///< "objects[3] ('can').pose.x", as people like to read it
  std::string text;   ///< got and wanted
  bool is_relative;   ///< whether it follows from other parts of the scene, too: overlaps, places on the surface, names
};

/// Returns everything that validate() refuses, in the order of a file.
std::vector<SceneProblem> scene_problems(const Scene& scene);

}  // namespace jostle::physics_pool
