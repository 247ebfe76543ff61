#include "robot_bridge/ur_sim/motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <regex>
#include <string>

#include "idl/types/number.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

template <class... Cases>
struct Match : Cases... {
  using Cases::operator()...;
};

constexpr std::size_t kJoints = std::tuple_size_v<Joints>;

// The arguments of a call: a list of six numbers, and others by place or name.
struct Arguments {
  std::string function;
  std::vector<double> list, placed;
  std::map<std::string, double> named;

  double get(std::size_t place, const std::string& name, double otherwise) const {
    if (const auto found = named.find(name); found != named.end()) return found->second;
    return place < placed.size() ? placed[place] : otherwise;
  }
};

Result<double> number(const std::string& text, const std::string& call) {
  if (const auto value = parse_number(text); value && std::isfinite(*value)) return *value;
  return Error{Code::kInvalidArgument, fmt::format("'{}': got '{}', wanted a number", call, text)};
}

Result<std::optional<Arguments>> split(const std::string& call) {
  static const std::regex kCall(R"(\s*(movej|servoj|speedj|stopj|sleep)\s*\((.*)\)\s*)");
  static const std::regex kItem(R"(\s*(?:\[([^\]]*)\]|(?:(\w+)\s*=\s*)?([^,\[\]=]+))\s*(?:,|$))");
  std::smatch match;
  if (!std::regex_match(call, match, kCall)) return std::optional<Arguments>();
  Arguments arguments{.function = match[1]};
  const std::string inside = match[2];
  const auto trimmed = [](std::string text) {
    text.erase(0, text.find_first_not_of(" \t"));
    text.erase(text.find_last_not_of(" \t") + 1);
    return text;
  };
  std::size_t read = 0;
  for (auto item = std::sregex_iterator(inside.begin(), inside.end(), kItem); item != std::sregex_iterator(); ++item) {
    if (static_cast<std::size_t>(item->position()) != read) break;
    read += static_cast<std::size_t>(item->length());
    if ((*item)[1].matched) {
      std::string list = (*item)[1];
      for (std::size_t begin = 0; begin <= list.size();) {
        const std::size_t end = std::min(list.find(',', begin), list.size());
        auto value_result = number(trimmed(list.substr(begin, end - begin)), call);
        if (!value_result) return value_result.error();
        arguments.list.push_back(*value_result);
        begin = end + 1;
      }
      continue;
    }
    auto value_result = number(trimmed((*item)[3]), call);
    if (!value_result) return value_result.error();
    if ((*item)[2].matched) {
      arguments.named[(*item)[2]] = *value_result;
    } else {
      arguments.placed.push_back(*value_result);
    }
  }
  if (read < inside.size()) {
    return Error{Code::kInvalidArgument,
                 fmt::format("'{}': got '{}', wanted numbers, NAME=NUMBER or one list", call, inside.substr(read))};
  }
  return std::optional(std::move(arguments));
}

}  // namespace

Result<std::optional<Motion>> parse_motion(std::string_view text) {
  const std::string call(text);
  auto arguments_result = split(call);
  if (!arguments_result) return arguments_result.error();
  if (!*arguments_result) return std::optional<Motion>();
  const Arguments& got = **arguments_result;
  if (got.function == "stopj") return std::optional<Motion>(StopJ{got.get(0, "a", StopJ{}.a)});
  if (got.function == "sleep") return std::optional<Motion>(Sleep{got.get(0, "t", 0.0)});
  if (got.list.size() != kJoints) {
    return Error{Code::kInvalidArgument,
                 fmt::format("'{}': got a list of {} numbers, wanted {} joints", call, got.list.size(), kJoints)};
  }
  Joints q;
  std::ranges::copy(got.list, q.begin());
  if (got.function == "speedj") {
    return std::optional<Motion>(SpeedJ{.qd = q, .a = got.get(0, "a", SpeedJ{}.a), .t = got.get(1, "t", 0.0)});
  }
  if (got.function == "servoj") return std::optional<Motion>(ServoJ{.q = q, .t = got.get(2, "t", ServoJ{}.t)});
  return std::optional<Motion>(
      MoveJ{.q = q, .a = got.get(0, "a", MoveJ{}.a), .v = got.get(1, "v", MoveJ{}.v), .t = got.get(2, "t", MoveJ{}.t)});
}

void MotionGenerator::reset(const Joints& q) {
  q_ = q;
  qd_ = {};
  motion_ = StopJ{};
  done_ = true;
}

void MotionGenerator::begin(const Motion& motion) {
  motion_ = motion;
  done_ = false;
  elapsed_ = 0.0;
  start_ = q_;
  const auto* move = std::get_if<MoveJ>(&motion_);
  if (!move) return;
  double farthest = 0.0;
  for (std::size_t j = 0; j < kJoints; ++j) farthest = std::max(farthest, std::abs(move->q[j] - q_[j]));
  const double a = std::clamp(move->a, 1e-3, kAcceleration), v = std::clamp(move->v, 1e-3, kFastest);
  if (move->t > 0.0) {
    duration_ = move->t;
    ramp_ = 0.25 * duration_;
  } else {
    // Up to v and down again; or never up to v.
    ramp_ = std::min(v / a, std::sqrt(farthest / a));
    duration_ = farthest > 0.0 ? ramp_ + farthest / (a * ramp_) : 0.0;
  }
}

void MotionGenerator::approach_speeds(const Joints& wanted, double a, double dt) {
  const double most = std::clamp(a, 0.0, kAcceleration) * dt;
  for (std::size_t j = 0; j < kJoints; ++j) {
    const double goal = std::clamp(wanted[j], -kFastest, kFastest);
    qd_[j] += std::clamp(goal - qd_[j], -most, most);
    q_[j] += qd_[j] * dt;
  }
}

void MotionGenerator::advance(double dt) {
  elapsed_ += dt;
  const auto over = [&](double t) { return elapsed_ >= t - 1e-9; };
  std::visit(Match{[&](const StopJ& stop) {
                     approach_speeds({}, stop.a, dt);
                     done_ = qd_ == Joints{};
                   },
                   [&](const SpeedJ& speed) {
                     approach_speeds(speed.qd, speed.a, dt);
                     done_ = speed.t > 0.0 ? over(speed.t) : qd_ == speed.qd;
                   },
                   [&](const ServoJ& servo) {
                     Joints wanted;
                     const double left = std::max(servo.t - elapsed_ + dt, dt);
                     for (std::size_t j = 0; j < kJoints; ++j) wanted[j] = (servo.q[j] - q_[j]) / left;
                     approach_speeds(wanted, kAcceleration, dt);
                     done_ = over(servo.t);
                   },
                   [&](const MoveJ& move) {
                     // Trapezoids of speed that all joints share, by the share of the way that is behind them.
                     const double t = std::min(elapsed_, duration_);
                     const double cruise = duration_ - ramp_;
                     double share = 1.0;
                     if (ramp_ > 0.0 && duration_ > 0.0) {
                       const double top = 1.0 / cruise;  // share/s
                       if (t < ramp_) {
                         share = 0.5 * top / ramp_ * t * t;
                       } else if (t < cruise) {
                         share = top * (t - 0.5 * ramp_);
                       } else {
                         share = 1.0 - 0.5 * top / ramp_ * (duration_ - t) * (duration_ - t);
                       }
                     }
                     for (std::size_t j = 0; j < kJoints; ++j) {
                       const double next = start_[j] + share * (move.q[j] - start_[j]);
                       qd_[j] = (next - q_[j]) / dt;
                       q_[j] = next;
                     }
                     done_ = over(duration_);
                     if (done_) qd_ = {};
                   },
                   [&](const Sleep& sleep) {
                     approach_speeds({}, kAcceleration, dt);
                     done_ = over(sleep.t);
                   }},
             motion_);
}

}  // namespace jostle::robot_bridge::ur_sim
