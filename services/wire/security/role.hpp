#pragma once
/// \file
/// Role: what the holder of an identity may say and hear.

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace jostle::wire {

enum class Role {
  kRobot,     ///< everything: coordinator, simulated world, run, bridge
  kWorker,    ///< the pool's topics: hears assignments, says results; no robot and no goal
  kObserver,  ///< hears everything, says nothing: recorders
  kServer,    ///< joins, no topic at all. Meant for discovery servers, which Fast DDS 2.9.1 cannot protect
};

inline constexpr std::array kRoles{Role::kRobot, Role::kWorker, Role::kObserver, Role::kServer};

/// Topics by name, as on the wire; `*` is any run of characters, slashes too.
struct Rights {
  std::vector<std::string> publish, subscribe;
};

Rights rights_of(Role role);

/// Whether a holder of `role` may do all that `needed` asks for.
bool covers(Role role, Role needed);

/// Returns "robot", "worker", "observer" or "server".
std::string to_string(Role role);
std::optional<Role> parse_role(std::string_view word);

}  // namespace jostle::wire
