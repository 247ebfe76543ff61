#pragma once
/// \file
/// TopicPlan: which topics of a bag are played, as what.

#include <string>
#include <utility>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/bag_reader.hpp"
#include "services/bags/selection.hpp"
#include "services/wire/dds/raw.hpp"

namespace jostle::bags {

struct TopicChoice {
  Selection selection;                                      ///< by the names in the bag
  std::vector<std::pair<std::string, std::string>> remaps;  ///< name in the bag, name when played
  bool with_clock = false;                                  ///< /clock shows the bag's time: a recorded one is left out
};

/// Reads "/from:=/to". Error kInvalidArgument.
Result<std::pair<std::string, std::string>> parse_remap(const std::string& text);

struct PlayedTopic {
  int topic = 0;        ///< index of BagInfo::topics
  std::string name;     ///< as ROS 2 shows it when played
  wire::RawTopic wire;  ///< with what its writer offered
  /// Whether its last message belongs to a moment: it does for latched topics and for states. States are
  /// the system's own topics of kind kState (topics.hpp): /joint_states, /tf, /robot/status and
  /// so on, in a namespace or not.
  bool is_state = false;
};

struct TopicPlan {
  std::vector<PlayedTopic> played;      ///< in the order of the bag
  std::vector<std::string> commands;    ///< left out, see plan_topics
  std::vector<std::string> impossible;  ///< left out: name and reason
};

/// Whether somebody who hears a topic acts: moves a robot, takes up a goal, works for a pool.
/// Known by topic (the system's own; last words such as `cmd_vel`, `command`, `goal`) and by type
/// (velocities, trajectories, goals).
bool commands_somebody(const Topic& topic);

/// Plans to play all topics that the choice selects, but for those that command somebody: they are played only if
/// a glob without wildcards or a remap names them.
/// Errors   kInvalidArgument  nothing is left, a remap of a topic that is not there, or onto one of
///                            another type; a second type that the bag has on a topic is left out
Result<TopicPlan> plan_topics(const BagInfo& bag, const TopicChoice& choice);

}  // namespace jostle::bags
