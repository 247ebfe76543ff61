#include "services/task/run/display.hpp"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "services/common/terminal/fitted_line.hpp"

namespace jostle::task {
namespace {

constexpr std::chrono::seconds kRateWindow{1};
constexpr int kAfterTarget = 3;  // parts before it
constexpr int kWorkerRank = 6;   // of the first worker: all else is more important

}  // namespace

void Display::show(const jostle_msgs::msg::Feedback& feedback) {
  measure_rates(feedback);
  const std::string news = fmt::format("{} {} {} {} {}", feedback.phase(), feedback.iteration(), feedback.actions(),
                                       feedback.replans(), feedback.segments());
  const bool is_news = std::exchange(last_news_, news) != news;
  if (line_.live() || is_news) line_.draw(text(feedback));
}

// What a terminal has no room for goes, the least important first; plain lines have room for all.
std::string Display::text(const jostle_msgs::msg::Feedback& feedback) {
  double total = 0.0;
  std::vector<common::LinePart> workers;
  for (const auto& report : feedback.workers()) {
    if (!report.alive()) continue;
    const double rate = rates_[report.id()].per_second;
    total += rate;
    workers.push_back({fmt::format("{}:{:.1f}", report.name(), rate), kWorkerRank + static_cast<int>(workers.size())});
  }
  const auto number = [](bool known, double value) { return known ? fmt::format("{:.1f}", value) : "-"; };
  const std::string cost = number(feedback.rollouts() > 0, feedback.cost());  // before rollouts there is none
  const std::string distance = number(feedback.target_distance() > 0.0, 100 * feedback.target_distance());
  std::vector<common::LinePart> parts{
      {fmt::format("{:5.1f} s  {:<9} iteration {:>2}", feedback.elapsed(), feedback.phase(), feedback.iteration()), 0},
      {fmt::format("cost {:>8}", cost), 4},
      {fmt::format("target {:>5} cm", distance), 1},
      {fmt::format("actions {:>2}", feedback.actions()), 5},
      {fmt::format("re-plans {:>2}", feedback.replans()), 2},
      {fmt::format("{:.1f} {}/s", total, feedback.unit()), 3}};
  if (feedback.speed() > 0) {  // of controllers that choose one
    parts.insert(parts.begin() + kAfterTarget, {fmt::format("speed {:>5.1f} cm/s", 100 * feedback.speed()), 1});
  }
  if (feedback.actions() > 0) parts.push_back({fmt::format("idle {:.2f} s", feedback.idle()), 4});
  // Of controllers that look only where they must.
  if (!feedback.segments().empty()) parts.push_back({feedback.segments(), 1});
  parts.insert(parts.end(), workers.begin(), workers.end());
  const std::size_t width = line_.live() ? line_.width() : std::string::npos;
  return common::fitted_line(std::move(parts), width);
}

void Display::measure_rates(const jostle_msgs::msg::Feedback& feedback) {
  const auto now = std::chrono::steady_clock::now();
  const double elapsed = std::chrono::duration<double>(now - measured_).count();
  if (now - measured_ < kRateWindow) return;
  measured_ = now;
  for (const auto& report : feedback.workers()) {
    Rate& rate = rates_[report.id()];
    // The first window of a worker has no beginning to measure from.
    const bool measured = rate.rollouts > 0 && report.rollouts() >= rate.rollouts;
    rate.per_second = measured ? static_cast<double>(report.rollouts() - rate.rollouts) / elapsed : 0.0;
    rate.rollouts = report.rollouts();
  }
}

}  // namespace jostle::task
