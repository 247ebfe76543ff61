#pragma once
/// \file
/// Playback: the messages of a bag, each at its time.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/bag_reader.hpp"
#include "services/bags/playback/read_ahead.hpp"
#include "services/bags/playback/timeline.hpp"

namespace jostle::bags {

inline constexpr double kSlowestRate = 0.01, kFastestRate = 100.0;

struct PlaybackOptions {
  double rate = 1.0;                                 ///< seconds of the bag per second, kSlowestRate to kFastestRate
  std::chrono::nanoseconds start{0};                 ///< where it begins, after the bag's first message; >= 0
  std::optional<std::chrono::nanoseconds> duration;  ///< how long it plays, bag time, > 0; empty: to the last message
  bool loop = false;
  bool paused = false;
  std::vector<int> topics;          ///< indices of BagInfo::topics, at least one
  std::vector<int> state_topics;    ///< those among them whose last message belongs to a moment
  std::uint64_t memory = 64 << 20;  ///< bytes of messages read ahead
  std::function<void()> on_news;    ///< called from another thread: advance() has something to do before its time
};

/// Decides what goes out when; who sends it, and which clock runs, is its caller's business:
///
///   while (auto next = *playback.advance(now); next …) wait until `next`, or for on_news or a command
///
/// Moments   offsets count from the bag's first message. At an offset everything before it is
///           past, and what was recorded exactly then comes next. Whenever playback is put somewhere
///           (by seek(), at a start offset, at the next pass of a loop) the sink is told the moment
///           there: the last message of every state topic before it.
/// Spacing   every message is due at its log time on one Timeline, so that delays do not add up.
///           The time it takes to find a place in the bag is not part of it.
/// Threads   one; reading has its own.
class Playback {
 public:
  class Sink {
   public:
    virtual ~Sink() = default;
    /// Takes messages in the order of their times; equal times in the order of the bag. `due`: when it was to go out.
    virtual void on_message(const Message& message, TimePoint due) = 0;
    /// Takes the moment from which playback goes on; empty where nothing was before it.
    virtual void on_moment(const std::vector<Message>& state) = 0;
  };

  enum class State {
    kSeeking,  ///< finds a place, or reads the message of a step
    kPlaying,
    kPaused,
    kEnded
  };

  /// `sink` outlives it.
  /// Error kInvalidArgument: an empty bag, a start behind its end.
  static Result<std::unique_ptr<Playback>> create(std::unique_ptr<BagReader> reader, PlaybackOptions options,
                                                  Sink& sink);

  /// Sends what is due. Returns when the next message is; TimePoint::max() if only on_news or a
  /// command makes a difference.
  /// Errors   kInvalidArgument, kIo: the bag is damaged here; all before it has been sent
  Result<TimePoint> advance(TimePoint now);

  void pause(TimePoint now);
  void resume(TimePoint now);
  /// Sends one message more, then stands still.
  void step(TimePoint now);
  /// Goes to an offset, or as close as start and duration allow.
  void seek(std::chrono::nanoseconds offset);
  /// Error kInvalidArgument: outside of kSlowestRate to kFastestRate.
  Result<void> set_rate(double rate, TimePoint now);
  void set_loop(bool loop) { options_.loop = loop; }

  State state() const;
  std::chrono::nanoseconds at(TimePoint now) const;  ///< offset
  std::chrono::nanoseconds first() const { return std::chrono::nanoseconds(first_ - zero_); }
  std::chrono::nanoseconds last() const { return std::chrono::nanoseconds(last_ - zero_); }
  /// Returns the offset of the message that comes next; nothing while it is not read, and at the end.
  std::optional<std::chrono::nanoseconds> next();
  Time time(TimePoint now) const { return zero_ + at(now).count(); }
  double rate() const { return timeline_.rate(); }
  bool loops() const { return options_.loop; }
  bool paused() const { return paused_; }
  int passes() const { return passes_; }  ///< completed

  /// Whether on_news was due by the deadline; for callers without a loop of events.
  bool wait(TimePoint deadline) { return ahead_.wait(deadline); }

 private:
  Playback(std::unique_ptr<BagReader> reader, PlaybackOptions options, Sink& sink);

  void go_to(Time moment);
  Result<bool> settle();
  Result<TimePoint> step_on(TimePoint now);
  Result<TimePoint> play_on(TimePoint now);
  Result<TimePoint> finish_pass(TimePoint now);
  void send(TimePoint due);

  PlaybackOptions options_;
  Sink& sink_;
  const Time zero_, first_, last_;  // the bag's first message; begin and end of what is played
  ReadAhead ahead_;
  Timeline timeline_;
  // How far a seek is: the reader still looks for the place, or the sink was told and the clock must
  // be set, or there is none.
  enum class Seeking { kReads, kTold, kNo } seeking_ = Seeking::kReads;
  Time target_;
  bool paused_;
  int steps_ = 0;  // to take while paused
  TimePoint pass_began_{};
  int passes_ = 0;
  bool ended_ = false;
};

}  // namespace jostle::bags
