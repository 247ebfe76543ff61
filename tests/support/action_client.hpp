#pragma once
/// \file
/// A client of an action as rmw_fastrtps makes it of ROS 2's.

#include <condition_variable>
#include <deque>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "services/wire/dds/action_topics.hpp"
#include "tests/support/soon.hpp"

namespace jostle::tests {

namespace dds = eprosima::fastdds::dds;

/// A participant without any of our code, under ROS 2's names.
class RosNode {
 public:
  explicit RosNode(int domain) {
    dds::DomainParticipantQos qos;
    qos.name("/");
    participant_ =
        dds::DomainParticipantFactory::get_instance()->create_participant(static_cast<std::uint32_t>(domain), qos);
    if (!participant_) throw std::runtime_error("no participant");
    publisher_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  }
  ~RosNode() {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  RosNode(const RosNode&) = delete;
  RosNode& operator=(const RosNode&) = delete;

  template <class T>
  dds::DataWriter* writer(const std::string& topic) {
    dds::DataWriterQos qos;
    set(qos);
    qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
    return publisher_->create_datawriter(topic_of<T>(topic), qos);
  }
  template <class T>
  dds::DataReader* reader(const std::string& topic, bool latched = false) {
    dds::DataReaderQos qos;
    set(qos);
    if (latched) qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
    return subscriber_->create_datareader(topic_of<T>(topic), qos);
  }

 private:
  template <class T>
  dds::Topic* topic_of(const std::string& name) {
    dds::TypeSupport type(new typename wire::SerializerOf<T>::type());
    type->auto_fill_type_information(false);
    type->auto_fill_type_object(false);
    type.register_type(participant_);
    return participant_->create_topic(name, type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  }
  template <class Q>
  static void set(Q& qos) {
    qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 10;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    qos.data_sharing().off();
  }

  dds::DomainParticipant* participant_ = nullptr;
  dds::Publisher* publisher_ = nullptr;
  dds::Subscriber* subscriber_ = nullptr;
};

/// Takes the next sample; nothing if none comes for a minute.
template <class T>
std::optional<T> next_sample(dds::DataReader& reader, dds::SampleInfo& info) {
  T sample;
  const bool came = soon(std::chrono::seconds(60), [&] {
    return reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK && info.valid_data;
  });
  if (!came) return {};
  return sample;
}

/// A client of a service; rmw_request.cpp and rmw_response.cpp of rmw_fastrtps say what it does.
template <class Request, class Response>
class RosClient {
 public:
  RosClient(RosNode& node, const std::string& service)
      : requests_(node.writer<Request>("rq" + service + "Request")),
        answers_(node.reader<Response>("rr" + service + "Reply")) {}

  bool is_found() const {
    dds::PublicationMatchedStatus there;
    dds::SubscriptionMatchedStatus back;
    requests_->get_publication_matched_status(there);
    answers_->get_subscription_matched_status(back);
    return there.current_count > 0 && back.current_count > 0;
  }

  /// Returns the request's number.
  std::int64_t send(Request request) {
    eprosima::fastrtps::rtps::WriteParams params;
    params.related_sample_identity().writer_guid() = answers_->guid();
    if (!requests_->write(&request, params)) throw std::runtime_error("not written");
    return params.sample_identity().sequence_number().to64long();
  }

  /// Returns the answer to the request of this number. Answers to others are counted in `others`.
  std::optional<Response> answer(std::int64_t number) {
    dds::SampleInfo info;
    while (auto response = next_sample<Response>(*answers_, info)) {
      const auto& related = info.related_sample_identity;
      if (related.writer_guid() == answers_->guid() &&
          static_cast<std::int64_t>(related.sequence_number().to64long()) == number)
        return response;
      ++others;
    }
    return {};
  }

  std::optional<Response> call(Request request) { return answer(send(std::move(request))); }

  int others = 0;

 private:
  dds::DataWriter* requests_;
  dds::DataReader* answers_;
};

/// A client of an action of type jostle_msgs/action/Manipulate.
class RosActionClient {
 public:
  using SendGoal = jostle_msgs::action::Manipulate_SendGoal_Request;
  using GetResult = jostle_msgs::action::Manipulate_GetResult_Request;
  using Uuid = std::array<std::uint8_t, 16>;

  RosActionClient(RosNode& node, const std::string& name)
      : goals(node, name + "/_action/send_goal"),
        results(node, name + "/_action/get_result"),
        cancelling(node, name + "/_action/cancel_goal"),
        feedback(node.reader<jostle_msgs::action::Manipulate_FeedbackMessage>("rt" + name + "/_action/feedback")),
        statuses(node.reader<action_msgs::msg::GoalStatusArray>("rt" + name + "/_action/status", true)) {}

  bool wait_for_server() const {
    return soon(std::chrono::seconds(60), [&] {
      dds::SubscriptionMatchedStatus heard, told;
      feedback->get_subscription_matched_status(heard);
      statuses->get_subscription_matched_status(told);
      return goals.is_found() && results.is_found() && cancelling.is_found() && heard.current_count > 0 &&
             told.current_count > 0;
    });
  }

  bool send(const Uuid& id, const jostle_msgs::msg::Goal& goal) {
    SendGoal request;
    request.goal_id().uuid(id);
    request.goal().goal(goal);
    const auto response = goals.call(request);
    if (!response) throw std::runtime_error("no answer to a goal");
    return response->accepted();
  }

  std::int64_t ask_for_result(const Uuid& id) {
    GetResult request;
    request.goal_id().uuid(id);
    return results.send(request);
  }

  /// Returns return code, and how many goals are cancelled.
  std::pair<int, std::size_t> cancel(const Uuid& id, std::int32_t until = 0) {
    action_msgs::srv::CancelGoal_Request request;
    request.goal_info().goal_id().uuid(id);
    request.goal_info().stamp().sec(until);
    const auto response = cancelling.call(request);
    if (!response) throw std::runtime_error("no answer to a cancel");
    return {response->return_code(), response->goals_canceling().size()};
  }

  /// Waits for feedback of a goal whose phase is this.
  bool wait_for_phase(const Uuid& id, const std::string& phase) {
    dds::SampleInfo info;
    while (const auto message = next_sample<jostle_msgs::action::Manipulate_FeedbackMessage>(*feedback, info)) {
      if (message->goal_id().uuid() == id && message->feedback().feedback().phase() == phase) return true;
    }
    return false;
  }

  /// Returns the different statuses of a goal, one after the other, up to `last`.
  std::vector<int> statuses_until(const Uuid& id, int last) {
    std::vector<int> seen;
    dds::SampleInfo info;
    while (seen.empty() || seen.back() != last) {
      const auto array = next_sample<action_msgs::msg::GoalStatusArray>(*statuses, info);
      if (!array) return seen;
      for (const auto& status : array->status_list()) {
        if (status.goal_info().goal_id().uuid() != id) continue;
        if (seen.empty() || seen.back() != status.status()) seen.push_back(status.status());
      }
    }
    return seen;
  }

  RosClient<SendGoal, jostle_msgs::action::Manipulate_SendGoal_Response> goals;
  RosClient<GetResult, jostle_msgs::action::Manipulate_GetResult_Response> results;
  RosClient<action_msgs::srv::CancelGoal_Request, action_msgs::srv::CancelGoal_Response> cancelling;
  dds::DataReader* feedback;
  dds::DataReader* statuses;
};

}  // namespace jostle::tests
