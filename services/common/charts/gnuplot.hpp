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

inline constexpr int kFont = 14;  ///< points, of everything but titles

/// Pixels that a character of kFont takes in a picture, on average; a little too many rather than too few.
inline constexpr int kCharacterWidth = 11;

/// Makes a gnuplot string in which nothing but the quote has a meaning.
std::string quoted(const std::string& text);

/// Says whether a picture can have this name, which is to be known before the work: its ending says what kind of
/// picture it becomes.
/// Error kInvalidArgument naming the endings
Result<void> check_picture(const std::filesystem::path& picture);

/// Draws a picture of so many pixels with a script that says nothing of terminal and output. A PDF is as large as the
/// picture is on a screen of 96 pixels per inch.
/// Errors   kInvalidArgument  see check_picture
///          kNotFound         gnuplot is not installed
///          kIo               the file cannot be written; gnuplot's own words
Result<void> run_gnuplot(const std::filesystem::path& picture, int width, int height, const std::string& script);

}  // namespace jostle::common
