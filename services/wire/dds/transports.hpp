#pragma once
/// \file
/// What a participant's transports need of this machine. For the .cpp files of this room.

#include <cstdint>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::wire {

/// Limits the transports to addresses of this machine: sockets are bound to the loopback.
void keep_on_this_machine(eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Checks that a machine has an IPv4 address, if a transport needs one: without, the middleware makes participants
/// that nobody hears. Error kUnavailable: says the remedy.
Result<void> check_addresses(const eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Room in /dev/shm for the segments and ports of one participant.
///
/// The middleware makes segments larger than what is left of the file system, and whoever writes to a page that has no
/// room is killed (SIGBUS). So the room is taken before, and while participants are made one after the other, it
/// becomes that of their segments, every page of them. Other programs that fill /dev/shm then find it full; we do not.
class SharedMemoryRoom {
 public:
  /// Looks whether there is room for what `qos` wants, and for the participant's ports on that domain. Where there is
  /// not, or where ports are somebody else's, why_not() says why; without shared memory in `qos` there is nothing to
  /// do. Until this object ends other participants of this machine that are made like this wait.
  SharedMemoryRoom(const eprosima::fastdds::dds::DomainParticipantQos& qos, int domain,
                   const std::filesystem::path& folder = "/dev/shm");
  ~SharedMemoryRoom();
  SharedMemoryRoom(const SharedMemoryRoom&) = delete;
  SharedMemoryRoom& operator=(const SharedMemoryRoom&) = delete;

  /// "" if the participant can be made as it is.
  const std::string& why_not() const { return why_not_; }

  /// Gives the room free for the participant to take.
  void hand_over();

  /// Takes every page of the segments that this process has by now. False: somebody else was faster; the participant
  /// must go.
  bool take_segments() const;

 private:
  std::string take(std::uint64_t bytes);

  const std::filesystem::path folder_;
  int lock_ = -1, reserved_ = -1;
  std::string why_not_;
};

/// Takes shared memory out of the transports. Where nothing else is left, UDP comes in.
void use_udp_instead(eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Whether a transport is shared memory: of the middleware's own choice, too.
bool uses_shared_memory(const eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Hides variables that the middleware reads itself, so that what we chose is in force; they are back at the end.
class HiddenVariables {
 public:
  HiddenVariables();
  ~HiddenVariables();
  HiddenVariables(const HiddenVariables&) = delete;
  HiddenVariables& operator=(const HiddenVariables&) = delete;

 private:
  std::optional<std::string> server_, file_;
};

}  // namespace jostle::wire
