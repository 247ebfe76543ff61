#include "services/studies/progress/work_line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>

#include "services/common/terminal/progress_line.hpp"

namespace jostle::studies {
namespace {

using namespace std::chrono_literals;

constexpr auto kRedraw = 1s, kPlainLine = 30s;

double seconds_between(std::chrono::steady_clock::time_point a, std::chrono::steady_clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

}  // namespace

std::string work_text(const std::string& unit, const WorkState& state) {
  std::string text = fmt::format("{} of {} {}", state.done, state.total, unit);
  if (state.total > 0) text += fmt::format(" ({} %)", 100 * state.done / state.total);
  text += fmt::format(", {} so far", common::duration_text(state.seconds));
  if (state.work_done <= 0 || state.done >= state.total) return text;
  const double taken = state.seconds - state.since_last;  // until the last one was done
  const double each = taken / static_cast<double>(state.done - state.found);
  const double left = taken / state.work_done * state.work_left - std::min(state.since_last, each);
  return text + fmt::format(", about {} left", common::duration_text(std::max(left, 1.0)));
}

WorkLine::WorkLine(std::string speaker, std::string unit)
    : speaker_(std::move(speaker)),
      unit_(std::move(unit)),
      line_(speaker_, common::PlainLines::kElsewhere),
      drawer_([this](std::stop_token stop) { work(stop); }) {}

WorkLine::~WorkLine() {
  drawer_.request_stop();
  drawer_.join();
  line_.wipe();
}

void WorkLine::end() {
  const std::lock_guard lock(mutex_);
  line_.wipe();
  has_ended_ = true;
}

void WorkLine::expect(std::size_t more, double work) {
  const std::lock_guard lock(mutex_);
  state_.total += more;
  state_.work_left += static_cast<double>(more) * work;
}

void WorkLine::skip(std::size_t found) {
  const std::lock_guard lock(mutex_);
  state_.done += found;
  state_.found += found;
  state_.work_left -= static_cast<double>(found);
}

void WorkLine::step(std::string news, double work) {
  const std::lock_guard lock(mutex_);
  ++state_.done;
  state_.work_done += work;
  state_.work_left -= work;
  last_ = Clock::now();
  if (!news.empty()) news_ = std::move(news);
  draw(line_.live());
}

void WorkLine::news(std::string text) {
  const std::lock_guard lock(mutex_);
  news_ = std::move(text);
}

void WorkLine::tell(const std::string& line) {
  const std::lock_guard lock(mutex_);
  line_.wipe();
  line_.say("{}", line);
  draw(line_.live());
}

void WorkLine::work(std::stop_token stop) {
  std::condition_variable_any never;
  std::unique_lock lock(mutex_);
  while (!never.wait_for(lock, stop, kRedraw, [&] { return stop.stop_requested(); })) draw(line_.live());
}

void WorkLine::draw(bool now) {
  const auto time = Clock::now();
  if (has_ended_ || state_.total == 0 || (!now && time < next_)) return;
  next_ = time + kPlainLine;
  state_.seconds = seconds_between(start_, time);
  state_.since_last = seconds_between(last_, time);
  line_.draw(fmt::format("{}: {}{}{}", speaker_, work_text(unit_, state_), news_.empty() ? "" : "; ", news_));
}

}  // namespace jostle::studies
