#pragma once
/// \file
/// Objects as a camera sees the tags on them.

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "idl/types/pose.hpp"
#include "idl/types/result.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::world {

struct CameraOptions {
  /// A device, a file or an address as Video::open() takes it; else a name: images come on NAME/image_raw, intrinsics
  /// on NAME/camera_info.
  std::string source = "camera";
  std::filesystem::path intrinsics;  ///< of a device, a file or an address: what load_camera() reads; else empty
  std::filesystem::path scene;       ///< whose objects have tags as tags_of() says
  std::optional<Pose> X_WC;          ///< where the camera is; nothing: overhead()
  /// PNG of the last image, written at the end, in which tags that were found are outlined; empty: none.
  std::filesystem::path snapshot;
};

/// Publishes where the objects are, as Sight does, once for each image, until a stop is requested or a file ends.
/// Errors   those of load_scene(), tags_of(), load_camera() and Video; kIo: the snapshot cannot be written, or there
/// was
///          no image
Result<void> look_through_camera(const wire::Participant& participant, const CameraOptions& options,
                                 std::stop_token stop);

}  // namespace jostle::world
