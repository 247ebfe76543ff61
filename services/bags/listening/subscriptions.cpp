#include "services/bags/listening/subscriptions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "services/bags/listening/sequence_set.hpp"
#include "services/wire/dds/endpoint_watch.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/raw.hpp"
#include "services/wire/dds/system_topics.hpp"

namespace jostle::bags {
namespace {

using wire::Endpoint;

// What a writer can offer, least first. A reader of a grade hears writers of that and of
// higher ones, and of the latter less than they offer.
enum Grade : std::size_t { kBestEffort, kReliable, kLatched, kGrades };

Grade grade_of(bool reliable, bool latched) {
  if (!reliable) return kBestEffort;
  return latched ? kLatched : kReliable;
}

constexpr std::size_t kShown = 20;  // topics that are not selected

struct TopicState {
  int index = 0;
  std::string wire_name, wire_type;
  Topic topic;
  bool system = false;
  std::array<std::unique_ptr<wire::RawReader>, kGrades> readers;  // made and destroyed by one thread at a time

  mutable std::mutex mutex;  // guards seen
  std::map<wire::Guid, SequenceSet> seen;

  bool has_reader() const {
    for (const auto& reader : readers) {
      if (reader) return true;
    }
    return false;
  }
};

}  // namespace

struct Subscriptions::Impl {
  explicit Impl(Options given) : options(std::move(given)) {}

  ~Impl() {
    close();
    participant.reset();  // its threads call note()
  }

  void stop_following() {
    closing.request_stop();
    if (worker.joinable()) worker.join();
  }

  void close() {
    stop_following();
    for (const auto& state : states) {
      for (auto& reader : state->readers) reader.reset();
    }
  }

  void start() {
    for (const wire::SystemTopic& topic : wire::system_topics()) {
      const std::string wire_name = participant->wire_name(topic.name, topic.scope);
      if (!options.selection.wants(wire::ros_topic(wire_name).value_or(""))) continue;
      TopicState* state = add(wire_name, topic.type, topic.keyed);
      if (!state) continue;
      state->system = true;
      state->topic.qos = topic.qos;
      read(*state, grade_of(topic.qos.reliable, topic.qos.latched || topic.qos.retained));
    }
    worker = std::jthread([this] { follow(closing.get_token()); });
  }

  // On the middleware's threads.
  void note(const wire::Endpoint& endpoint) {
    const std::lock_guard lock(mutex);
    if (endpoint.kind == wire::Endpoint::Kind::kWriter) {
      offers.try_emplace(endpoint.topic, Qos{.reliable = endpoint.reliable, .latched = endpoint.latched});
      writers.emplace(endpoint.guid, endpoint.topic);
    }
    found.push_back(endpoint);
    news.notify_one();
  }

  // Likewise.
  void forget(const wire::Endpoint& endpoint) {
    const std::lock_guard lock(mutex);
    writers.erase(endpoint.guid);
  }

  void follow(std::stop_token stop) {
    std::unique_lock lock(mutex);
    while (news.wait(lock, stop, [&] { return !found.empty(); })) {
      const wire::Endpoint endpoint = std::move(found.front());
      found.pop_front();
      lock.unlock();
      try {
        consider(endpoint);
      } catch (const wire::SetupError& error) {
        warn(endpoint.topic, error.what());
      }
      lock.lock();
      if (stop.stop_requested()) return;
    }
  }

  void consider(const wire::Endpoint& endpoint) {
    const auto name = wire::ros_topic(endpoint.topic);
    if (!name || !wire::ros_type(endpoint.type)) return;
    // Hidden topics are for who names them, as with ROS 2's tools.
    if (options.selection.topics.empty() && name->find("/_") != std::string::npos) return;
    if (!options.selection.wants(*name)) {
      const std::lock_guard lock(mutex);
      if (passed_over.size() < kShown) passed_over.insert(*name);
      return;
    }
    TopicState* state = find(endpoint.topic);
    if (!state) state = add(endpoint.topic, endpoint.type, endpoint.keyed);
    if (!state) return;
    if (state->wire_type != endpoint.type) {
      return warn(endpoint.topic + endpoint.type, fmt::format("{}: got a second type {}, recorded is {}", *name,
                                                              *wire::ros_type(endpoint.type), state->topic.type));
    }
    const Grade grade = grade_of(endpoint.reliable, endpoint.latched);
    // What a reader asks for is what its writers will offer at least; better than nothing.
    if (endpoint.kind == wire::Endpoint::Kind::kReader && state->has_reader()) return;
    if (!state->readers[grade]) read(*state, grade);
  }

  TopicState* find(const std::string& wire_name) const {
    const std::lock_guard lock(mutex);
    for (const auto& state : states) {
      if (state->wire_name == wire_name) return state.get();
    }
    return nullptr;
  }

  // Nothing, and a warning, if it cannot be recorded.
  TopicState* add(const std::string& wire_name, const std::string& wire_type, bool keyed) {
    auto state = std::make_unique<TopicState>();
    state->wire_name = wire_name;
    state->wire_type = wire_type;
    state->topic = {
        .name = *wire::ros_topic(wire_name), .type = *wire::ros_type(wire_type), .qos = {}, .definition = {}};
    if (!wire::can_be_raw(wire_type, keyed)) {
      warn(wire_name + wire_type,
           fmt::format("{}: type {} {}, and only types of this system can be recorded so; left out", state->topic.name,
                       state->topic.type, keyed ? "has a key" : "should have a key"));
      return nullptr;
    }
    auto definition_result = options.definition(state->topic.type);
    if (!definition_result) {
      warn(wire_name + wire_type, fmt::format("{}: the definition of type {} is unknown; left out: {}",
                                              state->topic.name, state->topic.type, definition_result.error().message));
      return nullptr;
    }
    state->topic.definition = std::move(definition_result).value();
    const std::lock_guard lock(mutex);
    state->index = static_cast<int>(states.size());
    states.push_back(std::move(state));
    return states.back().get();
  }

  void read(TopicState& state, Grade grade) {
    const Qos qos{.reliable = grade != kBestEffort,
                  .latched = grade == kLatched,
                  .depth = kKeepAll,
                  .instances = state.system ? state.topic.qos.instances : 1};
    state.readers[grade] =
        std::make_unique<wire::RawReader>(*participant, wire::RawTopic{state.wire_name, state.wire_type, qos},
                                          [this, &state](std::span<const std::byte> bytes, const wire::Origin& origin) {
                                            {
                                              const std::lock_guard lock(state.mutex);
                                              if (!state.seen[origin.writer].insert(origin.sequence)) return;
                                            }
                                            options.on_sample(state.index, bytes, origin);
                                          });
  }

  // While nobody makes readers.
  std::vector<std::pair<std::string, std::uint64_t>> unmatched() {
    stop_following();
    const std::lock_guard lock(mutex);
    std::vector<std::pair<std::string, std::uint64_t>> found_ones;
    for (const auto& state : states) {
      const bool written =
          std::ranges::any_of(writers, [&](const auto& writer) { return writer.second == state->wire_name; });
      int matched = 0;
      std::uint64_t refusals = 0;
      for (const auto& reader : state->readers) {
        if (reader) matched += reader->matched(), refusals += reader->troubles().incompatible;
      }
      if (written && matched == 0 && refusals > 0) found_ones.emplace_back(state->topic.name, refusals);
    }
    return found_ones;
  }

  void warn(const std::string& about, const std::string& text) {
    if (warned.insert(about).second && options.on_warning) options.on_warning(text);
  }

  const Options options;
  std::optional<wire::Participant> participant;
  std::set<std::string> warned;

  mutable std::mutex mutex;  // guards all below but the readers
  std::condition_variable_any news;
  std::deque<wire::Endpoint> found;
  std::set<std::string> passed_over;
  std::map<std::string, Qos> offers;          // of the first writer, by the topic's name on the wire
  std::map<wire::Guid, std::string> writers;  // there now; their topics, likewise
  std::deque<std::unique_ptr<TopicState>> states;

  std::stop_source closing;
  std::jthread worker;  // makes readers
};

Result<std::unique_ptr<Subscriptions>> Subscriptions::open(Options options) {
  auto impl = std::make_unique<Impl>(std::move(options));
  const auto watch = std::make_shared<wire::EndpointWatch>(
      [impl = impl.get()](const wire::Endpoint& endpoint) { impl->note(endpoint); },
      [impl = impl.get()](const wire::Endpoint& endpoint) { impl->forget(endpoint); });
  auto participant_result = wire::Participant::open(
      {.name = impl->options.name, .domain = impl->options.domain, .watch = watch, .role = impl->options.role});
  if (!participant_result) return participant_result.error();
  impl->participant = *participant_result;
  try {
    impl->start();
  } catch (const wire::SetupError& error) {
    return Error{Code::kUnavailable, error.what()};
  }
  return std::unique_ptr<Subscriptions>(new Subscriptions(std::move(impl)));
}

Subscriptions::Subscriptions(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Subscriptions::~Subscriptions() = default;

const wire::Participant& Subscriptions::participant() const { return *impl_->participant; }

int Subscriptions::topics() const {
  const std::lock_guard lock(impl_->mutex);
  return static_cast<int>(impl_->states.size());
}

Topic Subscriptions::topic(int index) const {
  const std::lock_guard lock(impl_->mutex);
  const TopicState& state = *impl_->states[static_cast<std::size_t>(index)];
  Topic topic = state.topic;
  if (state.system) return topic;
  const auto offer = impl_->offers.find(state.wire_name);
  if (offer != impl_->offers.end()) topic.qos = offer->second;
  return topic;
}

std::uint64_t Subscriptions::missing(int index) const {
  const TopicState* state = nullptr;
  {
    const std::lock_guard lock(impl_->mutex);
    state = impl_->states[static_cast<std::size_t>(index)].get();
  }
  const std::lock_guard lock(state->mutex);
  std::uint64_t sum = 0;
  for (const auto& [writer, seen] : state->seen) sum += seen.missing();
  return sum;
}

std::vector<std::pair<std::string, std::uint64_t>> Subscriptions::unmatched() { return impl_->unmatched(); }

std::vector<std::string> Subscriptions::passed_over() const {
  const std::lock_guard lock(impl_->mutex);
  return {impl_->passed_over.begin(), impl_->passed_over.end()};
}

void Subscriptions::close() { impl_->close(); }

}  // namespace jostle::bags
