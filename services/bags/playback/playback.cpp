#include "services/bags/playback/playback.hpp"

#include "idl/types/time.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace jostle::bags {
namespace {

// A bag of a single message, looped, is not to be sent as fast as the processor can.
constexpr std::chrono::milliseconds kShortestPass{100};

constexpr TimePoint kNever = TimePoint::max();

Time last_of(const BagInfo& info, const PlaybackOptions& options) {
  if (!options.duration) return info.end;
  const Time first = info.start + options.start.count();
  return options.duration->count() < info.end - first ? first + options.duration->count() : info.end;
}

}  // namespace

Result<std::unique_ptr<Playback>> Playback::create(std::unique_ptr<BagReader> reader, PlaybackOptions options,
                                                   Sink& sink) {
  const BagInfo& info = reader->info();
  if (info.messages == 0) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got no messages, wanted at least one", info.path.string())};
  }
  const std::chrono::nanoseconds length(info.end - info.start);
  if (options.start > length) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got a start at {:g} s, wanted at most {:g} s, where its last message is",
                             info.path.string(), seconds(options.start), seconds(length))};
  }
  return std::unique_ptr<Playback>(new Playback(std::move(reader), std::move(options), sink));
}

Playback::Playback(std::unique_ptr<BagReader> reader, PlaybackOptions options, Sink& sink)
    : options_(std::move(options)),
      sink_(sink),
      zero_(reader->info().start),
      first_(zero_ + options_.start.count()),
      last_(last_of(reader->info(), options_)),
      ahead_(std::move(reader), {.topics = options_.topics,
                                 .state_topics = options_.state_topics,
                                 .memory = options_.memory,
                                 .on_news = options_.on_news}),
      timeline_(first_, options_.rate),
      target_(first_),
      paused_(options_.paused) {
  go_to(first_);
}

Result<TimePoint> Playback::advance(TimePoint now) {
  if (ended_) return kNever;
  if (seeking_ == Seeking::kReads) {
    auto settled_result = settle();
    if (!settled_result) return settled_result.error();
    return *settled_result ? now : kNever;
  }
  if (seeking_ == Seeking::kTold) {
    seeking_ = Seeking::kNo;
    timeline_.set(target_, now);
    pass_began_ = now;
    if (!paused_) timeline_.run(now);
  }
  if (steps_ > 0) return step_on(now);
  return paused_ ? Result<TimePoint>(kNever) : play_on(now);
}

// Telling the sink may take its time: the clock is set when advance() is called again.
Result<bool> Playback::settle() {
  const auto moment = ahead_.take_moment();
  if (!moment) return false;
  sink_.on_moment(*moment);
  seeking_ = Seeking::kTold;
  return true;
}

Result<TimePoint> Playback::step_on(TimePoint now) {
  while (steps_ > 0) {
    const Message* message = ahead_.peek();
    if (message == nullptr) {
      if (auto problem = ahead_.problem()) return *std::move(problem);
      if (ahead_.at_end()) steps_ = 0;
      return kNever;
    }
    timeline_.set(message->log_time, now);
    send(now);
    --steps_;
  }
  return kNever;
}

Result<TimePoint> Playback::play_on(TimePoint now) {
  while (const Message* message = ahead_.peek()) {
    const TimePoint due = timeline_.when(message->log_time);
    if (due > now) return due;
    send(due);
  }
  if (auto problem = ahead_.problem()) return *std::move(problem);
  return ahead_.at_end() ? finish_pass(now) : kNever;
}

Result<TimePoint> Playback::finish_pass(TimePoint now) {
  TimePoint end = timeline_.when(last_);
  if (options_.loop) end = std::max(end, pass_began_ + kShortestPass);
  if (end > now) return end;
  ++passes_;
  if (options_.loop) {
    go_to(first_);
  } else {
    timeline_.stand(now);
    ended_ = true;
  }
  return kNever;
}

void Playback::send(TimePoint due) {
  sink_.on_message(*ahead_.peek(), due);
  ahead_.pop();
}

void Playback::go_to(Time moment) {
  target_ = std::clamp(moment, first_, last_);
  seeking_ = Seeking::kReads;
  steps_ = 0;
  ahead_.seek(target_, last_);
}

void Playback::pause(TimePoint now) {
  paused_ = true;
  timeline_.stand(now);
}

void Playback::resume(TimePoint now) {
  paused_ = false;
  steps_ = 0;
  if (seeking_ == Seeking::kNo && !ended_) timeline_.run(now);
}

void Playback::step(TimePoint now) {
  if (!paused_) pause(now);
  ++steps_;
}

void Playback::seek(std::chrono::nanoseconds offset) {
  ended_ = false;
  // Compared as offsets: their sum with a time may be too large for one.
  go_to(zero_ + std::clamp(offset, first(), last()).count());
}

Result<void> Playback::set_rate(double rate, TimePoint now) {
  if (!(rate >= kSlowestRate && rate <= kFastestRate)) {
    return Error{Code::kInvalidArgument,
                 fmt::format("rate: got {:g}, wanted {:g} to {:g}", rate, kSlowestRate, kFastestRate)};
  }
  timeline_.set_rate(rate, now);
  return {};
}

Playback::State Playback::state() const {
  if (ended_) return State::kEnded;
  if (seeking_ != Seeking::kNo || steps_ > 0) return State::kSeeking;
  return paused_ ? State::kPaused : State::kPlaying;
}

std::optional<std::chrono::nanoseconds> Playback::next() {
  const Message* message = ended_ ? nullptr : ahead_.peek();
  if (message == nullptr) return {};
  return std::chrono::nanoseconds(message->log_time - zero_);
}

std::chrono::nanoseconds Playback::at(TimePoint now) const {
  const Time moment = seeking_ == Seeking::kNo ? timeline_.at(now) : target_;
  return std::chrono::nanoseconds(std::clamp(moment, first_, last_) - zero_);
}

}  // namespace jostle::bags
