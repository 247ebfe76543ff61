#include "services/wire/dds/transports.hpp"

#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv6TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <set>

#include "services/common/process/domain.hpp"

namespace jostle::wire {
namespace {

namespace fs = std::filesystem;

using eprosima::fastdds::dds::DomainParticipantQos;
using eprosima::fastdds::rtps::ChainingTransportDescriptor;
using eprosima::fastdds::rtps::SharedMemTransportDescriptor;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastdds::rtps::UDPv6TransportDescriptor;

constexpr std::uint64_t kDefaultSegment = 512 << 10;  // bytes, where a descriptor says 0
constexpr std::uint64_t kSegmentHead = 64 << 10;      // bytes beside what a segment is to hold
// Bytes for a participant's ports and semaphores, of about 60 KiB each, and for those that others open anew.
constexpr std::uint64_t kPorts = 1 << 20;

constexpr const char* kServer = "ROS_DISCOVERY_SERVER";
constexpr const char* kFile = "FASTDDS_ENVIRONMENT_FILE";

using Transport = std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>;

// The transport as what it is, whatever filters are around it; empty if it is another kind.
template <class Descriptor>
std::shared_ptr<Descriptor> as(Transport transport) {
  while (const auto around = std::dynamic_pointer_cast<ChainingTransportDescriptor>(transport))
    transport = around->low_level_descriptor;
  return std::dynamic_pointer_cast<Descriptor>(transport);
}

template <class Descriptor>
bool has(const DomainParticipantQos& qos) {
  return std::ranges::any_of(qos.transport().user_transports,
                             [](const Transport& one) { return as<Descriptor>(one) != nullptr; });
}

std::uint64_t wanted_bytes(const DomainParticipantQos& qos) {
  std::uint64_t bytes = kPorts;
  const auto add = [&bytes](std::uint64_t segment) {
    bytes += (segment > 0 ? segment : kDefaultSegment) + kSegmentHead;
  };
  if (qos.transport().use_builtin_transports) add(0);
  for (const auto& transport : qos.transport().user_transports) {
    const auto memory = as<SharedMemTransportDescriptor>(transport);
    if (memory) add(memory->segment_size());
  }
  return bytes;
}

// A port or a semaphore of the domain that this user may not open; "" if there is none.
std::string closed_port(const fs::path& folder, int domain) {
  constexpr std::string_view kPort = "fastrtps_port";
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename();
    const std::size_t at = name.find(kPort);
    if (at == std::string::npos) continue;
    const int port = std::atoi(name.c_str() + at + kPort.size());
    const int first = common::multicast_port(domain);
    if (port < first || port >= first + common::kPortsPerDomain) continue;
    if (access(entry.path().c_str(), R_OK | W_OK) != 0 && errno == EACCES) return name;
  }
  return "";
}

// The middleware's files that this process has mapped.
std::set<fs::path> mapped_files(const fs::path& folder) {
  std::set<fs::path> files;
  const std::string start = folder.string() + "/fast";
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const std::size_t at = line.find(start);
    if (at != std::string::npos && !line.ends_with(" (deleted)")) files.insert(line.substr(at));
  }
  return files;
}

bool take_pages(const fs::path& file) {
  const int handle = open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (handle < 0) return errno == ENOENT;  // gone, with whoever had it
  struct stat status {};
  const bool taken =
      fstat(handle, &status) == 0 && (status.st_size == 0 || posix_fallocate(handle, 0, status.st_size) == 0);
  close(handle);
  return taken;
}

}  // namespace

bool uses_shared_memory(const DomainParticipantQos& qos) {
  return qos.transport().use_builtin_transports || has<SharedMemTransportDescriptor>(qos);
}

void keep_on_this_machine(DomainParticipantQos& qos) {
  auto& transport = qos.transport();
  if (transport.use_builtin_transports) {
    transport.use_builtin_transports = false;
    transport.user_transports.push_back(std::make_shared<UDPv4TransportDescriptor>());
    transport.user_transports.push_back(std::make_shared<SharedMemTransportDescriptor>());
  }
  for (auto& one : transport.user_transports) {
    // Copies: a file's profiles are shared by all who read it.
    if (const auto udp = std::dynamic_pointer_cast<UDPv4TransportDescriptor>(one)) {
      const auto here = std::make_shared<UDPv4TransportDescriptor>(*udp);
      here->interfaceWhiteList = {"127.0.0.1"};
      one = here;
    } else if (const auto udp6 = std::dynamic_pointer_cast<UDPv6TransportDescriptor>(one)) {
      const auto here = std::make_shared<UDPv6TransportDescriptor>(*udp6);
      here->interfaceWhiteList = {"::1"};
      one = here;
    } else if (const auto other = std::dynamic_pointer_cast<eprosima::fastdds::rtps::SocketTransportDescriptor>(one)) {
      other->interfaceWhiteList = {"127.0.0.1"};
    }
  }
}

Result<void> check_addresses(const DomainParticipantQos& qos) {
  if (!qos.transport().use_builtin_transports && !has<UDPv4TransportDescriptor>(qos)) return {};
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return {};  // the middleware cannot know better
  bool found = false;
  for (const ifaddrs* one = all; one && !found; one = one->ifa_next) {
    found = one->ifa_addr && one->ifa_addr->sa_family == AF_INET && (one->ifa_flags & IFF_UP);
  }
  freeifaddrs(all);
  if (found) return {};
  return Error{Code::kUnavailable,
               "this machine has no IPv4 address, not even 127.0.0.1; wanted one, as DDS goes over UDPv4 here; remedy: "
               "ip link set lo up; ip address add 127.0.0.1/8 dev lo; for other machines an address on their network"};
}

SharedMemoryRoom::SharedMemoryRoom(const DomainParticipantQos& qos, int domain, const fs::path& folder)
    : folder_(folder) {
  if (!uses_shared_memory(qos)) return;
  const std::string obstacle = take(wanted_bytes(qos));
  const std::string port = closed_port(folder, domain);
  if (!obstacle.empty()) {
    why_not_ = fmt::format("{}: {}", folder.string(), obstacle);
  } else if (!port.empty()) {
    why_not_ = fmt::format("{}: {} is another user's", folder.string(), port);
  }
}

// Returns what is in the way, "" if nothing is.
std::string SharedMemoryRoom::take(std::uint64_t bytes) {
  lock_ = open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ < 0) return std::strerror(errno);
  while (flock(lock_, LOCK_EX) != 0 && errno == EINTR) {
  }
  // A file without a name, which cannot stay behind.
  reserved_ = open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (reserved_ < 0) return std::strerror(errno);
  const int problem = posix_fallocate(reserved_, 0, static_cast<off_t>(bytes));
  if (problem == 0) return "";
  return fmt::format("no room for {:.1f} MiB: {}", static_cast<double>(bytes) / (1 << 20), std::strerror(problem));
}

SharedMemoryRoom::~SharedMemoryRoom() {
  hand_over();
  if (lock_ >= 0) close(lock_);
}

void SharedMemoryRoom::hand_over() {
  if (reserved_ >= 0) close(reserved_);
  reserved_ = -1;
}

bool SharedMemoryRoom::take_segments() const { return std::ranges::all_of(mapped_files(folder_), take_pages); }

void use_udp_instead(DomainParticipantQos& qos) {
  auto& transport = qos.transport();
  std::erase_if(transport.user_transports,
                [](const Transport& one) { return as<SharedMemTransportDescriptor>(one) != nullptr; });
  if (transport.use_builtin_transports || transport.user_transports.empty()) {
    transport.user_transports.push_back(std::make_shared<UDPv4TransportDescriptor>());
  }
  transport.use_builtin_transports = false;
}

HiddenVariables::HiddenVariables() {
  const auto hide = [](const char* variable) -> std::optional<std::string> {
    const char* text = std::getenv(variable);
    if (!text) return {};
    std::string value = text;
    unsetenv(variable);
    return value;
  };
  server_ = hide(kServer);
  file_ = hide(kFile);
}

HiddenVariables::~HiddenVariables() {
  if (server_) setenv(kServer, server_->c_str(), 1);
  if (file_) setenv(kFile, file_->c_str(), 1);
}

}  // namespace jostle::wire
