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
template <class... Cases>
Match(Cases...) -> Match<Cases...>;

constexpr std::size_t kJoints = std::tuple_size_v<Joints>;
constexpr double kFarthest = 6.2832;      // rad: a joint's range either way
constexpr double kMetresPerRadian = 0.5;  // of a straight line: turns take as long as so much way

Eigen::Isometry3d pose_of(const std::array<double, 6>& x) {
  const Eigen::Vector3d rotation(x[3], x[4], x[5]);
  Eigen::Isometry3d pose(Eigen::Translation3d(x[0], x[1], x[2]));
  if (rotation.norm() > 1e-12) pose.rotate(Eigen::AngleAxisd(rotation.norm(), rotation.normalized()));
  return pose;
}

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
  static const std::regex kCall(R"(\s*(movej|movel|servoj|speedj|speedl|stopj|stopl|sleep)\s*\((.*)\)\s*)");
  static const std::regex kItem(R"(\s*(?:p?\[([^\]]*)\]|(?:(\w+)\s*=\s*)?([^,\[\]=]+))\s*(?:,|$))");
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
  if (got.function == "stopj" || got.function == "stopl")
    return std::optional<Motion>(StopJ{got.get(0, "a", StopJ{}.a)});
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
  if (got.function == "speedl") {
    return std::optional<Motion>(SpeedL{.xd = q, .a = got.get(0, "a", SpeedL{}.a), .t = got.get(1, "t", 0.0)});
  }
  if (got.function == "movel") {
    return std::optional<Motion>(MoveL{
        .pose = q, .a = got.get(0, "a", MoveL{}.a), .v = got.get(1, "v", MoveL{}.v), .t = got.get(2, "t", MoveL{}.t)});
  }
  if (got.function == "servoj") return std::optional<Motion>(ServoJ{.q = q, .t = got.get(2, "t", ServoJ{}.t)});
  return std::optional<Motion>(
      MoveJ{.q = q, .a = got.get(0, "a", MoveJ{}.a), .v = got.get(1, "v", MoveJ{}.v), .t = got.get(2, "t", MoveJ{}.t)});
}

void MotionGenerator::reset(const Joints& q) {
  q_ = q;
  qd_ = qdd_ = {};
  motion_ = StopJ{};
  done_ = true;
}

// Trapezoids of speed: up to v and down again, or never up to v.
void MotionGenerator::plan_ramps(double way, double a, double v, double t) {
  a = std::clamp(a, 1e-3, kAcceleration);
  v = std::clamp(v, 1e-3, kFastest);
  if (t > 0.0) {
    duration_ = t;
    ramp_ = 0.25 * duration_;
  } else {
    ramp_ = std::min(v / a, std::sqrt(way / a));
    duration_ = way > 0.0 ? ramp_ + way / (a * ramp_) : 0.0;
  }
}

// By now, in [0, 1].
double MotionGenerator::share_of_way() const {
  const double t = std::min(elapsed_, duration_), cruise = duration_ - ramp_;
  if (ramp_ <= 0.0 || duration_ <= 0.0) return 1.0;
  const double top = 1.0 / cruise;  // 1/s
  if (t < ramp_) return 0.5 * top / ramp_ * t * t;
  if (t < cruise) return top * (t - 0.5 * ramp_);
  return 1.0 - 0.5 * top / ramp_ * (duration_ - t) * (duration_ - t);
}

void MotionGenerator::begin(const Motion& motion) {
  motion_ = motion;
  done_ = false;
  elapsed_ = 0.0;
  start_ = q_;
  if (const auto* move = std::get_if<MoveJ>(&motion_)) {
    double farthest = 0.0;
    for (std::size_t j = 0; j < kJoints; ++j) farthest = std::max(farthest, std::abs(move->q[j] - q_[j]));
    plan_ramps(farthest, move->a, move->v, move->t);
  } else if (const auto* line = std::get_if<MoveL>(&motion_)) {
    const Eigen::Isometry3d from = ur::flange_pose(ur::Dh::ur5(), start_), to = pose_of(line->pose);
    const double turn = Eigen::AngleAxisd(from.linear().transpose() * to.linear()).angle();
    plan_ramps(std::max((to.translation() - from.translation()).norm(), kMetresPerRadian * turn), line->a, line->v,
               line->t);
  } else if (const auto* spline = std::get_if<Spline>(&motion_)) {
    const double T = std::max(spline->t, 1e-3);
    for (std::size_t j = 0; j < kJoints; ++j) {
      const double way = spline->q[j] - q_[j], v0 = qd_[j], v1 = spline->qd[j];
      if (spline->is_quintic) {
        const double a0 = qdd_[j], a1 = spline->qdd[j];
        spline_[j] = {q_[j],
                      v0,
                      0.5 * a0,
                      (20 * way - (8 * v1 + 12 * v0) * T - (3 * a0 - a1) * T * T) / (2 * T * T * T),
                      (-30 * way + (14 * v1 + 16 * v0) * T + (3 * a0 - 2 * a1) * T * T) / (2 * std::pow(T, 4)),
                      (12 * way - 6 * (v1 + v0) * T + (a1 - a0) * T * T) / (2 * std::pow(T, 5))};
      } else {
        spline_[j] = {q_[j], v0, (3 * way - (2 * v0 + v1) * T) / (T * T), (-2 * way + (v0 + v1) * T) / (T * T * T),
                      0,     0};
      }
    }
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
  std::visit(
      Match{[&](const StopJ& stop) {
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
              const double share = share_of_way();
              for (std::size_t j = 0; j < kJoints; ++j) {
                const double next = start_[j] + share * (move.q[j] - start_[j]);
                qd_[j] = (next - q_[j]) / dt;
                q_[j] = next;
              }
              done_ = over(duration_);
              if (done_) qd_ = {};
            },
            [&](const MoveL& move) {
              const Eigen::Isometry3d from = ur::flange_pose(ur::Dh::ur5(), start_), to = pose_of(move.pose);
              const double share = share_of_way();
              Eigen::Isometry3d now = Eigen::Isometry3d::Identity();
              now.translation() = (1.0 - share) * from.translation() + share * to.translation();
              now.linear() =
                  Eigen::Quaterniond(from.linear()).slerp(share, Eigen::Quaterniond(to.linear())).toRotationMatrix();
              const auto q = ur::nearest(ur::inverse(ur::Dh::ur5(), now), q_, kFarthest);
              for (std::size_t j = 0; j < kJoints; ++j) {
                qd_[j] = q ? ((*q)[j] - q_[j]) / dt : 0.0;
                if (q) q_[j] = (*q)[j];
              }
              done_ = over(duration_) || !q;  // where the line leaves the arm's reach it ends
              if (done_) qd_ = {};
            },
            [&](const SpeedL& speed) {
              const auto J = ur::jacobian(ur::Dh::ur5(), q_);
              const Eigen::Matrix<double, 6, 1> qd = J.completeOrthogonalDecomposition().solve(
                  Eigen::Map<const Eigen::Matrix<double, 6, 1>>(speed.xd.data()));
              Joints wanted;
              std::copy_n(qd.data(), kJoints, wanted.begin());
              approach_speeds(wanted, kAcceleration, dt);
              done_ = over(speed.t);
            },
            [&](const Spline& spline) {
              const double t = std::min(elapsed_, spline.t);
              for (std::size_t j = 0; j < kJoints; ++j) {
                const auto& c = spline_[j];
                q_[j] = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))));
                qd_[j] = c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5])));
              }
              done_ = over(spline.t);
              if (done_) qdd_ = spline.qdd;
            },
            [&](const Sleep& sleep) {
              approach_speeds({}, kAcceleration, dt);
              done_ = over(sleep.t);
            }},
      motion_);
}

}  // namespace jostle::robot_bridge::ur_sim
