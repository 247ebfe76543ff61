#pragma once
/// \file
/// The doctor and the eyes: what motion capture and cameras send, and what they should.

#include <string>
#include <vector>

#include "perception/natnet/client.hpp"
#include "services/tools/doctor/check.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::tools {

/// Listens to a motion capture's server for some seconds and checks, as far as it makes sense to go on:
///
///   motion capture     it answers, and frames come
///   frames             how many a second, how many were lost or malformed
///   rigid bodies       there are some, and which of them are hidden all the time
///   clock              it is echoed: without that, frames are stamped as they come
std::vector<Check> check_mocap(const perception::natnet::Client::Options& options);

/// Listens to a camera of ROS 2 for some seconds and checks, as far as it makes sense to go on:
///
///   camera             images come on NAME/image_raw, how many a second, and we can read them
///   intrinsics         they come on NAME/camera_info, and are of images of that size
///   tags               which are seen in the newest image
///
/// Throws wire::SetupError.
std::vector<Check> check_camera(const wire::Participant& participant, const std::string& name);

}  // namespace jostle::tools
