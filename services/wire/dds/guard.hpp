#pragma once
/// \file
/// A guard between the network and the middleware. For the .cpp files of this room.

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

namespace jostle::wire {

/// Puts a Judge (datagrams.hpp) in front of every UDP transport of this QoS, the middleware's own included; what they
/// send goes out untouched. Datagrams that are judged away are counted, and said once a second. The last thing to do
/// to a QoS: transports look like others afterwards.
///
/// Shared memory is not guarded. Only processes of this machine reach it, and who may write into its segments can do
/// worse than send odd messages.
void guard(eprosima::fastdds::dds::DomainParticipantQos& qos);

}  // namespace jostle::wire
