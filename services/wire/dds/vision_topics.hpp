#pragma once
/// \file
/// Topics of what sensors see. Apart from topics.hpp, so that only those who publish them compile them.

#include "idl/msg/visionPubSubTypes.h"
#include "services/wire/dds/topic.hpp"

namespace jostle::wire {

template <>
struct SerializerOf<vision_msgs::msg::Detection3DArray> {
  using type = vision_msgs::msg::Detection3DArrayPubSubType;
};

namespace topics {

inline const Topic<vision_msgs::msg::Detection3DArray> kObjectDetections{"rt/objects/detections", kState};

}  // namespace topics
}  // namespace jostle::wire
