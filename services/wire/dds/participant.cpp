#include "services/wire/dds/participant.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fastdds/rtps/attributes/ServerAttributes.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/config.h>
#include <fastrtps/utils/IPLocator.h>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <thread>
#include <typeinfo>

#include "idl/types/hash.hpp"
#include "services/common/process/domain.hpp"
#include "services/common/process/environment.hpp"
#include "services/wire/dds/core.hpp"
#include "services/wire/dds/directory.hpp"
#include "services/wire/dds/endpoint_watch.hpp"
#include "services/wire/dds/middleware_log.hpp"
#include "services/wire/dds/profiles.hpp"
#include "services/wire/dds/security.hpp"
#include "services/wire/dds/transports.hpp"

namespace jostle::wire {
namespace {

using eprosima::fastdds::dds::DomainParticipant;
using eprosima::fastdds::dds::DomainParticipantFactory;
using eprosima::fastdds::dds::DomainParticipantQos;

// Bytes; holds a burst of trajectories. The kernel gives less where
// net.core.rmem_max is lower, and lost packets are then sent again.
constexpr std::uint32_t kSocketBuffer = 4 << 20;
// Processes per host that peers greet unasked; the middleware's default is 4. One more
// than that is not found, and each costs a datagram per peer and announcement.
constexpr std::uint32_t kPeersPerHost = 64;
// Processes per host and domain: each looks for a free pair of ports. The middleware's default is
// 100; one more comes up deaf, without a word.
constexpr std::uint32_t kMostPerHost = 1000;
constexpr std::chrono::seconds kServerAnswer{5};    // it takes some 100 ms where it is there
constexpr std::chrono::seconds kServerGreeting{1};  // for who can wait: it says so, and goes on
constexpr std::chrono::milliseconds kGlance{10};
constexpr const char* kGroup = "239.255.0.1";  // RTPS 2.2, 9.6.1.4
// Bytes; several samples of 1 MiB, whose p99 was 5 ms, and 39 ms with the middleware's 512 KiB.
constexpr std::uint32_t kSegment = 8 << 20;

using common::environment;

// Once per process: the middleware keeps profiles in one place.
Result<void> load_profiles_once() {
  static const Result<void> result = [] {
    DomainParticipantFactory::get_instance()->load_profiles();  // its own: FASTRTPS_DEFAULT_PROFILES_FILE
    auto loaded = load_profiles(profiles_file());
    limit_middleware_log();
    return loaded;
  }();
  return result;
}

Result<DomainParticipantQos> make_qos(const std::string& name) {
  const auto* factory = DomainParticipantFactory::get_instance();
  std::string profile = environment("JOSTLE_DDS_TRANSPORT");
  if (profile.empty()) profile = environment("FASTRTPS_DEFAULT_PROFILES_FILE").empty() ? "udp" : "default";
  DomainParticipantQos qos;
  if (profile == "default") {
    qos = factory->get_default_participant_qos();
  } else if (factory->get_participant_qos_from_profile(profile, qos) != ReturnCode_t::RETCODE_OK) {
    const auto built_in = built_in_participant(profile);
    if (!built_in) {
      return Error{
          Code::kInvalidArgument,
          fmt::format(
              "JOSTLE_DDS_TRANSPORT: got '{}', wanted udp, shared_memory, default or a participant profile of '{}'",
              profile, profiles_file().path.string())};
    }
    qos = *built_in;
  }
  qos.name(name);
  return qos;
}

eprosima::fastrtps::rtps::Locator_t locator(const std::string& address, std::uint32_t port) {
  eprosima::fastrtps::rtps::Locator_t result;
  result.kind = LOCATOR_KIND_UDPv4;
  eprosima::fastrtps::rtps::IPLocator::setIPv4(result, address);
  result.port = port;  // 0: those that the domain's processes have
  return result;
}

void find_by(const Discovery& discovery, const common::NetworkChoice& choice, DomainParticipantQos& qos) {
  using eprosima::fastrtps::rtps::DiscoveryProtocol_t;
  auto& builtin = qos.wire_protocol().builtin;
  const bool lists = discovery.mode == Discovery::Mode::kPeers || discovery.mode == Discovery::Mode::kLocalhost ||
                     (discovery.mode == Discovery::Mode::kMulticast && !discovery.hosts.empty());
  if (lists) {
    builtin.initialPeersList.push_back(locator("127.0.0.1", 0));  // the other processes of this host
    for (const Discovery::Host& host : discovery.hosts) builtin.initialPeersList.push_back(locator(host.address, 0));
    if (discovery.mode == Discovery::Mode::kMulticast) builtin.initialPeersList.push_back(locator(kGroup, 0));
  }
  // An address for discovery, any one, without which the middleware would take the group's as well.
  if (!choice.joins_group) builtin.metatrafficUnicastLocatorList.push_back(locator("0.0.0.0", 0));
  if (discovery.mode == Discovery::Mode::kServer) {
    builtin.discovery_config.discoveryProtocol =
        choice.super_client ? DiscoveryProtocol_t::SUPER_CLIENT : DiscoveryProtocol_t::CLIENT;
    for (std::size_t i = 0; i < discovery.hosts.size(); ++i) {
      if (discovery.hosts[i].address.empty()) continue;
      eprosima::fastdds::rtps::RemoteServerAttributes server;
      eprosima::fastdds::rtps::get_server_client_default_guidPrefix(static_cast<int>(i), server.guidPrefix);
      server.metatrafficUnicastLocatorList.push_back(locator(discovery.hosts[i].address, discovery.hosts[i].port));
      builtin.discovery_config.m_DiscoveryServers.push_back(server);
    }
  }
  if (choice.only_this_machine) keep_on_this_machine(qos);
}

// How a server itself finds others is its own affair: whoever knows it comes.
Result<common::NetworkChoice> choose_way(bool is_server) {
  if (is_server) return common::NetworkChoice{};
  return common::choose_network();
}

Result<Discovery> parse_way(const common::NetworkChoice& choice) {
  auto discovery_result = parse_discovery(choice.discovery);
  if (discovery_result || !choice.origin.starts_with("ROS_")) return discovery_result;
  return Error{discovery_result.error().code, fmt::format("{}: {}", choice.origin, discovery_result.error().message)};
}

// Why a UDP socket cannot be bound there; empty if it can. `shares`: with others that share, too.
std::string why_taken(const std::string& address, std::uint16_t port, bool shares) {
  sockaddr_in endpoint{};
  endpoint.sin_family = AF_INET;
  endpoint.sin_port = htons(port);
  const int handle = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const int reuse = shares;
  const bool ok = inet_pton(AF_INET, address.c_str(), &endpoint.sin_addr) == 1 && handle >= 0 &&
                  setsockopt(handle, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse) == 0 &&
                  bind(handle, reinterpret_cast<const sockaddr*>(&endpoint), sizeof endpoint) == 0;
  const std::string problem = ok ? "" : std::strerror(errno);
  if (handle >= 0) close(handle);
  return problem;
}

// The middleware creates a server that nobody reaches, and says nothing.
Result<void> check_address(const ServerOptions& server) {
  const std::string problem = why_taken(server.address, server.port, false);
  if (problem.empty()) return {};
  return Error{Code::kUnavailable,
               fmt::format("{}:{}: {}; wanted an address of this host (`ip address`) and a free port", server.address,
                           server.port, problem)};
}

// Likewise a participant that hears nobody come.
Result<void> check_multicast_port(int domain, const DomainParticipantQos& qos) {
  const std::uint32_t port = qos.wire_protocol().port.getMulticastPort(static_cast<std::uint32_t>(domain));
  const std::string problem = why_taken("0.0.0.0", static_cast<std::uint16_t>(port), true);
  if (problem.empty()) return {};
  return Error{
      Code::kUnavailable,
      fmt::format(
          "DDS domain {}: another program has its UDP port of discovery, {}: {}; wanted it free: end that program "
          "(`ss -ulpn`), or choose a ROS_DOMAIN_ID whose ports nobody is given, 0 to 100",
          domain, port, problem)};
}

// A client hears of the server before anybody else, and of others from it.
Result<void> await_server(const DomainParticipant& participant, const Discovery& discovery,
                          const common::NetworkChoice& choice, std::chrono::seconds patience) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (participant.get_participant_names().size() < 2) {  // we are one
    if (std::chrono::steady_clock::now() < deadline) {
      std::this_thread::sleep_for(kGlance);
      continue;
    }
    std::vector<std::string> places;
    for (const Discovery::Host& host : discovery.hosts) {
      if (!host.address.empty()) places.push_back(fmt::format("{}:{}", host.address, host.port));
    }
    return Error{Code::kUnavailable,
                 fmt::format("{}: no discovery server answered at {} within {} s; remedy: start `jostle "
                             "discovery-server` there, on the same DDS domain; let firewalls pass that UDP port; "
                             "`jostle doctor` tries it",
                             choice.origin, fmt::join(places, ", "), patience.count())};
  }
  return {};
}

void serve(const ServerOptions& server, DomainParticipantQos& qos) {
  auto& builtin = qos.wire_protocol().builtin;
  builtin.discovery_config.discoveryProtocol = eprosima::fastrtps::rtps::DiscoveryProtocol_t::SERVER;
  eprosima::fastdds::rtps::get_server_client_default_guidPrefix(server.id, qos.wire_protocol().prefix);
  builtin.metatrafficUnicastLocatorList.push_back(locator(server.address, server.port));
}

}  // namespace

const char* middleware_version() { return FASTRTPS_VERSION_STR; }

std::vector<std::string> Participant::others() const { return core_->participant->get_participant_names(); }

std::optional<ParticipantInfo> Participant::find(std::uint64_t id) const { return core_->directory->find(id); }

std::string ParticipantInfo::text() const {
  std::string text = name.empty() ? "a participant without a name" : name;
  if (!host.empty()) text += " on " + host;
  if (pid > 0) text += fmt::format(", process {}", pid);
  return text;
}

std::optional<DomainParticipantQos> built_in_participant(const std::string& profile) {
  if (profile != "udp" && profile != "shared_memory") return {};
  DomainParticipantQos qos;
  // The middleware's defaults give joins of 3 s and stalls of 20 s.
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.leaseDuration = {2, 0};
  discovery.leaseDuration_announcementperiod = {0, 500'000'000};
  qos.wire_protocol().builtin.mutation_tries = kMostPerHost;
  auto& transport = qos.transport();
  transport.use_builtin_transports = false;
  if (profile == "shared_memory") {
    const auto memory = std::make_shared<eprosima::fastdds::rtps::SharedMemTransportDescriptor>();
    memory->segment_size(kSegment);
    transport.user_transports.push_back(memory);
  }
  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->sendBufferSize = udp->receiveBufferSize = kSocketBuffer;
  udp->maxInitialPeersRange = kPeersPerHost;
  transport.user_transports.push_back(udp);
  return qos;
}

std::uint32_t socket_buffer() {
  DomainParticipantQos qos = *built_in_participant("udp");
  DomainParticipantFactory::get_instance()->get_participant_qos_from_profile("udp", qos);
  std::uint32_t largest = 0;
  for (const auto& transport : qos.transport().user_transports) {
    const auto socket = std::dynamic_pointer_cast<eprosima::fastdds::rtps::SocketTransportDescriptor>(transport);
    if (socket) largest = std::max(largest, socket->receiveBufferSize);
  }
  return largest;
}

std::uint64_t participant_id(const eprosima::fastrtps::rtps::GUID_t& guid) {
  const auto* bytes = reinterpret_cast<const char*>(guid.guidPrefix.value);
  return hash_of(std::string_view(bytes, sizeof guid.guidPrefix.value)).low;
}

Guid to_guid(const eprosima::fastrtps::rtps::GUID_t& guid) {
  Guid result;
  std::ranges::copy(guid.guidPrefix.value, result.begin());
  std::ranges::copy(guid.entityId.value, result.begin() + sizeof guid.guidPrefix.value);
  return result;
}

Result<Participant> Participant::open(const ParticipantOptions& options) { return create(options, nullptr); }

Result<Participant> Participant::open_server(const ParticipantOptions& options, const ServerOptions& server) {
  return create(options, &server);
}

Result<Participant> Participant::create(const ParticipantOptions& options, const ServerOptions* server) {
  auto domain_result = common::choose_domain(options.domain);
  if (!domain_result) return domain_result.error();
  if (auto ok = load_profiles_once(); !ok) return ok.error();
  auto qos_result = make_qos(options.name);
  if (!qos_result) return qos_result.error();
  DomainParticipantQos& qos = *qos_result;
  const auto space_result = parse_namespace(environment("JOSTLE_NAMESPACE"));
  if (!space_result) return space_result.error();
  const std::string identity = options.identity.value_or(environment("JOSTLE_SECURE"));
  const auto choice_result = choose_way(server != nullptr);
  if (!choice_result) return choice_result.error();
  const auto discovery_result = parse_way(*choice_result);
  if (!discovery_result) return discovery_result.error();
  find_by(*discovery_result, *choice_result, qos);
  if (auto ok = check_addresses(qos); !ok) return ok.error();
  if (discovery_result->mode == Discovery::Mode::kMulticast && !server) {
    if (auto ok = check_multicast_port(*domain_result, qos); !ok) return ok.error();
  }
  if (server) {
    if (auto ok = check_address(*server); !ok) return ok.error();
    serve(*server, qos);
  }
  if (!identity.empty()) {
    if (server || discovery_result->mode == Discovery::Mode::kServer) {
      return Error{Code::kInvalidArgument,
                   "a discovery server on a protected domain: the middleware has none that works; "
                   "wanted --discovery multicast or peers:HOST,..., or no --secure (JOSTLE_SECURE)"};
    }
    if (auto ok = secure(qos, identity, options.role); !ok) return ok.error();
  }
  introduce(qos);
  Joined joined = join(*domain_result, qos, options.watch);
  if (!joined.participant) {
    return Error{Code::kUnavailable, fmt::format("DDS domain {}: no participant could be created; check the network "
                                                 "interfaces, /dev/shm and the profiles in '{}'",
                                                 *domain_result, profiles_file().path.string())};
  }
  Participant participant(std::make_shared<Core>(std::move(joined), *domain_result, *space_result));
  if (discovery_result->mode == Discovery::Mode::kServer) {
    const auto patience = options.waits_for_server ? kServerGreeting : kServerAnswer;
    auto ok = await_server(*participant.core_->participant, *discovery_result, *choice_result, patience);
    if (!ok && !options.waits_for_server) return ok.error();
    if (!ok) fmt::print(stderr, "warning: {}; waiting for it\n", ok.error().message);
  }
  return participant;
}

int Participant::domain() const { return core_->domain; }
const std::string& Participant::space() const { return core_->space; }

std::string Participant::wire_name(const std::string& topic, Scope scope) const {
  return scope == Scope::kRobot ? in_namespace(core_->space, topic) : topic;
}

std::vector<std::string> profiles_for(const Participant::Core& core, const std::string& topic, const Qos& qos) {
  if (qos.kind.empty()) return {};
  std::vector<std::string> names{topic};
  const std::string inside = in_namespace(core.space, "rt/");
  if (topic.starts_with(inside)) names.push_back("rt/" + topic.substr(inside.size()));
  names.emplace_back(qos.kind);
  return names;
}

std::string Participant::who_is_apart() const { return core_->who_is_apart(); }

std::string Participant::possible_cause() const {
  const std::string apart = who_is_apart();
  return apart.empty() ? "" : "; " + apart;
}

std::string Participant::Core::who_is_apart() const {
  const int count = listener_->apart();
  if (count == 0) return "";
  const bool ours = is_protected(participant->get_qos());
  return fmt::format(
      "{} of domain {} {} {} and this program is {}: they do not hear each other; give both --secure, or "
      "neither",
      count == 1 ? "a participant" : fmt::format("{} participants", count), domain, count == 1 ? "is" : "are",
      ours ? "unprotected" : "protected", ours ? "protected" : "unprotected");
}

std::uint64_t Participant::id() const { return participant_id(core_->participant->guid()); }

Participant::Core::Core(Joined joined, int domain_id, std::string name_space)
    : participant(joined.participant),
      publisher(participant->create_publisher(eprosima::fastdds::dds::PUBLISHER_QOS_DEFAULT)),
      subscriber(participant->create_subscriber(eprosima::fastdds::dds::SUBSCRIBER_QOS_DEFAULT)),
      directory(std::move(joined.directory)),
      domain(domain_id),
      space(std::move(name_space)),
      listener_(std::move(joined.listener)) {}

Participant::Core::~Core() {
  participant->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant);
}

eprosima::fastdds::dds::Topic* Participant::Core::acquire_topic(const std::string& name,
                                                                eprosima::fastdds::dds::TypeSupport type) {
  const std::lock_guard lock(mutex_);
  auto* topic = static_cast<eprosima::fastdds::dds::Topic*>(participant->lookup_topicdescription(name));
  if (!topic) {
    type.register_type(participant);
    topic = participant->create_topic(name, type.get_type_name(), eprosima::fastdds::dds::TOPIC_QOS_DEFAULT);
  }
  // The middleware would use the first of two serializers of one name for both.
  const auto serializer = participant->find_type(type.get_type_name());
  const bool ours = !serializer.empty() && typeid(*serializer.get()) == typeid(*type.get());
  if (!topic || topic->get_type_name() != type.get_type_name() || !ours) {
    throw SetupError(fmt::format("topic {}: the middleware refused it with type {}", name, type.get_type_name()));
  }
  ++users_[name];
  return topic;
}

void Participant::Core::release_topic(eprosima::fastdds::dds::Topic* topic) {
  const std::lock_guard lock(mutex_);
  const auto user = users_.find(topic->get_name());
  if (--user->second > 0) return;
  users_.erase(user);
  participant->delete_topic(topic);
}

}  // namespace jostle::wire
