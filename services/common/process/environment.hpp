#pragma once
/// \file
/// The environment's part in who finds whom: Jostle's own variables and ROS 2's.

#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::common {

/// Returns the value of an environment variable; "" where it is not set.
std::string environment(const char* variable);

/// How processes find each other, and what decided that.
struct NetworkChoice {
  std::string discovery = "multicast";  ///< as --discovery has it
  std::string origin;  ///< what decided, "ROS_STATIC_PEERS=10.0.0.2" or "--discovery multicast"; "": nothing
  bool only_this_machine = false;      ///< nothing is sent to others, nothing of others is heard
  bool joins_group = true;             ///< hears those who announce themselves by multicast
  bool super_client = false;           ///< a discovery server tells it of everybody, not only of those it talks to
  std::vector<std::string> overruled;  ///< variables that want something else and have no say, likewise
};

/// Reads the environment. The first of these that says something decides:
///
///   JOSTLE_DISCOVERY               which --discovery sets
///   ROS_DISCOVERY_SERVER           HOST[:PORT] with semicolons between, also from FASTDDS_ENVIRONMENT_FILE; with
///                                  ROS_LOCALHOST_ONLY=1 it must be on this machine
///   ROS_LOCALHOST_ONLY             1: this machine only
///   ROS_AUTOMATIC_DISCOVERY_RANGE  SUBNET and SYSTEM_DEFAULT: multicast; LOCALHOST: this machine and static peers;
///                                  OFF: an error, as Jostle is several processes
///   ROS_STATIC_PEERS               hosts with semicolons between, beside what the range says; not for SYSTEM_DEFAULT
///
/// and else it is multicast. Of two ROS variables the same one wins as in ROS 2.
/// Errors   kInvalidArgument  a variable that is in force is malformed; says which, got, wanted
Result<NetworkChoice> choose_network();

/// Says in a line each what a user may not expect: a variable of ROS 2 that decides, and those that are overruled.
std::vector<std::string> network_news(const NetworkChoice& choice);

}  // namespace jostle::common
