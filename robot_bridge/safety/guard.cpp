#include "robot_bridge/safety/guard.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "robot_bridge/safety/command_check.hpp"

namespace jostle::robot_bridge {
namespace {

constexpr double kRested = 0.1;       // s: after it a robot that was given nothing to do stands still
constexpr double kPlaceEvery = 0.01;  // m or rad between two places of a way that are looked at
constexpr double kMostPlaces = 200;

std::vector<double> limits_of(const std::vector<GuardedAxis>& axes) {
  std::vector<double> limits;
  for (const GuardedAxis& axis : axes) limits.push_back(axis.limit);
  return limits;
}

}  // namespace

Guard::Guard(Robot& robot, GuardOptions options)
    : robot_(robot), options_(std::move(options)), limits_(limits_of(options_.axes)), u_(limits_.size(), 0.0) {}

Result<RobotReading> Guard::read(std::stop_token stop) {
  auto reading_result = robot_.read(std::move(stop));
  if (reading_result) remember(*reading_result);
  return reading_result;
}

Result<void> Guard::start(std::span<const double> u, double duration, std::stop_token stop) {
  if (acts_) return action_at_work();
  if (auto ok = check_command(u, limits_, duration); !ok) return ok;
  auto reading_result = read(stop);
  if (!reading_result) return reading_result.error();
  if (auto ok = check_state(*reading_result); !ok) return ok;
  if (auto ok = check_change(u, reading_result->stamp); !ok) return ok;
  if (auto ok = check_way(*reading_result, u, duration); !ok) return ok;
  if (auto ok = robot_.start(u, duration, std::move(stop)); !ok) return ok;
  begin_ = std::move(reading_result).value();
  u_.assign(u.begin(), u.end());
  speeds_ = joint_speeds(u, begin_.q.size());
  duration_ = duration;
  stamp_ = begin_.stamp;
  newest_ = Clock::now();
  acts_ = true;
  return {};
}

Result<bool> Guard::advance(std::stop_token stop) {
  if (!acts_) return true;
  auto over = robot_.advance(std::move(stop));
  if (!over) {
    acts_ = false;
    over_ = -1.0;
    if (over.error().code != Code::kCancelled && options_.tell) {
      options_.tell(over.error().message + "\n" + history());
    }
    return over;
  }
  const auto reading_result = read();
  if (!reading_result) return end(reading_result.error());
  if (reading_result->stamp > stamp_) {
    stamp_ = reading_result->stamp;
    newest_ = Clock::now();
    if (auto ok = check_state(*reading_result); !ok) return end(ok.error());
  } else if (reading_result->stamp < stamp_) {
    return end({Code::kUnavailable,
                fmt::format("robot: got a state of {:.3f} s after one of {:.3f} s", reading_result->stamp, stamp_)});
  } else if (!*over && Clock::now() - newest_ > options_.silence) {
    return end(
        {Code::kUnavailable, fmt::format("robot: it showed no newer state for {} ms", options_.silence.count())});
  }
  if (*over) {
    acts_ = false;
    over_ = stamp_;
  }
  return over;
}

Result<void> Guard::check_change(std::span<const double> u, double stamp) const {
  const bool rested = over_ < 0.0 || stamp - over_ > kRested;
  for (std::size_t i = 0; i < u.size(); ++i) {
    const double before = rested ? 0.0 : u_[i];
    const double most = options_.axes[i].change;
    if (most <= 0.0 || std::abs(u[i] - before) <= most) continue;
    return Error{Code::kInvalidArgument, fmt::format("velocities[{}]: got {} after {}, wanted a change of at most {} "
                                                     "m/s or rad/s",
                                                     i, u[i], before, most)};
  }
  return {};
}

std::vector<double> Guard::joint_speeds(std::span<const double> u, std::size_t joints) const {
  std::vector<double> speeds(joints, 0.0);
  for (std::size_t i = 0; i < u.size(); ++i) {
    for (const auto& [joint, share] : options_.axes[i].joints) {
      if (joint < joints) speeds[joint] += share * u[i];
    }
  }
  return speeds;
}

Result<void> Guard::check_way(const RobotReading& from, std::span<const double> u, double duration) const {
  if (!options_.touches) return {};
  const std::vector<double> speeds = joint_speeds(u, from.q.size());
  double fastest = 0.0;
  for (const double speed : speeds) fastest = std::max(fastest, std::abs(speed));
  const double places = std::clamp(std::ceil(fastest * duration / kPlaceEvery), 1.0, kMostPlaces);
  std::vector<std::vector<double>> path;
  for (double i = 0; i <= places; ++i) {
    path.push_back(from.q);
    for (std::size_t j = 0; j < speeds.size(); ++j) path.back()[j] += speeds[j] * duration * i / places;
  }
  const auto touched = options_.touches(path);
  if (!touched) return {};
  return Error{Code::kInvalidArgument, "the way of this control is not free: " + *touched};
}

// While no action is at work: of the state alone.
Result<void> Guard::check_state(const RobotReading& reading) {
  for (const auto& [field, values] : {std::pair{"q", &reading.q}, std::pair{"v", &reading.v}}) {
    for (std::size_t j = 0; j < values->size(); ++j) {
      if (std::isfinite((*values)[j])) continue;
      return Error{Code::kUnavailable,
                   fmt::format("robot: {}[{}]: got {}, wanted a finite number", field, j, (*values)[j])};
    }
  }
  if (!acts_) return {};
  const double passed = std::min(reading.stamp - begin_.stamp, duration_);
  for (std::size_t j = 0; j < std::min(reading.q.size(), options_.stray.size()); ++j) {
    const double told = speeds_[j] * passed, moved = reading.q[j] - begin_.q[j];
    const double low = std::min(told, 0.0) - options_.stray[j], high = std::max(told, 0.0) + options_.stray[j];
    if (moved >= low && moved <= high) continue;
    return Error{Code::kUnavailable, fmt::format("robot: joint {} is where it was not told to go: it moved by {:.4f} "
                                                 "in {:.3f} s, wanted {:.4f} to {:.4f} m or rad",
                                                 j, moved, passed, low, high)};
  }
  if (!options_.touches) return {};
  if (const auto touched = options_.touches(std::span(&reading.q, 1))) {
    return Error{Code::kUnavailable, "robot: " + *touched};
  }
  return {};
}

void Guard::remember(const RobotReading& reading) {
  if (count_ > 0 && kept_[(count_ - 1) % kKept].stamp == reading.stamp) return;
  Record& record = kept_[count_++ % kKept];
  record.stamp = reading.stamp;
  record.q = reading.q;
  record.v = reading.v;
  record.u = u_;
  if (!acts_) std::ranges::fill(record.u, 0.0);
}

Error Guard::end(Error why) {
  std::stop_source now;
  now.request_stop();
  const auto stopped = robot_.advance(now.get_token());
  acts_ = false;
  over_ = -1.0;
  if (!stopped && stopped.error().code != Code::kCancelled) why.message += "; " + stopped.error().message;
  if (options_.tell) options_.tell(why.message + "\n" + history());
  return {Code::kUnavailable, std::move(why.message)};
}

std::string Guard::history() const {
  if (count_ == 0) return "no state was seen yet";
  const std::size_t kept = std::min(count_, kKept);
  std::string text = fmt::format("the last {} states, s since the newest; u, m/s and rad/s; q, m and rad; v:", kept);
  const double newest = kept_[(count_ - 1) % kKept].stamp;
  for (std::size_t i = count_ - kept; i < count_; ++i) {
    const Record& record = kept_[i % kKept];
    text += fmt::format("\n  {:7.3f}  u [{:.3f}]  q [{:.4f}]  v [{:.3f}]", record.stamp - newest,
                        fmt::join(record.u, ", "), fmt::join(record.q, ", "), fmt::join(record.v, ", "));
  }
  return text;
}

}  // namespace jostle::robot_bridge
