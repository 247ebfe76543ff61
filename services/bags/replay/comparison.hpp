#pragma once
/// \file
/// Two runs on the same observations, decision by decision.

#include <optional>
#include <string>
#include <vector>

#include "idl/msg/task.h"
#include "idl/types/state.hpp"
#include "services/bags/recorded/recorded_run.hpp"

namespace jostle::bags {

/// Where and how a decision parts from the recorded one.
struct Difference {
  std::string decision;            ///< "plan 3, after action 2", "action 4"
  std::string field;               ///< "controls, step 1, y"; "iterations allowed"
  std::string recorded, replayed;  ///< with units
  /// What went into it: whether start, candidate and options of this decision were equal.
  std::string given;
  /// How much it matters: how far the two predicted ends of the target lie apart.
  std::string effect;
};

/// The decisions of one replay. Numbers are equal if their bits are.
struct Decisions {
  std::vector<jostle_msgs::msg::Observation> observations;
  std::vector<jostle_msgs::msg::Plan> plans;
  bool asked_for_more = false;  ///< whether it acted once more after the last recorded observation
};

struct Comparison {
  std::size_t plans = 0, equal_plans = 0;  ///< recorded ones, and those that the replay made the same
  std::size_t actions = 0, equal_actions = 0;
  std::optional<Difference> first;  ///< nothing: bit-equal

  bool bit_equal() const { return !first; }
};

/// Finds the first difference of two plans for the same place in a run, if any.
std::optional<Difference> compare(const StateLayout& layout, const jostle_msgs::msg::Plan& recorded,
                                  const jostle_msgs::msg::Plan& replayed);

Comparison compare(const StateLayout& layout, const RecordedRun& recorded, const Decisions& replayed);

}  // namespace jostle::bags
