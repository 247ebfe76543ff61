#pragma once
/// \file
/// Several hosts on one machine: network namespaces on a switch.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/common/lab/cable.hpp"

namespace jostle::common {

/// Hosts 10.77.0.1, 10.77.0.2, ... with a cable each to one switch. Each has its own
/// addresses, ports and shared memory, and nothing of them reaches the outside. A host is
/// gone when this and the last process in it is.
///
/// Threads  one per host, one for the switch, one for cables that are not perfect;
///          calls safe from any thread.
class Hosts {
 public:
  /// `quality`: that of every cable.
  /// Errors   kInvalidArgument  count
  ///          kUnavailable      no right to make namespaces, no `ip`, no TAP devices; says the remedy
  static Result<std::unique_ptr<Hosts>> make(int count, const LinkQuality& quality = {});
  ~Hosts();
  Hosts(const Hosts&) = delete;
  Hosts& operator=(const Hosts&) = delete;

  int count() const { return static_cast<int>(hosts_.size()); }

  /// The address of a host; hosts are numbered from 1.
  static std::string address(int host);

  /// Runs `act` on the host's thread and waits: what it starts, threads and processes,
  /// lives on that host. It runs at once if this is that thread; else after whatever runs there.
  /// Exceptions of `act` come through.
  void on(int host, const std::function<void()>& act) const;

  /// The cable between a host and the switch. What is on its way over a cable that is
  /// pulled out is lost.
  void plug(int host, bool in) const;

  /// Frames that the cables carried and lost so far; perfect cables do not count.
  CableCounts counts() const;

 private:
  class Resident;

  Hosts();
  void build(int count, const LinkQuality& quality);
  void connect(int host, const LinkQuality& quality);

  std::unique_ptr<Cables> cables_;
  std::unique_ptr<Resident> switch_;
  std::vector<std::unique_ptr<Resident>> hosts_;
};

}  // namespace jostle::common
