#pragma once
/// \file
/// Player: a bag played into a domain, steered over DDS and by keys.

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "services/bags/format/bag_reader.hpp"
#include "services/bags/play/terminal.hpp"
#include "services/bags/play/topic_plan.hpp"
#include "services/bags/playback/lateness.hpp"
#include "services/bags/playback/playback.hpp"
#include "services/common/terminal/live_line.hpp"

namespace jostle::bags {

struct PlayerOptions {
  PlaybackOptions playback;             ///< its topics and on_news are the player's to set
  double clock = 0.0;                   ///< how often /clock is published per second of the wall clock; 0: not at all
  int subscribers = 0;                  ///< begin once every topic has so many
  std::chrono::nanoseconds timeout{0};  ///< how long to wait for them
  std::optional<int> domain;
};

struct PlayReport {
  std::map<std::string, std::uint64_t> messages;  ///< sent, by topic as played; moments not counted
  std::uint64_t sent = 0, refused = 0;            ///< refused: by the middleware
  Lateness lateness;                              ///< when messages went out, against when they were due
  double seconds = 0.0;                           ///< since playback began
  int passes = 0;
  std::string reason;            ///< played to its end, told to quit, interrupted
  std::optional<Error> problem;  ///< why it ended before
};

/// A Player does everything of a playback that speaks to others. It publishes its status ten times a second,
/// and after every change.
///
/// Threads  run() on one; the middleware's hand over what they hear.
class Player {
 public:
  /// `line` outlives it. Throws SetupError.
  /// Errors   those of Participant::open and Playback::create
  static Result<std::unique_ptr<Player>> create(std::unique_ptr<BagReader> reader, const TopicPlan& plan,
                                                PlayerOptions options, common::LiveLine& line);
  ~Player();

  int domain() const;

  /// Plays until the end, a quit or a stop request. May be called once.
  PlayReport run(Keyboard& keyboard, std::stop_token stop);

 private:
  struct Impl;
  explicit Player(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::bags
