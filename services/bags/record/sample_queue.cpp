#include "services/bags/record/sample_queue.hpp"

#include <algorithm>
#include <utility>

namespace jostle::bags {
namespace {

// Bytes that are worth waking the writer for before its time. Less often is cheaper: every
// wake-up costs the middleware's thread a system call.
constexpr std::uint64_t kGoodDeal = 1 << 20;

}  // namespace

bool SampleQueue::push(int topic, std::span<const std::byte> data, Time publish_time) {
  QueuedSample sample{.topic = topic, .publish_time = publish_time, .data{data.begin(), data.end()}};
  const std::uint64_t memory = sample.memory();
  std::unique_lock lock(mutex_);
  if (queued_ + given_out_ + memory > capacity_) {
    const auto place = static_cast<std::size_t>(topic);
    if (overflowed_.size() <= place) overflowed_.resize(place + 1);
    ++overflowed_[place];
    return false;
  }
  // Here, so that times rise along the queue.
  sample.log_time = newest_ = std::max(newest_, clock_.at(std::chrono::steady_clock::now()));
  const bool wake = queued_ < kGoodDeal && queued_ + memory >= kGoodDeal;
  queued_ += memory;
  samples_.push_back(std::move(sample));
  lock.unlock();
  if (wake) filled_.notify_one();
  return true;
}

std::vector<QueuedSample> SampleQueue::take(std::chrono::steady_clock::time_point deadline, std::stop_token stop) {
  std::unique_lock lock(mutex_);
  given_out_ = 0;
  filled_.wait_until(lock, std::move(stop), deadline, [&] { return queued_ >= kGoodDeal; });
  given_out_ = std::exchange(queued_, 0);
  return std::exchange(samples_, {});
}

std::uint64_t SampleQueue::overflowed(int topic) const {
  const std::lock_guard lock(mutex_);
  const auto place = static_cast<std::size_t>(topic);
  return place < overflowed_.size() ? overflowed_[place] : 0;
}

}  // namespace jostle::bags
