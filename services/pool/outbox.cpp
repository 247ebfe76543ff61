#include "services/pool/outbox.hpp"

#include <algorithm>
#include <utility>

namespace jostle::pool {

namespace msg = jostle_msgs::msg;

namespace {

// About what a result takes on the wire.
std::size_t bytes_of(const msg::AssignmentResult& result) {
  constexpr std::size_t kNumbers = 150;  // of fixed size
  return kNumbers + 8 * (result.trajectory().size() + result.step_costs().size()) + result.facts().size() +
         result.reason().size() + result.error().size();
}

}  // namespace

bool Outbox::put(std::uint64_t client, msg::AssignmentResult result, Left left, std::chrono::nanoseconds gather,
                 TimePoint now) {
  const std::optional<TimePoint> before = this->due();
  Box& box = boxes_[client];
  box.bytes += bytes_of(result);
  const bool is_first = box.results.empty();
  box.results.push_back(std::move(result));
  const std::chrono::nanoseconds pause =
      left == Left::kWaiting ? gather : std::min<std::chrono::nanoseconds>(kBurst, gather);
  const TimePoint due = left == Left::kNothing || box.bytes >= kLong ? now : std::max(now, box.last_sent + pause);
  box.due = is_first ? due : std::min(box.due, due);
  return !before || box.due < *before;
}

std::vector<Outbox::Group> Outbox::take(TimePoint now) {
  std::vector<Group> groups;
  for (auto& [client, box] : boxes_) {
    if (box.results.empty() || box.due > now) continue;
    groups.push_back({.client = client, .results = std::exchange(box.results, {})});
    box.bytes = 0;
    box.last_sent = now;
  }
  return groups;
}

std::optional<TimePoint> Outbox::due() const {
  std::optional<TimePoint> first;
  for (const auto& [client, box] : boxes_) {
    if (!box.results.empty() && (!first || box.due < *first)) first = box.due;
  }
  return first;
}

std::size_t Outbox::held(std::uint64_t client) const {
  const auto found = boxes_.find(client);
  return found == boxes_.end() ? 0 : found->second.results.size();
}

}  // namespace jostle::pool
