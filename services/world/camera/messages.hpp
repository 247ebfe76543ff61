#pragma once
/// \file
/// Images and cameras as messages. Whatever comes from the wire is checked here before anyone looks at it.

#include "idl/msg/camera.h"
#include "idl/types/result.hpp"
#include "perception/camera/camera.hpp"

namespace jostle::world {

/// `time`: s, when it was exposed.
sensor_msgs::msg::Image to_message(const perception::GreyImage& image, double time);
sensor_msgs::msg::CameraInfo to_message(const perception::Camera& camera, double time);

/// Reads images of encoding mono8, rgb8, bgr8, rgba8 or bgra8; colours become their mean.
/// Error kInvalidArgument naming the field: an encoding, or sizes that disagree.
Result<perception::GreyImage> from_message(const sensor_msgs::msg::Image& message);
/// Error kInvalidArgument naming the field: a model other than plumb_bob, numbers that are no camera.
Result<perception::Camera> from_message(const sensor_msgs::msg::CameraInfo& message);

}  // namespace jostle::world
