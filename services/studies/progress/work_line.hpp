#pragma once
/// \file
/// How far a study or a benchmark has come, for people who wait for it.

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>
#include <thread>

#include "services/common/terminal/live_line.hpp"

namespace jostle::studies {

/// What is known of some work.
struct WorkState {
  std::size_t done = 0, total = 0;
  std::size_t found = 0;    ///< of those done: how many were done before, and took no time now
  double work_done = 0.0;   ///< of those done now: what they take, in a unit of its own; equal shares if all are alike
  double work_left = 0.0;   ///< what the others take, in the same unit
  double seconds = 0.0;     ///< since the work began
  double since_last = 0.0;  ///< seconds since the last one was done, or since the work began
};

/// Writes "12 of 160 runs (7 %), 3 min so far, about 25 min left". The time left is known once one has been done, and
/// counts down while the next one runs.
std::string work_text(const std::string& unit, const WorkState& state);

/// A WorkLine shows work_text() and the latest news on standard error: on a terminal as one line that is drawn over
/// every second, elsewhere as a line after the first second and every half minute. On a terminal it is gone at the end.
///
/// Threads  safe from any; one of its own draws.
class WorkLine {
 public:
  /// `speaker`: begins every line, such as "jostle bench"; `unit`: what is counted, in the plural.
  WorkLine(std::string speaker, std::string unit);
  ~WorkLine();
  WorkLine(const WorkLine&) = delete;
  WorkLine& operator=(const WorkLine&) = delete;

  /// So many more are to be done, each of which takes so much work.
  void expect(std::size_t more, double work = 1.0);
  void skip(std::size_t found);  ///< so many of those expected, all alike, were done before
  void step(std::string news = "", double work = 1.0);
  void news(std::string text);
  void tell(const std::string& line);  ///< a line of its own, which stays
  void end();                          ///< nothing is shown from now on, but for what is told

 private:
  using Clock = std::chrono::steady_clock;

  void work(std::stop_token stop);
  void draw(bool now);

  const std::string speaker_, unit_;
  std::mutex mutex_;  // guards everything below
  common::LiveLine line_;
  WorkState state_;
  std::string news_;
  bool has_ended_ = false;
  const Clock::time_point start_ = Clock::now();
  Clock::time_point last_ = start_, next_ = start_;
  std::jthread drawer_;  // last: uses all of the above
};

}  // namespace jostle::studies
