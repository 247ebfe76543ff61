#include "services/tools/view/bag_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "idl/types/time.hpp"
#include "services/bags/format/definitions.hpp"
#include "services/bags/playback/playback.hpp"

namespace jostle::tools {
namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr std::chrono::milliseconds kTick{50};  // between two times that viewers are told

// What a viewer wants, checked.
struct Wishes {
  std::optional<double> time, rate;
  std::optional<bool> paused, loop;
};

Result<Wishes> parse_wishes(const ViewParameters& wanted) {
  Wishes wishes;
  for (const auto& [name, value] : wanted) {
    if (name == "playback.time" || name == "playback.rate") {
      if (!value.is_number()) return invalid(name, value.dump(), "a number");
      const auto number = value.get<double>();
      const bool is_rate = name == "playback.rate";
      if (is_rate && !(number >= bags::kSlowestRate && number <= bags::kFastestRate)) {
        return invalid(name, value.dump(), fmt::format("{:g} to {:g}", bags::kSlowestRate, bags::kFastestRate));
      }
      (is_rate ? wishes.rate : wishes.time) = number;
    } else if (name == "playback.paused" || name == "playback.loop") {
      if (!value.is_boolean()) return invalid(name, value.dump(), "true or false");
      (name == "playback.loop" ? wishes.loop : wishes.paused) = value.get<bool>();
    } else {
      return invalid("parameter", name, "playback.time, rate, paused or loop");
    }
  }
  return wishes;
}

// Without a definition no viewer can read a topic.
Result<bags::Topic> as_shown(bags::Topic topic, const bags::MessageFiles& messages) {
  if (topic.definition.empty() && !topic.has_no_fields) {
    auto definition_result = messages.definition(bags::ros_type_name(topic.type));
    if (!definition_result) return definition_result.error();
    topic.definition = std::move(definition_result).value();
    topic.schema = "ros2msg";
  }
  return topic;
}

}  // namespace

struct BagSource::Impl : bags::Playback::Sink {
  void on_message(const bags::Message& message, TimePoint) override {
    if (server) server->send(channels[static_cast<std::size_t>(message.topic)], message.log_time, message.data);
  }

  void on_moment(const std::vector<bags::Message>& state) override {
    if (!server) return;
    server->start_over();
    for (const bags::Message& message : state) on_message(message, {});
  }

  void wake() {
    const std::lock_guard lock(wake_mutex);
    news = true;
    woken.notify_one();
  }

  // With `mutex` held.
  ViewParameters values(TimePoint now) const {
    return {{"playback.time", seconds(playback->at(now))},
            {"playback.rate", playback->rate()},
            {"playback.paused", playback->paused() || playback->state() == bags::Playback::State::kEnded},
            {"playback.loop", playback->loops()},
            {"playback.length", seconds(playback->last())},
            {"playback.start", 1e-9 * static_cast<double>(info.start)}};
  }

  // With `mutex` held.
  void apply(const Wishes& wishes, TimePoint now) {
    using bags::Playback;
    if (wishes.rate) (void)playback->set_rate(*wishes.rate, now);  // its range was checked
    if (wishes.loop) playback->set_loop(*wishes.loop);
    const bool has_ended = playback->state() == Playback::State::kEnded;
    if (wishes.time) {
      problem = false;
      const double last = seconds(playback->last());
      playback->seek(std::chrono::nanoseconds(std::llround(1e9 * std::clamp(*wishes.time, 0.0, last))));
      // Whoever looks at a place after the end has been reached wants to look at it.
      if (has_ended && !wishes.paused) playback->pause(now);
    } else if (wishes.paused == false && has_ended) {
      playback->seek(playback->first());
    }
    if (wishes.paused == true) playback->pause(now);
    if (wishes.paused == false) playback->resume(now);
  }

  // With `mutex` held.
  void tell(TimePoint now) {
    const bags::Time time = playback->time(now);
    if (std::exchange(told, time) != time) server->set_time(time);
    server->set_parameters(values(now));
  }

  // Returns when it wants to be called again.
  TimePoint advance(TimePoint now) {
    const std::lock_guard lock(mutex);
    TimePoint next = TimePoint::max();
    if (!problem) {
      auto next_result = playback->advance(now);
      if (next_result) {
        next = *next_result;
      } else {
        problem = true;  // until somebody goes elsewhere
        playback->pause(now);
        if (options.on_warning) options.on_warning(next_result.error().message);
        server->tell(ViewStatus::kError, next_result.error().message);
      }
    }
    if (now - told_at >= kTick) {
      told_at = now;
      tell(now);
    }
    return std::min(next, told_at + kTick);
  }

  Options options;
  bags::BagInfo info;
  std::vector<std::optional<bags::Topic>> topics;  // as in the bag
  std::vector<int> channels;                       // of the server, likewise
  ViewServer* server = nullptr;                    // set before the first advance()

  std::mutex mutex;  // guards playback and what follows
  bool problem = false;
  bags::Time told = 0;
  TimePoint told_at{};

  std::mutex wake_mutex;  // guards news; taken by the reading thread, which holds locks of its own
  std::condition_variable_any woken;
  bool news = false;

  std::unique_ptr<bags::Playback> playback;  // last: its thread calls wake()
};

Result<std::unique_ptr<BagSource>> BagSource::open(Options options) {
  auto reader_result = bags::BagReader::open(options.bag);
  if (!reader_result) return reader_result.error();
  auto impl = std::make_unique<Impl>();
  impl->options = std::move(options);
  impl->info = (*reader_result)->info();
  bags::PlaybackOptions playback{.paused = impl->options.paused, .on_news = [impl = impl.get()] { impl->wake(); }};
  for (std::size_t i = 0; i < impl->info.topics.size(); ++i) {
    const bags::Topic& topic = impl->info.topics[i].topic;
    const bool is_wanted = impl->options.selection.wants(topic.name);
    impl->topics.emplace_back();
    if (!is_wanted) continue;
    auto shown_result = as_shown(topic, impl->options.messages);
    if (shown_result) {
      impl->topics.back() = std::move(shown_result).value();
      playback.topics.push_back(static_cast<int>(i));
    } else if (impl->options.on_warning) {
      impl->options.on_warning(fmt::format("{}: the definition of type {} is unknown; left out: {}", topic.name,
                                           topic.type, shown_result.error().message));
    }
  }
  if (playback.topics.empty()) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got no topic that can be shown, wanted one", impl->options.bag.string())};
  }
  playback.state_topics = playback.topics;
  auto playback_result = bags::Playback::create(std::move(*reader_result), std::move(playback), *impl);
  if (!playback_result) return playback_result.error();
  impl->playback = std::move(playback_result).value();
  return std::unique_ptr<BagSource>(new BagSource(std::move(impl)));
}

BagSource::BagSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BagSource::~BagSource() = default;

const bags::BagInfo& BagSource::info() const { return impl_->info; }

Result<ViewParameters> BagSource::set(const ViewParameters& wanted) {
  const auto wishes_result = parse_wishes(wanted);
  if (!wishes_result) return wishes_result.error();
  ViewParameters values;
  {
    const auto now = Clock::now();
    const std::lock_guard lock(impl_->mutex);
    impl_->apply(*wishes_result, now);
    impl_->told_at = {};  // whoever follows is told at once
    values = impl_->values(now);
  }
  impl_->wake();
  return values;
}

void BagSource::run(ViewServer& server, std::stop_token stop) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->server = &server;
    for (const auto& topic : impl_->topics) impl_->channels.push_back(topic ? server.add_channel(*topic, true) : -1);
  }
  while (!stop.stop_requested()) {
    const TimePoint next = impl_->advance(Clock::now());
    std::unique_lock lock(impl_->wake_mutex);
    impl_->woken.wait_until(lock, stop, next, [&] { return impl_->news; });
    impl_->news = false;
  }
  const std::lock_guard lock(impl_->mutex);
  impl_->server = nullptr;
}

}  // namespace jostle::tools
