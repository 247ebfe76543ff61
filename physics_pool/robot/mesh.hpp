#pragma once
/// \file
/// Points of a mesh file, for its convex hull.

#include <filesystem>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::physics_pool {

/// Reads the vertices [n][3] of an STL (binary or text) or OBJ file, each once, as the file has them. If there are
/// more than 400, only those that reach farthest along 400 directions are kept: a subset of the hull's corners.
/// Errors   kNotFound         it is missing, or cannot be read
///          kInvalidArgument  another format, or damaged; says what was found
Result<std::vector<double>> mesh_vertices(const std::filesystem::path& file);

}  // namespace jostle::physics_pool
