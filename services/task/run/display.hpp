#pragma once
/// \file
/// Progress of a run in the terminal.

#include <chrono>
#include <cstdint>
#include <map>
#include <string>

#include "services/common/terminal/live_line.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::task {

/// Draws feedback on `line`, which outlives it. Where lines are plain, each piece of news gets one.
class Display {
 public:
  explicit Display(common::LiveLine& line) : line_(line) {}

  void show(const jostle_msgs::msg::Feedback& feedback);

 private:
  struct Rate {
    std::uint64_t rollouts = 0;
    double per_second = 0.0;
  };

  std::string text(const jostle_msgs::msg::Feedback& feedback);
  void measure_rates(const jostle_msgs::msg::Feedback& feedback);

  common::LiveLine& line_;
  std::chrono::steady_clock::time_point measured_;
  std::map<std::uint64_t, Rate> rates_;  // by worker
  std::string last_news_;
};

}  // namespace jostle::task
