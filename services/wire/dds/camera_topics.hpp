#pragma once
/// \file
/// Topics of cameras. Apart from topics.hpp, so that only those who see compile them.

#include "idl/msg/cameraPubSubTypes.h"
#include "services/wire/dds/topic.hpp"

namespace jostle::wire {

template <>
struct SerializerOf<sensor_msgs::msg::Image> {
  using type = sensor_msgs::msg::ImagePubSubType;
};
template <>
struct SerializerOf<sensor_msgs::msg::CameraInfo> {
  using type = sensor_msgs::msg::CameraInfoPubSubType;
};

/// An image of a megabyte in many datagrams: one that is lost is sent again, and nobody wants yesterday's.
inline constexpr Qos kImages{.depth = 2};

/// Returns the topics of the camera whose images are on rt/NAME/image_raw; ROS 2's users write /NAME, too.
inline Topic<sensor_msgs::msg::Image> camera_image(const std::string& name) {
  return {(name.starts_with('/') ? "rt" : "rt/") + name + "/image_raw", kImages};
}
inline Topic<sensor_msgs::msg::CameraInfo> camera_info(const std::string& name) {
  return {(name.starts_with('/') ? "rt" : "rt/") + name + "/camera_info", kImages};
}

}  // namespace jostle::wire
