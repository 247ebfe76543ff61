#include "services/bags/play/player.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <mutex>
#include <set>

#include "idl/types/time.hpp"
#include "services/bags/play/publisher.hpp"
#include "services/bags/playback/control.hpp"
#include "services/bags/playback/progress.hpp"
#include "services/wire/dds/cdr.hpp"
#include "services/wire/dds/endpoint_watch.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::bags {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using jostle_msgs::msg::PlayControl;
using jostle_msgs::msg::PlayStatus;

constexpr auto kTick = 100ms;      // status, the line, a look at who is there
constexpr auto kRateWindow = 1s;   // over which rates of topics are counted
constexpr auto kLastSamples = 2s;  // for readers to receive them before writers go
constexpr auto kLongGap = 60s;     // without a message, after which somebody wonders
constexpr std::size_t kRememberedControls = 64;
constexpr std::size_t kWaitingControls = 256;

// "90 s", "3.0 hours", "12 days", "53.9 years"
std::string long_time_text(double seconds) {
  constexpr double kHour = 3600, kDay = 24 * kHour, kYear = 365.25 * kDay;
  if (seconds < kHour) return fmt::format("{:.0f} s", seconds);
  if (seconds < 2 * kDay) return fmt::format("{:.1f} hours", seconds / kHour);
  return seconds < kYear ? fmt::format("{:.0f} days", seconds / kDay) : fmt::format("{:.1f} years", seconds / kYear);
}

/// Ends a wait of poll(2) from any thread.
class WakeUp {
 public:
  WakeUp() : descriptor_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~WakeUp() { close(descriptor_); }
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  int descriptor() const { return descriptor_; }
  void set() const { eventfd_write(descriptor_, 1); }
  void clear() const {
    eventfd_t count = 0;
    eventfd_read(descriptor_, &count);
  }

 private:
  int descriptor_;
};

/// Handed from the middleware's threads to the player's.
template <class T>
class Handover {
 public:
  void put(T value) {
    const std::lock_guard lock(mutex_);
    if (values_.size() < kWaitingControls) values_.push_back(std::move(value));
  }
  std::deque<T> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(values_, {});
  }

 private:
  std::mutex mutex_;  // guards values_
  std::deque<T> values_;
};

// Who else publishes what is about to be played. Outlives the participant, as it is shared.
struct Others {
  std::set<std::string> topics;  // as on the wire; never changed once the participant is there
  Handover<std::string> found;
};

std::shared_ptr<wire::EndpointWatch> watch_for(const std::shared_ptr<Others>& others) {
  return std::make_shared<wire::EndpointWatch>([others](const wire::Endpoint& endpoint) {
    if (endpoint.kind == wire::Endpoint::Kind::kWriter && others->topics.contains(endpoint.topic))
      others->found.put(endpoint.topic);
  });
}

const char* name_of(Playback::State state) {
  switch (state) {
    case Playback::State::kSeeking:
      return "seeking";
    case Playback::State::kPlaying:
      return "playing";
    case Playback::State::kPaused:
      return "paused";
    case Playback::State::kEnded:
      break;
  }
  return "ended";
}

/// Messages per second of each topic, over the last window.
class Rates {
 public:
  void measure(const std::map<std::string, std::uint64_t>& counts, TimePoint now) {
    if (now - since_ < kRateWindow) return;
    rates_.clear();
    for (const auto& [topic, count] : counts) {
      rates_.emplace_back(topic, static_cast<double>(count - counts_[topic]) / seconds(now - since_));
    }
    counts_ = counts;
    since_ = now;
  }
  const std::vector<std::pair<std::string, double>>& rates() const { return rates_; }

 private:
  TimePoint since_ = Clock::now();
  std::map<std::string, std::uint64_t> counts_;
  std::vector<std::pair<std::string, double>> rates_;
};

wire::RawTopic clock_topic() {
  return {wire::topics::kClock.name, wire::Serializer<rosgraph_msgs::msg::Clock>().getName(), wire::topics::kClock.qos};
}

}  // namespace

struct Player::Impl {
  Impl(PlayerOptions given, common::LiveLine& shown_on) : options(std::move(given)), line(shown_on) {}

  void take_controls(TimePoint now) {
    for (const PlayControl& control : controls.take()) {
      // Askers repeat themselves until they are answered.
      auto answer = std::ranges::find(answers, control.id(), &Answer::id);
      if (control.id() == 0 || answer == answers.end()) {
        const auto ok = perform({control.command(), control.value()}, now);
        answer = answers.insert(answers.end(), {control.id(), ok ? "" : ok.error().message});
      }
      status.control_id(answer->id);
      status.control_error(answer->error);
      changed = true;
      if (answers.size() > kRememberedControls) answers.pop_front();
    }
  }

  void take_keys(Keyboard& keyboard, TimePoint now) {
    for (const KeyPress& press : decoder.feed(keyboard.read())) {
      if (const auto control = control_of(press, *playback, now)) {
        if (auto ok = perform(*control, now); !ok) line.say("{}", ok.error().message);
      }
    }
  }

  Result<void> perform(const Control& control, TimePoint now) {
    changed = true;
    if (control.command != "quit") return apply(control, *playback, now);
    quit = true;
    return {};
  }

  void publish_status(const char* state, TimePoint now) {
    status.state(state);
    status.paused(playback->paused());
    status.loop(playback->loops());
    status.rate(playback->rate());
    status.time(seconds(playback->at(now)));
    status.bag_time(playback->time(now));
    status.passes(static_cast<std::uint32_t>(playback->passes()));
    status.messages(publisher->sent());
    (void)statuses->write(status);  // told again with the next change, and whoever controls us asks again
  }

  void publish_clock(TimePoint now) {
    const Time time = playback->time(now);
    rosgraph_msgs::msg::Clock message;
    message.clock().sec(static_cast<std::int32_t>(time / 1'000'000'000));
    message.clock().nanosec(static_cast<std::uint32_t>(time % 1'000'000'000));
    (void)clock->write(wire::to_cdr(message));  // the next one is due in a moment
  }

  void draw(const char* state, TimePoint now) {
    if (!line.live()) return;
    rates.measure(publisher->messages(), now);
    line.draw(progress_line({.state = state,
                             .time = seconds(playback->at(now)),
                             .start = seconds(playback->first()),
                             .end = seconds(playback->last()),
                             .rate = playback->rate(),
                             .loop = playback->loops(),
                             .topics = rates.rates()},
                            line.width()));
  }

  // Whatever is not a message. Returns when it wants to be called again.
  TimePoint attend(const char* state, TimePoint now) {
    if (state != last_state) changed = true;
    last_state = state;
    if (clock && (changed || now >= next_clock)) {
      publish_clock(now);
      next_clock = std::max(next_clock, now - kTick) + clock_period;
    }
    if (changed || now >= next_tick) {
      publish_status(state, now);
      draw(state, now);
      if (playback->state() == Playback::State::kPaused) publisher->tell_newcomers();
      warn_of_others();
      tell_of_gap(now);
      if (now >= next_tick) next_tick = now + kTick;
      changed = false;
    }
    return clock ? std::min(next_tick, next_clock) : next_tick;
  }

  // A message of time 0 before all others, or a clock that was set, and nothing comes for years.
  void tell_of_gap(TimePoint now) {
    if (playback->state() != Playback::State::kPlaying) return;
    const auto next = playback->next();
    if (!next || next == told_gap) return;
    const double wait = seconds(*next - playback->at(now)) / playback->rate();
    if (wait < seconds(kLongGap)) return;
    told_gap = next;
    line.say("a gap: the next message, of {:%F %T} UTC, comes in {}; remedy: --start {:.0f}, or --control seek:{:.0f}",
             fmt::gmtime(
                 static_cast<std::time_t>((playback->time(now) + (*next - playback->at(now)).count()) / 1'000'000'000)),
             long_time_text(wait), std::floor(seconds(*next)), std::floor(seconds(*next)));
  }

  void warn_of_others() {
    std::vector<std::string> names;
    for (const std::string& topic : others->found.take()) {
      const std::string name = wire::ros_topic(topic).value_or(topic);
      if (warned.insert(name).second) names.push_back(name);
    }
    if (names.empty()) return;
    line.say("domain {} has another publisher of {}: subscribers hear both; remedy: --domain, --remap or --exclude",
             participant->domain(), fmt::join(names, ", "));
  }

  // Until then, or until something happens. Keys that were pressed are taken.
  void wait(TimePoint until, Keyboard& keyboard) {
    const auto time = std::max(until - Clock::now(), Clock::duration::zero());
    const timespec timeout{.tv_sec = time / 1s, .tv_nsec = (time % std::chrono::nanoseconds(1s)).count()};
    pollfd descriptors[] = {{.fd = wake_up.descriptor(), .events = POLLIN, .revents = 0},
                            {.fd = keyboard.works() ? keyboard.descriptor() : -1, .events = POLLIN, .revents = 0}};
    if (ppoll(descriptors, 2, &timeout, nullptr) <= 0) return;
    if (descriptors[0].revents) wake_up.clear();
    if (descriptors[1].revents) take_keys(keyboard, Clock::now());
  }

  // False after a quit or a stop request.
  Result<bool> wait_for_subscribers(Keyboard& keyboard, const std::stop_token& stop) {
    if (options.subscribers == 0) return true;
    const TimePoint end = Clock::now() + options.timeout;
    bool said = false;
    while (true) {
      const TimePoint now = Clock::now();
      take_controls(now);
      if (stop.stop_requested() || quit) return false;
      const auto lacking = publisher->lacking(options.subscribers);
      if (lacking.empty()) return true;
      if (now >= end) {
        return Error{Code::kUnavailable, fmt::format("got fewer than {} subscribers of {} within {:g} s in domain {}; "
                                                     "remedy: --exclude, or a longer --timeout",
                                                     options.subscribers, fmt::join(lacking, ", "),
                                                     seconds(options.timeout), participant->domain())};
      }
      if (!std::exchange(said, true)) line.say("waits for subscribers of {}", fmt::join(lacking, ", "));
      attend("waiting", now);
      constexpr auto kLook = 10ms;  // at who is there
      wait(std::min(end, now + kLook), keyboard);
    }
  }

  void say_ready(const Keyboard& keyboard) {
    // Whoever started this program waits for the word "ready".
    line.say("ready: domain {}, {} topics, {:g} to {:g} s", participant->domain(), publisher->messages().size(),
             seconds(playback->first()), seconds(playback->last()));
    if (keyboard.works()) line.say("{}", kKeyHelp);
  }

  // Why it ended; an error if the bag is damaged.
  Result<std::string> play(Keyboard& keyboard, const std::stop_token& stop) {
    const auto begin_result = wait_for_subscribers(keyboard, stop);
    if (!begin_result) return begin_result.error();
    if (*begin_result) {
      say_ready(keyboard);
      began = Clock::now();
    }
    while (true) {
      take_controls(Clock::now());
      if (stop.stop_requested()) return std::string("interrupted");
      if (quit) return std::string("told to quit");
      const auto next_result = playback->advance(Clock::now());
      if (!next_result) return next_result.error();
      if (playback->state() == Playback::State::kEnded) return std::string("played to its end");
      // Messages first: the rest can wait for a gap between them, though not for ever.
      const TimePoint now = Clock::now();
      const bool hurry = *next_result <= now && now < next_tick + kTick;
      const TimePoint attended = hurry ? now : attend(name_of(playback->state()), now);
      wait(std::min(*next_result, attended), keyboard);
    }
  }

  PlayerOptions options;
  common::LiveLine& line;
  WakeUp wake_up;
  Handover<PlayControl> controls;
  std::shared_ptr<Others> others = std::make_shared<Others>();
  std::optional<wire::Participant> participant;
  std::optional<Publisher> publisher;
  std::unique_ptr<Playback> playback;  // its thread wakes up, and sends to the publisher
  std::optional<wire::RawWriter> clock;
  std::optional<wire::Writer<PlayStatus>> statuses;

  KeyDecoder decoder;
  struct Answer {
    std::uint64_t id = 0;
    std::string error;
  };
  std::deque<Answer> answers;  // to the newest controls
  PlayStatus status;
  std::string last_state;
  bool changed = true;
  bool quit = false;
  TimePoint next_tick{}, next_clock{};
  std::chrono::nanoseconds clock_period{};
  std::optional<TimePoint> began;
  Rates rates;
  std::set<std::string> warned;
  std::optional<std::chrono::nanoseconds> told_gap;  // where the last one ends

  std::optional<wire::Reader<PlayControl>> control_reader;  // last: fills what is above
};

Player::Player(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Player::~Player() = default;

Result<std::unique_ptr<Player>> Player::create(std::unique_ptr<BagReader> reader, const TopicPlan& plan,
                                               PlayerOptions options, common::LiveLine& line) {
  for (const PlayedTopic& topic : plan.played) {
    options.playback.topics.push_back(topic.topic);
    if (topic.is_state) options.playback.state_topics.push_back(topic.topic);
  }
  auto impl = std::make_unique<Impl>(std::move(options), line);
  Impl& self = *impl;
  self.options.playback.on_news = [&self] { self.wake_up.set(); };
  for (const PlayedTopic& topic : plan.played) self.others->topics.insert(topic.wire.name);
  if (self.options.clock > 0) self.others->topics.insert(wire::topics::kClock.name);
  self.status.bag(reader->info().path.string());

  auto participant_result = wire::Participant::open({.name = "jostle_play",
                                                     .domain = self.options.domain,
                                                     .watch = watch_for(self.others),
                                                     .role = wire::Role::kRobot});
  if (!participant_result) return participant_result.error();
  self.participant = *participant_result;
  self.publisher.emplace(*self.participant, plan.played);
  auto playback_result = Playback::create(std::move(reader), self.options.playback, *self.publisher);
  if (!playback_result) return playback_result.error();
  self.playback = std::move(*playback_result);
  self.status.start(seconds(self.playback->first()));
  self.status.end(seconds(self.playback->last()));
  if (self.options.clock > 0) {
    self.clock.emplace(*self.participant, clock_topic());
    self.clock_period = std::chrono::nanoseconds(std::llround(1e9 / self.options.clock));
  }
  self.statuses.emplace(*self.participant, wire::topics::kPlayStatus);
  self.control_reader.emplace(*self.participant, wire::topics::kPlayControl, [&self](const PlayControl& control) {
    self.controls.put(control);
    self.wake_up.set();
  });
  return std::unique_ptr<Player>(new Player(std::move(impl)));
}

int Player::domain() const { return impl_->participant->domain(); }

PlayReport Player::run(Keyboard& keyboard, std::stop_token stop) {
  Impl& self = *impl_;
  prctl(PR_SET_TIMERSLACK, 1);  // ns; the kernel's 50 us would be on every message
  const std::stop_callback wake(stop, [&self] { self.wake_up.set(); });
  auto reason_result = self.play(keyboard, stop);
  const TimePoint end = Clock::now();
  self.publish_status("ended", end);
  if (!stop.stop_requested()) {
    self.publisher->wait_until_received(end + kLastSamples);
    self.statuses->wait_until_received(end + kLastSamples);
  }
  PlayReport report{.messages = self.publisher->messages(),
                    .sent = self.publisher->sent(),
                    .refused = self.publisher->refused(),
                    .lateness = self.publisher->lateness(),
                    .seconds = self.began ? seconds(end - *self.began) : 0.0,
                    .passes = self.playback->passes()};
  if (reason_result) {
    report.reason = *reason_result;
  } else {
    report.problem = reason_result.error();
  }
  return report;
}

}  // namespace jostle::bags
