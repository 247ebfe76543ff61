#pragma once
/// \file
/// Progress of a run in the terminal.

#include <chrono>
#include <cstdint>
#include <map>
#include <string>

#include "services/dds/topics.hpp"

namespace jostle::services {

/// One line that is drawn over and over in a terminal; a line per piece of news
/// where the output is a file or a pipe. Writes to standard error.
class Display {
 public:
  explicit Display(bool live) : live_(live) {}
  ~Display() { finish(); }

  void show(const jostle_msgs::msg::Feedback& feedback);
  void notice(const std::string& text);
  void finish();  ///< leaves the last line standing

 private:
  struct Rate {
    std::uint64_t rollouts = 0;
    double per_second = 0.0;
  };

  std::string line(const jostle_msgs::msg::Feedback& feedback);
  void measure_rates(const jostle_msgs::msg::Feedback& feedback);

  bool live_;
  bool open_ = false;  // a live line stands without its newline
  std::chrono::steady_clock::time_point measured_;
  std::map<std::string, Rate> rates_;  // by worker
  std::string last_news_;
};

}  // namespace jostle::services
