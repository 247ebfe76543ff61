#pragma once
/// \file
/// Files of states: what `jostle render` draws.

#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::tools {

struct Frame {
  std::string caption;
  State state;  ///< v stays empty: it does not show
};

/// A scene and some of its states.
struct Frames {
  physics_pool::Scene scene;
  std::vector<Frame> frames;
};

/// Reads {"scene": "<YAML>", "frames": [{"caption": "…", "q": […]}, …]}; a
/// caption may be missing.
/// Errors   kNotFound, kInvalidArgument; the message names file, field, got and wanted.
Result<Frames> load_frames(const std::filesystem::path& file);

/// Loads a scene and takes its start as the only frame, without a caption.
/// Errors   those of load_scene.
Result<Frames> load_start(const std::filesystem::path& file);

}  // namespace jostle::tools
