#pragma once
/// \file
/// Pictures in a row, on paper or in time.

#include <filesystem>
#include <functional>
#include <stop_token>

#include "idl/types/result.hpp"
#include "physics_pool/render/renderer.hpp"
#include "services/tools/render/frames.hpp"

namespace jostle::tools {

struct DrawOptions {
  physics_pool::RenderOptions picture;
  int columns = 4;           ///< pictures side by side on a sheet
  double per_second = 20.0;  ///< pictures per second of a film
  std::function<void(std::size_t drawn, std::size_t all)> on_progress;
};

/// Draws frames by the ending of `output`:
///
///   .png or -    one sheet, side by side with captions
///   .mp4, .gif   a film (H.264; at most 256 colours), made by ffmpeg
///   none         a folder of frame-00001.png, …, which it makes
///
/// Errors   kInvalidArgument  a state that does not fit
///          kUnavailable      ffmpeg is not installed
///          kIo               what cannot be written; ffmpeg's own words
///          kCancelled        a stop was requested; nothing is left behind
Result<void> draw(const Frames& frames, const std::filesystem::path& output, const DrawOptions& options,
                  std::stop_token stop);

/// Checks before any work that draw() can write there. `still`: "a scene's start" or the like, of which no film can be
/// made; empty: there are several frames.
/// Errors   kInvalidArgument  another ending; a film of one frame; a folder in which there is something
///          kIo               no such file, or folder, can be made
Result<void> check_target(const std::filesystem::path& output, const std::string& still);

/// Whether draw() makes a sheet for that name.
bool is_sheet(const std::filesystem::path& output);

}  // namespace jostle::tools
