#include "services/tools/doctor/echo.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace jostle::tools {
namespace {

using Clock = std::chrono::steady_clock;
using jostle_msgs::msg::Goal;

constexpr std::size_t kQueue = 64;
constexpr std::chrono::milliseconds kGlance{20};  // between two looks at the other direction
constexpr std::chrono::milliseconds kAnswer{100};

// The pool's own promise. Not a robot's topics: every role may say these (services/wire/security/role.cpp).
const wire::Topic<Goal> kThere{"rt/doctor/there", kTask, wire::Scope::kDomain};
const wire::Topic<Goal> kBack{"rt/doctor/back", kTask, wire::Scope::kDomain};

}  // namespace

Echo::Echo(const wire::Participant& participant)
    : back_(participant, kBack), there_(participant, kThere, kQueue), repeater_([this](std::stop_token stop) {
        while (!stop.stop_requested()) {
          const auto goal = there_.take(TimePoint::max(), stop);
          if (!goal) continue;
          ++heard_;
          (void)back_.write(*goal);  // lost or not taken: the caller measures both as silence
        }
      }) {}

Caller::Caller(const wire::Participant& participant, std::string session)
    : session_(std::move(session)), there_(participant, kThere), back_(participant, kBack, kQueue) {}

bool Caller::meet(TimePoint deadline) {
  while (!there_.wait_for_readers(Clock::now() + kGlance) || back_.matched() == 0) {
    if (Clock::now() >= deadline) return false;
    if (back_.matched() == 0) back_.take(Clock::now() + kGlance);  // waits: nobody has been asked yet
  }
  return true;
}

void Caller::settle(TimePoint deadline) {
  while (Clock::now() < deadline && !call(1, Clock::now() + kAnswer)) {
  }
}

std::optional<std::chrono::nanoseconds> Caller::call(std::size_t bytes, TimePoint deadline) {
  Goal goal;
  goal.goal_id(fmt::format("{}/{}", session_, calls_++));
  goal.execution_scene(std::string(bytes, '.'));
  const auto start = Clock::now();
  (void)there_.write(goal);  // likewise
  while (const auto answer = back_.take(deadline)) {
    if (answer->goal_id() == goal.goal_id() && answer->execution_scene() == goal.execution_scene())
      return Clock::now() - start;
  }
  return {};
}

}  // namespace jostle::tools
