#pragma once
/// \file
/// From a wire type to the code that serializes it.

#include <fastdds/dds/topic/TypeSupport.hpp>

#include "idl/msg/diagnosticsPubSubTypes.h"
#include "idl/msg/playPubSubTypes.h"
#include "idl/msg/poolPubSubTypes.h"
#include "idl/msg/robotPubSubTypes.h"
#include "idl/msg/rosPubSubTypes.h"
#include "idl/msg/taskPubSubTypes.h"

namespace jostle::wire {

/// Names the generated serializer of T.
template <class T>
struct SerializerOf;

#define JOSTLE_WIRE_TYPE(package, name)          \
  template <>                                    \
  struct SerializerOf<package::msg::name> {      \
    using type = package::msg::name##PubSubType; \
  };

JOSTLE_WIRE_TYPE(diagnostic_msgs, DiagnosticArray)
JOSTLE_WIRE_TYPE(geometry_msgs, PoseArray)
JOSTLE_WIRE_TYPE(rosgraph_msgs, Clock)
JOSTLE_WIRE_TYPE(sensor_msgs, JointState)
JOSTLE_WIRE_TYPE(tf2_msgs, TFMessage)
JOSTLE_WIRE_TYPE(jostle_msgs, ObjectStates)
JOSTLE_WIRE_TYPE(jostle_msgs, VelocityCommand)
JOSTLE_WIRE_TYPE(jostle_msgs, RobotStatus)
JOSTLE_WIRE_TYPE(jostle_msgs, Goal)
JOSTLE_WIRE_TYPE(jostle_msgs, TaskRun)
JOSTLE_WIRE_TYPE(jostle_msgs, Observation)
JOSTLE_WIRE_TYPE(jostle_msgs, Plan)
JOSTLE_WIRE_TYPE(jostle_msgs, Cancel)
JOSTLE_WIRE_TYPE(jostle_msgs, Feedback)
JOSTLE_WIRE_TYPE(jostle_msgs, GoalResult)
JOSTLE_WIRE_TYPE(jostle_msgs, WorldDescription)
JOSTLE_WIRE_TYPE(jostle_msgs, WorkerHeartbeat)
JOSTLE_WIRE_TYPE(jostle_msgs, Assignment)
JOSTLE_WIRE_TYPE(jostle_msgs, AssignmentResults)
JOSTLE_WIRE_TYPE(jostle_msgs, BatchControl)
JOSTLE_WIRE_TYPE(jostle_msgs, PlayControl)
JOSTLE_WIRE_TYPE(jostle_msgs, PlayStatus)

#undef JOSTLE_WIRE_TYPE

/// A Serializer keeps allocation failures from the middleware's threads, which must not see them: the generated
/// code lets them through.
template <class T>
class Serializer final : public SerializerOf<T>::type {
 public:
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    try {
      return SerializerOf<T>::type::deserialize(payload, data);
    } catch (...) {
      return false;
    }
  }
};

}  // namespace jostle::wire
