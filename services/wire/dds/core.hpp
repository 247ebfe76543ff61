#pragma once
/// \file
/// What participant, writers and readers share. For the .cpp files of this room.

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "idl/types/qos.hpp"
#include "services/wire/dds/guid.hpp"
#include "services/wire/dds/joining.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::wire {

/// Returns the id of an entity's participant. It follows from the GUID's first 12 bytes, which all entities of a
/// participant share.
std::uint64_t participant_id(const eprosima::fastrtps::rtps::GUID_t& guid);

Guid to_guid(const eprosima::fastrtps::rtps::GUID_t& guid);

class Directory;

class Participant::Core {
 public:
  /// Owns the participant.
  Core(Joined joined, int domain, std::string space);
  ~Core();
  Core(const Core&) = delete;
  Core& operator=(const Core&) = delete;

  /// Returns a topic that is shared by all its writers and readers here; release it in the end.
  /// Throws SetupError.
  eprosima::fastdds::dds::Topic* acquire_topic(const std::string& name, eprosima::fastdds::dds::TypeSupport type);
  void release_topic(eprosima::fastdds::dds::Topic* topic);

  /// See Participant::who_is_apart().
  std::string who_is_apart() const;

  eprosima::fastdds::dds::DomainParticipant* const participant;
  eprosima::fastdds::dds::Publisher* const publisher;
  eprosima::fastdds::dds::Subscriber* const subscriber;
  const std::shared_ptr<const Directory> directory;
  const int domain;
  const std::string space;  // namespace

 private:
  std::mutex mutex_;  // guards users_ and the creation of topics
  std::map<std::string, int> users_;
  const std::shared_ptr<Doorkeeper> listener_;  // the participant calls it
};

/// Who is at the other end of a writer or reader: the endpoints that the middleware matched
/// with it. Threads: any.
class Peers {
 public:
  using Guid = eprosima::fastrtps::rtps::GUID_t;

  /// `change` as in the middleware's matched statuses: positive came, negative went.
  void update(const Guid& peer, int change) {
    const std::lock_guard lock(mutex_);
    if (change > 0) {
      peers_.push_back(peer);
    } else {
      std::erase(peers_, peer);
    }
    changed_.notify_all();
  }

  int count() const {
    const std::lock_guard lock(mutex_);
    return static_cast<int>(peers_.size());
  }

  bool wait_for(int count, std::chrono::steady_clock::time_point deadline) const {
    std::unique_lock lock(mutex_);
    return changed_.wait_until(lock, deadline, [&] { return static_cast<int>(peers_.size()) >= count; });
  }

  /// Returns the ids of their participants, ascending, each once.
  std::vector<std::uint64_t> participants() const {
    std::vector<std::uint64_t> ids;
    {
      const std::lock_guard lock(mutex_);
      for (const Guid& peer : peers_) ids.push_back(participant_id(peer));
    }
    std::ranges::sort(ids);
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return ids;
  }

  bool include(std::uint64_t participant) const {
    const std::lock_guard lock(mutex_);
    return std::ranges::find(peers_, participant, participant_id) != peers_.end();
  }

 private:
  mutable std::mutex mutex_;  // guards peers_
  mutable std::condition_variable changed_;
  std::vector<Guid> peers_;
};

/// The most samples that a reader of depth kKeepAll holds. It only holds those whose predecessors are
/// still on their way.
inline constexpr int kMostKept = 1 << 16;

/// Returns the profile udp or shared_memory for when the file of profiles does not have it; nothing
/// for other names.
std::optional<eprosima::fastdds::dds::DomainParticipantQos> built_in_participant(const std::string& profile);

/// Returns names of profiles for an endpoint, of which the first that the file has is in force: that of its topic, of
/// the topic without the namespace, of the topic's kind.
std::vector<std::string> profiles_for(const Participant::Core& core, const std::string& topic, const Qos& qos);

/// Sets up a writer, or a reader, by its Qos, where the file of profiles says nothing.
void apply_to_writer(const Qos& qos, eprosima::fastdds::dds::DataWriterQos& writer);
void apply_to_reader(const Qos& qos, eprosima::fastdds::dds::DataReaderQos& reader);

/// Sets what writers and readers have alike.
template <class EndpointQos>
void apply(const Qos& qos, EndpointQos& endpoint) {
  using namespace eprosima::fastdds::dds;
  endpoint.reliability().kind = qos.reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  endpoint.durability().kind = qos.latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  endpoint.history().kind = KEEP_LAST_HISTORY_QOS;
  endpoint.history().depth = qos.depth;
  // No other limit than the depth, so that there is one number to change.
  endpoint.resource_limits().max_samples = endpoint.resource_limits().max_samples_per_instance = 0;
  endpoint.resource_limits().max_instances = qos.instances;
  // Room for one sample; the rest is allocated when it is needed.
  endpoint.resource_limits().allocated_samples = 1;
  if (qos.depth == kKeepAll) {
    endpoint.history().kind = KEEP_ALL_HISTORY_QOS;
    endpoint.history().depth = 1;  // means nothing, and must not be 0
    endpoint.resource_limits().max_samples_per_instance = kMostKept;
    endpoint.resource_limits().max_samples = 0;  // no limit of their sum
  }
  endpoint.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  endpoint.data_sharing().off();
}

}  // namespace jostle::wire
