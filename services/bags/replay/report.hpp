#pragma once
/// \file
/// What a replay found, for people and for scripts.

#include <nlohmann/json.hpp>
#include <string>

#include "services/bags/replay/replay.hpp"

namespace jostle::bags {

/// Writes one line about the recorded run.
std::string headline(const RecordedRun& recorded);

/// Writes one line about a plan; `recorded` may be null.
std::string plan_line(const jostle_msgs::msg::Plan& replayed, const jostle_msgs::msg::Plan* recorded,
                      const StateLayout& layout);

/// The verdict on a run that has no plan.
inline constexpr const char* kNothingToCompare = "NOTHING TO COMPARE: the recorded run ended before its first plan\n";

/// Writes the verdict: where the runs part, what differs there, why, and how much they agree.
std::string verdict(const RecordedRun& recorded, const ReplayReport& report);

nlohmann::json to_json(const RecordedRun& recorded, const ReplayReport& report);

}  // namespace jostle::bags
