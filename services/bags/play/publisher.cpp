#include "services/bags/play/publisher.hpp"

#include <algorithm>

namespace jostle::bags {
namespace {

// For what is on its way before a moment replaces it. Time stands while a place is found, so
// nobody waits for this but the one who asked.
constexpr std::chrono::milliseconds kOnTheWay{50};

}  // namespace

Publisher::Publisher(const wire::Participant& participant, const std::vector<PlayedTopic>& topics) {
  for (const PlayedTopic& topic : topics) {
    const auto index = static_cast<std::size_t>(topic.topic);
    if (by_topic_.size() <= index) by_topic_.resize(index + 1);
    by_topic_[index] = outputs_.size();
    outputs_.push_back({.name = topic.name,
                        .writer = wire::RawWriter(participant, topic.wire),
                        .keeps = topic.wire.qos.latched || topic.wire.qos.retained,
                        .is_retold = topic.is_state && !topic.wire.qos.latched});
  }
}

void Publisher::on_message(const Message& message, TimePoint due) {
  Output& to = output(message.topic);
  lateness_.add(std::chrono::steady_clock::now() - due);
  write(to, message);
  ++to.sent;
}

void Publisher::on_moment(const std::vector<Message>& state) {
  if (!fresh_) {
    const TimePoint deadline = std::chrono::steady_clock::now() + kOnTheWay;
    for (const Output& to : outputs_) {
      if (to.keeps) to.writer.wait_until_received(deadline);
    }
    for (Output& to : outputs_) {
      if (to.keeps) to.writer.forget();
      to.newest.clear();
    }
  }
  for (const Message& message : state) write(output(message.topic), message);
  fresh_ = state.empty();
}

void Publisher::write(Output& to, const Message& message) {
  if (!to.writer.write(message.data)) ++refused_;
  if (to.is_retold) {
    to.newest = message.data;
    to.readers = to.writer.matched();
  }
  fresh_ = false;
}

void Publisher::tell_newcomers() {
  for (Output& to : outputs_) {
    if (to.newest.empty()) continue;
    const int readers = to.writer.matched();
    if (readers > to.readers && !to.writer.write(to.newest)) ++refused_;
    to.readers = readers;
  }
}

std::vector<std::string> Publisher::lacking(int readers) const {
  std::vector<std::string> names;
  for (const Output& to : outputs_) {
    if (to.writer.matched() < readers) names.push_back(to.name);
  }
  return names;
}

bool Publisher::wait_until_received(TimePoint deadline) const {
  return std::ranges::all_of(outputs_, [&](const Output& to) { return to.writer.wait_until_received(deadline); });
}

std::map<std::string, std::uint64_t> Publisher::messages() const {
  std::map<std::string, std::uint64_t> counts;
  for (const Output& to : outputs_) counts[to.name] += to.sent;
  return counts;
}

}  // namespace jostle::bags
