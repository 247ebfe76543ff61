#pragma once
/// \file
/// Montage: pictures in rows, each with its caption, like a figure of a paper.

#include <span>
#include <string>

#include "idl/types/result.hpp"
#include "physics_pool/render/picture.hpp"

namespace jostle::physics_pool {

/// Lays pictures on white from left to right, `columns` to a row, each above
/// its caption in ASCII. No strip for captions where all are empty.
/// Errors   kInvalidArgument  no picture, unequal sizes, other than one caption
///                            per picture, or columns < 1
///          kUnavailable      there is no software OpenGL to draw letters with
Result<Picture> montage(std::span<const Picture> pictures, std::span<const std::string> captions, int columns);

}  // namespace jostle::physics_pool
