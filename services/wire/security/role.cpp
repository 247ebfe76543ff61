#include "services/wire/security/role.hpp"

#include <algorithm>

namespace jostle::wire {

Rights rights_of(Role role) {
  switch (role) {
    case Role::kRobot:
      return {.publish = {"*"}, .subscribe = {"*"}};
    // Said topics in full: no pattern of a worker may ever match a robot's topic,
    // whatever namespaces there will be.
    case Role::kWorker:
      return {.publish = {"rt/pool/worker", "rt/pool/result", "rt/doctor/there", "rt/doctor/back"},
              .subscribe = {"rt/pool/*", "rt/doctor/*"}};
    case Role::kObserver:
      return {.publish = {}, .subscribe = {"*"}};
    case Role::kServer:
      break;
  }
  return {};
}

bool covers(Role role, Role needed) { return role == Role::kRobot || role == needed; }

std::string to_string(Role role) {
  switch (role) {
    case Role::kRobot:
      return "robot";
    case Role::kWorker:
      return "worker";
    case Role::kObserver:
      return "observer";
    case Role::kServer:
      break;
  }
  return "server";
}

std::optional<Role> parse_role(std::string_view word) {
  const auto role = std::ranges::find_if(kRoles, [&](Role candidate) { return to_string(candidate) == word; });
  if (role == kRoles.end()) return {};
  return *role;
}

}  // namespace jostle::wire
