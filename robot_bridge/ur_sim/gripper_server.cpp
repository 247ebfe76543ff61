#include "robot_bridge/ur_sim/gripper_server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>

#include "idl/types/number.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

using robotiq::Object;
using robotiq::Status;

constexpr double kReached = 0.0006;  // m, two counts
constexpr double kStanding = 0.003;  // m/s: slower is standing
constexpr double kContact = 0.08;    // s that the fingers stand where they should move
constexpr double kGain = 30.0;       // 1/s, near the request

}  // namespace

double Gripper::opening_rate(double dt) {
  double wanted = 0.0, speed = robotiq::kFastest;
  if (status_ == Status::kActivating) {
    wanted = opens_again_ ? robotiq::kStroke : 0.0;
    const bool there = std::abs(wanted - plant_.opening()) < 5 * kReached || stalled_ > 2 * kContact;
    stalled_ = std::abs(plant_.opening_velocity()) < kStanding ? stalled_ + dt : 0.0;
    if (there) {
      stalled_ = 0.0;
      if (opens_again_) status_ = Status::kActive;
      opens_again_ = true;
    }
  } else if (status_ != Status::kActive || value("GTO") == 0) {
    return 0.0;
  } else {
    wanted = robotiq::opening_of(value("PRE"));
    speed = robotiq::speed_of(value("SPE"));
    look_for_objects(dt);
  }
  return std::clamp(kGain * (wanted - plant_.opening()), -speed, speed);
}

void Gripper::look_for_objects(double dt) {
  const double left = robotiq::opening_of(value("PRE")) - plant_.opening();
  if (std::abs(left) < kReached) {
    object_ = Object::kAtRequest;
    stalled_ = 0.0;
    return;
  }
  const bool stands = std::abs(plant_.opening_velocity()) < kStanding;
  stalled_ = stands ? stalled_ + dt : 0.0;
  if (stalled_ > kContact) {
    object_ = left < 0.0 ? Object::kMetWhileClosing : Object::kMetWhileOpening;
  } else if (!stands) {
    object_ = Object::kMoving;
  }
}

int Gripper::value(std::string_view variable) const {
  if (variable == "STA") return static_cast<int>(status_);
  if (variable == "OBJ") return static_cast<int>(object_);
  if (variable == "FLT") return status_ == Status::kReset && written_.at("GTO") != 0 ? 5 : 0;
  if (variable == "PRE") return written_.at("POS");
  if (variable == "POS") return robotiq::position_of(plant_.opening());
  const auto found = written_.find(variable);
  return found == written_.end() ? -1 : found->second;
}

bool Gripper::set(std::string_view variable, int value) {
  const auto found = written_.find(variable);
  if (found == written_.end()) return false;
  const int before = found->second;
  found->second = value;
  if (variable == "ACT" && value == 0) {
    status_ = Status::kReset;
  } else if (variable == "ACT" && before == 0) {
    status_ = Status::kActivating;
    opens_again_ = false;
    stalled_ = 0.0;
  } else if (variable == "POS" || variable == "GTO") {
    stalled_ = 0.0;
    if (written_.at("GTO") != 0) object_ = Object::kMoving;
  }
  return true;
}

std::string Gripper::answer(std::string_view request) {
  std::istringstream words{std::string(request)};
  std::string verb, variable, number;
  words >> verb;
  if (verb == "GET" && words >> variable && value(variable) >= 0)
    return fmt::format("{} {}\n", variable, value(variable));
  if (verb != "SET") return "?\n";
  while (words >> variable >> number) {
    const auto wanted = parse_whole<int>(number, 0, 255);
    if (!wanted || !set(variable, *wanted)) return "?\n";
  }
  return "ack";
}

Result<std::unique_ptr<net::TcpServer>> serve_gripper(boost::asio::io_context& context, Gripper& gripper,
                                                      const std::string& address, std::uint16_t port) {
  const auto answer = [&gripper](const std::string& line) -> net::LineService::Answer {
    return {.text = gripper.answer(line)};
  };
  return net::serve_lines(context, address, port, {.greeting = "", .answer = answer});
}

}  // namespace jostle::robot_bridge::ur_sim
