#pragma once
/// \file
/// Coming into a domain. For the .cpp files of this room.

#include <chrono>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <memory>

#include "services/wire/dds/directory.hpp"
#include "services/wire/dds/endpoint_watch.hpp"

namespace jostle::wire {

/// Hears of other participants.
class Doorkeeper : public eprosima::fastdds::dds::DomainParticipantListener {
 public:
  /// Returns how many there are that this participant does not talk to: unprotected ones if it is protected, else
  /// protected ones. Threads: any.
  virtual int apart() const = 0;
};

/// A participant, with the listener that must outlive it, and what it hears.
struct Joined {
  std::shared_ptr<Doorkeeper> listener;
  std::shared_ptr<const Directory> directory;
  eprosima::fastdds::dds::DomainParticipant* participant = nullptr;  ///< null: the middleware refused
};

/// Whether a participant of this QoS has an identity.
bool is_protected(const eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Creates a participant that `watch` (may be empty) hears from. A protected one has
/// authenticated with everybody who answers when this returns: after kHail where all is well.
///
/// When participants come at the same moment, Fast DDS 2.9.1 now and then keeps two of them apart: one
/// side drops the other's first announcement while it sets itself up, takes later ones for known,
/// and never answers the other's requests, which come each second (4 of 202 groups of four on two
/// cores had such a pair). Only a newcomer is answered, so a participant that still waits after kPatience
/// joins again, once. A stranger who never answers makes every start wait as long, and gets nothing.
Joined join(int domain, const eprosima::fastdds::dds::DomainParticipantQos& qos,
            const std::shared_ptr<EndpointWatch>& watch);

/// How long a newcomer listens for others. Those who are there answer within some milliseconds.
inline constexpr std::chrono::milliseconds kHail{200};
/// How long a handshake may take; the middleware repeats after 1 s what was lost.
inline constexpr std::chrono::milliseconds kPatience{2500};

}  // namespace jostle::wire
