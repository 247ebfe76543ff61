#pragma once
/// \file
/// Topics and services of tasks as ROS 2 actions. Apart from topics.hpp, so that only those who serve them compile
/// them.

#include "idl/msg/actionPubSubTypes.h"
#include "services/wire/dds/service.hpp"
#include "services/wire/dds/topic.hpp"

namespace jostle::wire {

template <>
struct SerializerOf<action_msgs::msg::GoalStatusArray> {
  using type = action_msgs::msg::GoalStatusArrayPubSubType;
};
template <>
struct SerializerOf<action_msgs::srv::CancelGoal_Request> {
  using type = action_msgs::srv::CancelGoal_RequestPubSubType;
};
template <>
struct SerializerOf<action_msgs::srv::CancelGoal_Response> {
  using type = action_msgs::srv::CancelGoal_ResponsePubSubType;
};
template <>
struct SerializerOf<jostle_msgs::action::Manipulate_SendGoal_Request> {
  using type = jostle_msgs::action::Manipulate_SendGoal_RequestPubSubType;
};
template <>
struct SerializerOf<jostle_msgs::action::Manipulate_SendGoal_Response> {
  using type = jostle_msgs::action::Manipulate_SendGoal_ResponsePubSubType;
};
template <>
struct SerializerOf<jostle_msgs::action::Manipulate_GetResult_Request> {
  using type = jostle_msgs::action::Manipulate_GetResult_RequestPubSubType;
};
template <>
struct SerializerOf<jostle_msgs::action::Manipulate_GetResult_Response> {
  using type = jostle_msgs::action::Manipulate_GetResult_ResponsePubSubType;
};
template <>
struct SerializerOf<jostle_msgs::action::Manipulate_FeedbackMessage> {
  using type = jostle_msgs::action::Manipulate_FeedbackMessagePubSubType;
};

using SendGoalService =
    Service<jostle_msgs::action::Manipulate_SendGoal_Request, jostle_msgs::action::Manipulate_SendGoal_Response>;
using GetResultService =
    Service<jostle_msgs::action::Manipulate_GetResult_Request, jostle_msgs::action::Manipulate_GetResult_Response>;
using CancelGoalService = Service<action_msgs::srv::CancelGoal_Request, action_msgs::srv::CancelGoal_Response>;

/// Returns the topics of the action `name`, such as "/grasp", without a namespace.
inline Topic<jostle_msgs::action::Manipulate_FeedbackMessage> action_feedback(const std::string& name) {
  return {wire_topic(name) + "/_action/feedback", kState};
}
inline Topic<action_msgs::msg::GoalStatusArray> action_status(const std::string& name) {
  return {wire_topic(name) + "/_action/status", kLatched};
}

}  // namespace jostle::wire
