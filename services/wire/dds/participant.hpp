#pragma once
/// \file
/// Participant: this process in a DDS domain.

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/wire/dds/discovery.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/security/role.hpp"

namespace jostle::wire {

class EndpointWatch;

/// Thrown if the middleware refuses an entity: a wrong profile, or no memory. That happens only
/// while a program sets itself up, never later; `main` reports it.
struct SetupError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Returns the version of Fast DDS that this program was compiled with, such as "2.9.1".
const char* middleware_version();

struct ParticipantOptions {
  std::string name = "jostle";           ///< as tools list it
  std::optional<int> domain;             ///< 0 to 232; else ROS_DOMAIN_ID, else 0
  std::shared_ptr<EndpointWatch> watch;  ///< hears of all others from the first moment; may be empty
  std::optional<std::string> identity;   ///< its folder; "": unprotected; not given: JOSTLE_SECURE
  std::optional<Role> role;              ///< that an identity must have for this program to do its work
  bool waits_for_server = false;         ///< whether a discovery server may come later; else one must answer
};

/// What a participant says of itself.
struct ParticipantInfo {
  std::string name;       ///< as ParticipantOptions::name has it
  std::string host;       ///< empty where another program does not say it
  std::uint32_t pid = 0;  ///< likewise 0

  /// "jostle_coordinator on lab-2, process 4711", as far as it is known.
  std::string text() const;
};

/// A discovery server listens at an address, and introduces participants to each other.
struct ServerOptions {
  std::string address = "0.0.0.0";  ///< IPv4 to listen at; 0.0.0.0: all of this host
  std::uint16_t port = kServerPort;
  int id = 0;  ///< its place in the list of servers that clients are given
};

/// A process has one Participant: two can deadlock at shutdown (Fast DDS #6193). A copy is
/// another handle to the same participant; writers and readers hold one, so
/// everything may be destroyed in any order.
///
/// The rest comes from the environment, which the programs this one starts inherit; programs
/// set the first three by the options --discovery, --secure and --namespace:
///
///   JOSTLE_DISCOVERY      see parse_discovery(); else what ROS 2's variables say, see common::choose_network()
///   JOSTLE_SECURE         identity folder, see open_identity(); else unprotected
///   JOSTLE_NAMESPACE      see parse_namespace(); else none
///   JOSTLE_PROFILES       file of transports and QoS, see profiles_file()
///   JOSTLE_DDS_TRANSPORT  a participant profile: udp, shared_memory, or one that the file has;
///                         `default` is the default profile of FASTRTPS_DEFAULT_PROFILES_FILE,
///                         and the default where that is set; else udp
///
/// UDP everywhere is as fast as shared memory for messages up to 64 KiB, and a killed process
/// leaves nothing behind. Where shared memory is wanted and /dev/shm has no room for it, or cannot be used, the
/// participant has UDP alone, and a warning on standard error says so. Over shared memory each leaves its segment, and
/// its successor was found after 2.7 to 4.6 s instead of 0.7 to 1.0 s.
///
/// Threads  safe from any thread.
class Participant {
 public:
  /// Errors   kInvalidArgument  domain, transport, discovery, namespace, profiles, identity or its role; says where it
  ///                            came from
  ///          kNotFound, kIo    a host, a file of the identity
  ///          kUnavailable      no IPv4 address, no answer of a discovery server, or the middleware refused
  static Result<Participant> open(const ParticipantOptions& options);

  /// Opens a participant that is a discovery server. Unprotected only: on a protected domain the
  /// server of Fast DDS 2.9.1 aborts.
  static Result<Participant> open_server(const ParticipantOptions& options, const ServerOptions& server);

  int domain() const;

  /// Names this participant in messages: the same number that
  /// WriterBase::matched_participants() gives elsewhere.
  std::uint64_t id() const;

  /// Returns the namespace of its robot's topics; "": none.
  const std::string& space() const;
  /// Returns a topic's name, with the namespace in it where the scope asks for it.
  std::string wire_name(const std::string& topic, Scope scope) const;

  /// Returns who the participant with that id() is, if it was found and has not gone.
  std::optional<ParticipantInfo> find(std::uint64_t id) const;

  /// Returns names of the participants found so far, as ParticipantOptions::name has them; ours is among them.
  std::vector<std::string> others() const;

  /// Says that there are participants in the domain which do not hear this one, as they are protected and it is not, or
  /// the other way round; "" if there are none. A part of a sentence, for messages about somebody who is missing.
  std::string who_is_apart() const;

  /// Returns who_is_apart() as an appendix to the message that somebody was not heard: "; ..." or "".
  std::string possible_cause() const;

  class Core;
  Core& core() const { return *core_; }

 private:
  explicit Participant(std::shared_ptr<Core> core) : core_(std::move(core)) {}

  static Result<Participant> create(const ParticipantOptions& options, const ServerOptions* server);

  std::shared_ptr<Core> core_;
};

}  // namespace jostle::wire
