#include "services/tools/view/viewing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

namespace jostle::tools {
namespace {

constexpr std::size_t kMostWords = 16 << 20;      // bytes of text that wait for one viewer
constexpr std::size_t kMostSubscriptions = 4096;  // of one viewer

}  // namespace

void Viewing::begin(std::string server_info) {
  say(std::move(server_info));
  std::vector<bags::Topic> topics;
  for (const Exhibition::Channel& channel : shared_.channels) topics.push_back(channel.topic);
  say(advertise_text(0, topics));
  time_ = shared_.time;
}

Result<void> Viewing::perform(const ViewRequest& request) {
  return std::visit([this](const auto& one) { return perform(one); }, request);
}

Result<void> Viewing::perform(const Subscribe& request) {
  for (const auto& [id, channel] : request.subscriptions) {
    if (channel >= shared_.channels.size()) {
      return invalid("channelId", std::to_string(channel), fmt::format("one of {}", shared_.channels.size()));
    }
    if (subscriptions_.size() >= kMostSubscriptions) {
      return invalid("subscriptions", "one more", fmt::format("at most {}", kMostSubscriptions));
    }
    if (!subscriptions_.emplace(id, channel).second) {
      return invalid("id", fmt::format("{} again", id), "another number for every subscription");
    }
    subscribers_[channel].push_back(id);
    if (const SharedSample& last = shared_.channels[channel].last) put({id, last});
  }
  return {};
}

Result<void> Viewing::perform(const Unsubscribe& request) {
  for (const std::uint32_t id : request.subscriptions) {
    const auto found = subscriptions_.find(id);
    if (found == subscriptions_.end()) return invalid("subscriptionIds", std::to_string(id), "a subscription");
    std::erase(subscribers_[found->second], id);
    subscriptions_.erase(found);
  }
  return {};
}

Result<void> Viewing::perform(const GetParameters& request) {
  ViewParameters wanted;
  for (const auto& [name, value] : shared_.parameters) {
    if (request.names.empty() || std::ranges::count(request.names, name) > 0) wanted[name] = value;
  }
  say(parameters_text(wanted, request.id));
  return {};
}

Result<void> Viewing::perform(const SetParameters&) {
  return invalid("op", "setParameters", "none: there is nothing to set");
}

Result<void> Viewing::perform(const FollowParameters& request) {
  if (request.names.empty()) {
    follows_all_ = request.follow;
    if (!request.follow) followed_.clear();
  }
  for (const std::string& name : request.names) {
    if (!request.follow) followed_.erase(name);
    if (request.follow && shared_.parameters.contains(name)) followed_.insert(name);
  }
  if (request.follow) tell(shared_.parameters);
  return {};
}

void Viewing::say(SharedText text) {
  words_bytes_ += text->size();
  words_.push_back(std::move(text));
}

bool Viewing::send(std::size_t channel, const SharedSample& sample) {
  const auto found = subscribers_.find(channel);
  if (found == subscribers_.end()) return false;
  for (const std::uint32_t subscription : found->second) put({subscription, sample});
  return true;
}

void Viewing::forget() {
  parcels_.clear();
  parcels_bytes_ = 0;
}

void Viewing::tell(const ViewParameters& changed) {
  ViewParameters wanted;
  for (const auto& [name, value] : changed) {
    if (follows_all_ || followed_.contains(name)) wanted[name] = value;
  }
  if (!wanted.empty()) say(parameters_text(wanted, {}));
}

bool Viewing::is_overfull() const { return words_bytes_ > kMostWords; }

std::optional<ViewFrame> Viewing::next() {
  ViewFrame frame;
  if (!words_.empty()) {
    frame.text = std::move(words_.front());
    words_.pop_front();
    words_bytes_ -= frame.text->size();
  } else if (time_) {
    const auto bytes = time_frame(*std::exchange(time_, std::nullopt));
    std::ranges::copy(bytes, frame.head.begin());
    frame.head_size = bytes.size();
  } else if (!parcels_.empty()) {
    const Parcel parcel = std::move(parcels_.front());
    parcels_.pop_front();
    parcels_bytes_ -= parcel.sample->memory();
    frame.head = sample_header(parcel.subscription, parcel.sample->time);
    frame.head_size = frame.head.size();
    frame.sample = parcel.sample;
    ++shared_.count.samples_out;
  } else {
    return {};
  }
  shared_.count.bytes_out += frame.size();
  return frame;
}

void Viewing::put(Parcel parcel) {
  parcels_bytes_ += parcel.sample->memory();
  parcels_.push_back(std::move(parcel));
  while (parcels_bytes_ > most_waiting_ && parcels_.size() > 1) {
    parcels_bytes_ -= parcels_.front().sample->memory();
    parcels_.pop_front();
    ++shared_.count.dropped;
  }
}

}  // namespace jostle::tools
