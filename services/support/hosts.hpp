#pragma once
/// \file
/// Several hosts on one machine: network namespaces on a switch.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/support/cable.hpp"

namespace jostle::services {

/// Hosts 10.77.0.1, 10.77.0.2, ... with a cable each to one switch. Each has its own
/// addresses, ports and shared memory, and nothing of them reaches the outside. They
/// are gone when this and the last process in them is.
///
/// Threads  one of its own where the cables are not perfect; calls safe from any thread.
class Hosts {
 public:
  /// `quality`: of every cable, see there.
  /// Error kUnavailable  no right to make namespaces, no `ip`, no TAP devices; says the remedy
  static Result<std::unique_ptr<Hosts>> make(int count, const LinkQuality& quality = {});
  ~Hosts();
  Hosts(const Hosts&) = delete;
  Hosts& operator=(const Hosts&) = delete;

  int count() const { return static_cast<int>(places_.size()); }

  /// Of a host, from 1.
  static std::string address(int host);

  /// Runs `act` on a thread of its own and waits: what it starts, threads and processes,
  /// lives on that host. Exceptions of `act` come through.
  void on(int host, const std::function<void()>& act) const;

  /// The cable between a host and the switch. What is on its way over a cable that is
  /// pulled out is lost.
  void plug(int host, bool in) const;

  /// Frames that the cables carried and lost so far; perfect cables do not count.
  CableCounts counts() const;

 private:
  /// A network of its own and the mounts that go with it, as open files.
  struct Place {
    int network = -1, mounts = -1;
  };

  Hosts() = default;
  void build(int count, const LinkQuality& quality);
  void connect(int host, const LinkQuality& quality);
  static Place new_place();
  static void inside(const Place& place, const std::function<void()>& act);

  Place switch_;
  std::vector<Place> places_;
  std::unique_ptr<Cables> cables_;
};

}  // namespace jostle::services
