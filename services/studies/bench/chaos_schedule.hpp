#pragma once
/// \file
/// What happens to whom, and when, in `jostle bench chaos`.

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace jostle::studies {

struct Fault {
  enum class Kind {
    kKill,    ///< SIGKILL to a worker, which is replaced
    kStall,   ///< SIGSTOP to a worker, then SIGCONT
    kUnplug,  ///< a host's cable is pulled, then plugged in
  };

  Kind kind = Kind::kKill;
  int target = 0;                      ///< worker from 0; host of workers from 0
  std::chrono::milliseconds at{0};     ///< since the beginning
  std::chrono::milliseconds lasts{0};  ///< until it is made good

  bool operator==(const Fault&) const = default;
};

/// Returns "kill", "stall" or "unplug".
std::string to_string(Fault::Kind kind);

/// Draws so many faults, earliest first, a function of its arguments alone. Kinds and targets are
/// drawn evenly; 0.1 to 0.7 s lie between two faults. Stalls and unpluggings last 0.1 to
/// 3 s, which is shorter and longer than silence makes a worker dead (0.5 s) and than the
/// middleware forgets a process (2 s); a killed worker is replaced after 0.05 to 0.5 s.
/// Nobody is hit again before it was made good, so that every fault counts.
///
/// `hosts`: number of hosts of workers; 0: nothing is unplugged.
std::vector<Fault> chaos_schedule(std::uint64_t seed, int faults, int workers, int hosts);

}  // namespace jostle::studies
