#include "services/bags/playback/read_ahead.hpp"

#include <algorithm>

namespace jostle::bags {
namespace {

std::uint64_t memory_of(const Message& message) { return sizeof message + message.data.size(); }

}  // namespace

ReadAhead::ReadAhead(std::unique_ptr<BagReader> reader, Options options)
    : options_(std::move(options)),
      reader_(std::move(reader)),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

ReadAhead::~ReadAhead() = default;

void ReadAhead::seek(Time from, Time until) {
  {
    const std::lock_guard lock(mutex_);
    ++asked_;
    from_ = from;
    until_ = until;
    moment_.reset();
    messages_.clear();
    held_ = 0;
    done_ = false;
    problem_.reset();
  }
  changed_.notify_all();
}

std::optional<std::vector<Message>> ReadAhead::take_moment() {
  const std::lock_guard lock(mutex_);
  return std::exchange(moment_, std::nullopt);
}

const Message* ReadAhead::peek() {
  const std::lock_guard lock(mutex_);
  return messages_.empty() ? nullptr : &messages_.front();  // stays where it is when others come behind
}

void ReadAhead::pop() {
  {
    const std::lock_guard lock(mutex_);
    held_ -= memory_of(messages_.front());
    messages_.pop_front();
  }
  changed_.notify_all();
}

bool ReadAhead::at_end() {
  const std::lock_guard lock(mutex_);
  return done_ && !problem_ && messages_.empty();
}

std::optional<Error> ReadAhead::problem() {
  const std::lock_guard lock(mutex_);
  return messages_.empty() ? problem_ : std::nullopt;
}

bool ReadAhead::wait(std::chrono::steady_clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  return changed_.wait_until(lock, deadline, [this] { return has_news(); });
}

bool ReadAhead::has_news() const { return answered_ == asked_ && (moment_ || !messages_.empty() || done_); }

void ReadAhead::work(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (true) {
    const auto has_work = [this] {
      return answered_ != asked_ || (answered_ > 0 && !done_ && held_ < options_.memory);
    };
    if (!changed_.wait(lock, stop, has_work)) return;
    const bool is_news = answered_ != asked_ ? restart(lock) : fetch(lock);
    if (!is_news) continue;
    changed_.notify_all();
    if (!options_.on_news) continue;
    lock.unlock();
    options_.on_news();
    lock.lock();
  }
}

bool ReadAhead::restart(std::unique_lock<std::mutex>& lock) {
  const std::uint64_t asked = asked_;
  const Time from = from_;
  lock.unlock();
  reader_->seek(from, options_.topics);
  std::vector<Message> moment;
  std::optional<Error> problem;
  for (const int topic : options_.state_topics) {
    auto message_result = reader_->last_at(topic, from - 1);
    if (!message_result) {
      problem = message_result.error();
      break;
    }
    if (*message_result) moment.push_back(std::move(**message_result));
  }
  std::ranges::stable_sort(moment, {}, &Message::log_time);
  lock.lock();
  if (asked != asked_) return false;  // asked for something else meanwhile
  if (problem) {
    problem_ = std::move(problem);
    done_ = true;
  } else {
    fetch(lock);
    if (asked != asked_) return false;
  }
  moment_ = std::move(moment);
  answered_ = asked;
  return true;
}

bool ReadAhead::fetch(std::unique_lock<std::mutex>& lock) {
  const std::uint64_t asked = asked_;
  const Time until = until_;
  lock.unlock();
  auto message_result = reader_->next();
  lock.lock();
  if (asked != asked_) return false;
  const bool had_news = has_news();  // now: what there was may have been taken meanwhile
  if (!message_result) {
    problem_ = message_result.error();
    done_ = true;
  } else if (!*message_result || (*message_result)->log_time > until) {
    done_ = true;
  } else {
    held_ += memory_of(**message_result);
    messages_.push_back(std::move(**message_result));
  }
  return !had_news;
}

}  // namespace jostle::bags
