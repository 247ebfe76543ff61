#pragma once
/// \file
/// Topics for those who look: ROS 2's tools draw what they say. Apart from topics.hpp, so that only those who are
/// looked at compile them.

#include <tuple>

#include "idl/msg/displayPubSubTypes.h"
#include "services/wire/dds/topic.hpp"

namespace jostle::wire {

template <>
struct SerializerOf<std_msgs::msg::String> {
  using type = std_msgs::msg::StringPubSubType;
};
template <>
struct SerializerOf<visualization_msgs::msg::MarkerArray> {
  using type = visualization_msgs::msg::MarkerArrayPubSubType;
};

namespace topics {

/// The robot: its URDF, and those of its frames that never move.
inline const Topic<std_msgs::msg::String> kRobotDescription{"rt/robot_description", kLatched};
inline const Topic<tf2_msgs::msg::TFMessage> kStaticTransforms{"rt/tf_static", kLatched};

/// What a goal's scene has, and where the present plan leads.
inline const Topic<visualization_msgs::msg::MarkerArray> kSceneMarkers{"rt/task/scene_markers", kLatched};
inline const Topic<visualization_msgs::msg::MarkerArray> kPlanMarkers{"rt/task/plan_markers", kLatched};

/// Returns all of the above, in their order.
inline auto displayed() { return std::tie(kRobotDescription, kStaticTransforms, kSceneMarkers, kPlanMarkers); }

}  // namespace topics
}  // namespace jostle::wire
