#pragma once
/// \file
/// What all pictures that gnuplot draws have in common.

#include <array>
#include <filesystem>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::common {

/// The colours of Okabe and Ito, "Color Universal Design", 2008, which colour-blind eyes can
/// tell apart, and one more.
inline constexpr std::array kColours{"#000000", "#E69F00", "#56B4E9", "#009E73",
                                     "#D55E00", "#CC79A7", "#0072B2", "#999933"};

/// Makes a gnuplot string in which nothing but the quote has a meaning.
std::string quoted(const std::string& text);

/// Runs a script that draws `picture`, whose folder it makes.
/// Errors   kUnavailable  gnuplot is not installed
///          kIo        the file cannot be written; gnuplot's own words
Result<void> run_gnuplot(const std::filesystem::path& picture, const std::string& script);

}  // namespace jostle::common
