#pragma once
/// \file
/// `jostle play --control`: another playback, told what to do.

#include <chrono>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "services/bags/playback/control.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::bags {

struct RemoteOptions {
  std::optional<int> domain;
  std::chrono::nanoseconds timeout{0};  ///< for each control to be done
};

/// Tells the playback of the domain one control after the other; each is done when the next one
/// is told: a seek has found its place, a step has sent its message. Returns the status after the
/// last control; without controls the present one.
/// Errors   kUnavailable      no playback there, or no answer in time
///          kInvalidArgument  what the playback refused
///          kCancelled, those of Participant::open
Result<jostle_msgs::msg::PlayStatus> control_remotely(const std::vector<Control>& controls,
                                                      const RemoteOptions& options, std::stop_token stop);

}  // namespace jostle::bags
