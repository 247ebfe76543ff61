#pragma once
/// \file
/// IPv4 sockets: what the checks of the network and of a second host share.

#include <netinet/in.h>

#include <chrono>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "idl/types/result.hpp"
#include "idl/types/time.hpp"

namespace jostle::tools {

class Socket {
 public:
  explicit Socket(int type);  ///< SOCK_DGRAM or SOCK_STREAM
  static Socket adopt(int descriptor) { return Socket(Adopted{descriptor}); }
  ~Socket();
  Socket(Socket&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  Socket& operator=(Socket&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }

  int get() const { return descriptor_; }

  /// Whether there is something to read by the deadline.
  bool readable(TimePoint deadline, std::stop_token stop = {}) const;

 private:
  struct Adopted {
    int descriptor;
  };
  explicit Socket(Adopted adopted) : descriptor_(adopted.descriptor) {}

  int descriptor_;
};

inline in_addr any_address() { return {htonl(INADDR_ANY)}; }

/// Makes the address of a port; `port` is a plain number, such as 7400.
sockaddr_in endpoint(in_addr address, int port);
const sockaddr* generic(const sockaddr_in& address);
std::optional<sockaddr_in> own_endpoint(const Socket& socket);
std::string to_string(in_addr address);

/// Returns the address that datagrams to `other` would leave from, by the kernel's routes.
std::optional<in_addr> route_to(in_addr other);

/// Says that a step failed, and why the last system call did.
std::string failed_step(const std::string& step);

/// Fast DDS's discovery group: RTPS 2.2, Sec. 9.6.1.4.
inline constexpr const char* kGroup = "239.255.0.1";

/// An Ear waits for datagrams at one port.
class Ear {
 public:
  /// Opens an ear at a port of this host; 0: any. `group_through`: it hears the discovery group through this interface,
  /// too.
  /// Error: the step that failed.
  static Result<Ear> open(int port, std::optional<in_addr> group_through = {});
  /// Opens an ear at the first free port of those that participants of the domain could have.
  static Result<Ear> open_in_domain(int domain);

  int port() const { return port_; }

  /// Whether this very datagram came by the deadline.
  bool hears(const std::string& datagram, TimePoint deadline) const;

 private:
  Ear(Socket socket, int port) : socket_(std::move(socket)), port_(port) {}

  Socket socket_;
  int port_;
};

/// Sends a datagram. `through`: the interface, for datagrams to the group. Error: the step that failed.
Result<void> send_datagram(const std::string& datagram, in_addr to, int port, std::optional<in_addr> through = {});

}  // namespace jostle::tools
