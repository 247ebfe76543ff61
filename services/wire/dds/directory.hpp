#pragma once
/// \file
/// Who the other participants are. For the .cpp files of this room.

#include <fastrtps/rtps/builtin/data/ParticipantProxyData.h>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>

#include "services/wire/dds/participant.hpp"

namespace jostle::wire {

/// Puts host and process id into a participant's user data, as "host=NAME;pid=123;".
void introduce(eprosima::fastdds::dds::DomainParticipantQos& qos);

/// A Directory knows the participants that were found and have not gone, by Participant::id(). What they say of
/// themselves is cut to what can be shown. Threads: any.
class Directory {
 public:
  void add(const eprosima::fastrtps::rtps::ParticipantProxyData& data);
  void remove(const eprosima::fastrtps::rtps::GUID_t& guid);
  std::optional<ParticipantInfo> find(std::uint64_t id) const;

 private:
  mutable std::mutex mutex_;  // guards participants_
  std::map<std::uint64_t, ParticipantInfo> participants_;
};

}  // namespace jostle::wire
