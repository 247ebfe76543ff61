#include "services/task/run/display.hpp"

#include <fmt/format.h>

#include <utility>

namespace jostle::task {
namespace {

constexpr std::chrono::seconds kRateWindow{1};

}  // namespace

void Display::show(const jostle_msgs::msg::Feedback& feedback) {
  measure_rates(feedback);
  const std::string news =
      fmt::format("{} {} {} {}", feedback.phase(), feedback.iteration(), feedback.actions(), feedback.replans());
  const bool is_news = std::exchange(last_news_, news) != news;
  if (line_.live() || is_news) line_.draw(text(feedback));
}

std::string Display::text(const jostle_msgs::msg::Feedback& feedback) {
  std::string workers;
  double total = 0.0;
  for (const auto& report : feedback.workers()) {
    if (!report.alive()) continue;
    const double rate = rates_[report.id()].per_second;
    total += rate;
    workers += fmt::format(" {}:{:.1f}", report.name(), rate);
  }
  return fmt::format(
      "{:5.1f} s  {:<9} iteration {:>2}  cost {:>8.1f}  target {:>5.1f} cm  actions {:>2}  "
      "re-plans {:>2}  {:.1f} {}/s [{} ]",
      feedback.elapsed(), feedback.phase(), feedback.iteration(), feedback.cost(), 100 * feedback.target_distance(),
      feedback.actions(), feedback.replans(), total, feedback.unit(), workers);
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
