#include "services/world/link/messages.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "idl/msg/ros.h"
#include "services/common/process/trouble.hpp"

namespace jostle::world {
namespace {

geometry_msgs::msg::Vector3 to_vector(const std::array<double, 3>& values) {
  geometry_msgs::msg::Vector3 vector;
  vector.x(values[0]);
  vector.y(values[1]);
  vector.z(values[2]);
  return vector;
}

std::array<double, 3> from_vector(const geometry_msgs::msg::Vector3& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

geometry_msgs::msg::Pose to_pose(const perception::ObjectReading& object) {
  geometry_msgs::msg::Pose pose;
  pose.position().x(object.position[0]);
  pose.position().y(object.position[1]);
  pose.position().z(object.position[2]);
  pose.orientation().w(object.orientation[0]);
  pose.orientation().x(object.orientation[1]);
  pose.orientation().y(object.orientation[2]);
  pose.orientation().z(object.orientation[3]);
  return pose;
}

template <std::size_t N>
Result<void> check_finite(const std::string& field, const std::array<double, N>& values,
                          const std::array<const char*, N>& names) {
  for (std::size_t i = 0; i < N; ++i) {
    if (std::isfinite(values[i])) continue;
    return Error{Code::kInvalidArgument,
                 fmt::format("{}.{}: got {}, wanted a finite number", field, names[i], values[i])};
  }
  return {};
}

constexpr std::array kXyz{"x", "y", "z"};
constexpr std::array kWxyz{"w", "x", "y", "z"};

Result<void> check(const perception::ObjectReading& object, std::size_t index) {
  const std::string field = fmt::format("objects[{}] ('{}')", index, object.name);
  if (auto ok = check_finite(field + ".pose.position", object.position, kXyz); !ok) return ok;
  if (auto ok = check_finite(field + ".pose.orientation", object.orientation, kWxyz); !ok) return ok;
  if (auto ok = check_finite(field + ".linear", object.linear, kXyz); !ok) return ok;
  if (auto ok = check_finite(field + ".angular", object.angular, kXyz); !ok) return ok;
  double norm = 0.0;
  for (const double value : object.orientation) norm += value * value;
  if (std::abs(norm - 1.0) > 1e-3) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}.pose.orientation: got norm {}, wanted a unit quaternion", field, std::sqrt(norm))};
  }
  return {};
}

std::vector<jostle_msgs::msg::ObjectState> to_messages(const std::vector<perception::ObjectReading>& objects) {
  std::vector<jostle_msgs::msg::ObjectState> states;
  for (const perception::ObjectReading& object : objects) {
    jostle_msgs::msg::ObjectState state;
    state.name(object.name);
    state.pose(to_pose(object));
    state.linear(to_vector(object.linear));
    state.angular(to_vector(object.angular));
    states.push_back(std::move(state));
  }
  return states;
}

Result<std::vector<perception::ObjectReading>> from_messages(const std::vector<jostle_msgs::msg::ObjectState>& states) {
  std::vector<perception::ObjectReading> objects;
  for (const jostle_msgs::msg::ObjectState& state : states) {
    const auto& p = state.pose().position();
    const auto& q = state.pose().orientation();
    objects.push_back({.name = state.name(),
                       .position = {p.x(), p.y(), p.z()},
                       .orientation = {q.w(), q.x(), q.y(), q.z()},
                       .linear = from_vector(state.linear()),
                       .angular = from_vector(state.angular())});
    if (auto ok = check(objects.back(), objects.size() - 1); !ok) return ok.error();
  }
  return objects;
}

Result<void> check_finite(const std::vector<double>& q, const std::vector<double>& v) {
  for (const auto& [field, values] : {std::pair{"q", &q}, std::pair{"v", &v}}) {
    for (std::size_t i = 0; i < values->size(); ++i) {
      if (std::isfinite((*values)[i])) continue;
      return Error{Code::kInvalidArgument,
                   fmt::format("{}[{}]: got {}, wanted a finite number", field, i, (*values)[i])};
    }
  }
  return {};
}

namespace hand = jostle_msgs::msg::RobotStatus_Constants;

}  // namespace

std_msgs::msg::Header make_header(double time, const std::string& frame) {
  const auto nanoseconds = static_cast<std::int64_t>(std::llround(time * 1e9));
  std_msgs::msg::Header header;
  header.stamp().sec(static_cast<std::int32_t>(nanoseconds / 1'000'000'000));
  header.stamp().nanosec(static_cast<std::uint32_t>(nanoseconds % 1'000'000'000));
  header.frame_id(frame);
  return header;
}

double seconds(const std_msgs::msg::Header& header) { return header.stamp().sec() + 1e-9 * header.stamp().nanosec(); }

jostle_msgs::msg::ObjectStates to_message(const std::vector<perception::ObjectReading>& objects, double time) {
  jostle_msgs::msg::ObjectStates message;
  message.header(make_header(time));
  message.objects(to_messages(objects));
  return message;
}

Result<std::vector<perception::ObjectReading>> from_message(const jostle_msgs::msg::ObjectStates& message) {
  return from_messages(message.objects());
}

sensor_msgs::msg::JointState joint_state_message(const StateLayout& layout, const State& x, double time) {
  const auto joints = static_cast<std::ptrdiff_t>(layout.joints.size());
  sensor_msgs::msg::JointState message;
  message.header(make_header(time, ""));
  message.name(layout.joints);
  message.position().assign(x.q.begin(), x.q.begin() + joints);
  message.velocity().assign(x.v.begin(), x.v.begin() + joints);
  return message;
}

geometry_msgs::msg::PoseArray pose_array_message(const jostle_msgs::msg::ObjectStates& objects) {
  geometry_msgs::msg::PoseArray message;
  message.header(objects.header());
  for (const auto& object : objects.objects()) message.poses().push_back(object.pose());
  return message;
}

tf2_msgs::msg::TFMessage transform_message(const jostle_msgs::msg::ObjectStates& objects) {
  tf2_msgs::msg::TFMessage message;
  for (const auto& object : objects.objects()) {
    geometry_msgs::msg::TransformStamped transform;
    transform.header(objects.header());
    transform.child_frame_id(object.name());
    const auto& p = object.pose().position();
    transform.transform().translation(to_vector({p.x(), p.y(), p.z()}));
    transform.transform().rotation(object.pose().orientation());
    message.transforms().push_back(std::move(transform));
  }
  return message;
}

Result<void> check_scene(const std::string& simulated, const Hash& wanted) {
  if (simulated.empty() || simulated == to_string(wanted)) return {};
  return Error{
      Code::kUnknownWorld,
      fmt::format("got a world simulated in the scene of hash {}, wanted {}: plans would be made for other things "
                  "than are there; give the scene file that the world was started with (`jostle scene check "
                  "FILE` prints its hash), or start the world with this one",
                  common::shown(simulated, 32), to_string(wanted))};
}

jostle_msgs::msg::VelocityCommand stop_message(std::uint64_t epoch, std::uint64_t sequence_number) {
  jostle_msgs::msg::VelocityCommand message;
  message.epoch(epoch);
  message.sequence_number(sequence_number);
  return message;
}

bool is_stop(const jostle_msgs::msg::VelocityCommand& command) {
  return command.velocities().empty() && command.duration() == 0;
}

std::uint8_t in_hand_message(std::optional<bool> object_in_hand) {
  if (!object_in_hand) return hand::CANNOT_TELL;
  return *object_in_hand ? hand::HOLDING : hand::EMPTY;
}

std::optional<bool> in_hand_from(std::uint8_t in_hand) {
  if (in_hand == hand::HOLDING) return true;
  if (in_hand == hand::EMPTY) return false;
  return {};
}

Result<robot_bridge::RobotReading> from_message(const jostle_msgs::msg::RobotStatus& message) {
  if (auto ok = check_finite(message.q(), message.v()); !ok) return ok.error();
  return robot_bridge::RobotReading{.stamp = seconds(message.header()),
                                    .q = message.q(),
                                    .v = message.v(),
                                    .object_in_hand = in_hand_from(message.in_hand())};
}

void put_error(const std::optional<Error>& error, jostle_msgs::msg::RobotStatus& message) {
  message.error(error ? error->message : "");
  message.error_code(error ? static_cast<std::uint8_t>(error->code) : std::uint8_t{0});
}

std::optional<Error> error_of(const jostle_msgs::msg::RobotStatus& message) {
  if (message.error().empty()) return {};
  if (message.error_code() > static_cast<std::uint8_t>(Code::kInternal)) return Error{Code::kInternal, message.error()};
  const auto code = static_cast<Code>(message.error_code());
  const bool is_its_own = code == Code::kDeadline || code == Code::kCancelled;
  return Error{is_its_own ? Code::kUnavailable : code, message.error()};
}

jostle_msgs::msg::Observation to_message(const Seen& seen, double time) {
  jostle_msgs::msg::Observation message;
  message.header(make_header(time));
  message.q(seen.robot.q);
  message.v(seen.robot.v);
  message.in_hand(in_hand_message(seen.robot.object_in_hand));
  message.objects(to_messages(seen.objects));
  return message;
}

Result<Seen> from_message(const jostle_msgs::msg::Observation& message) {
  if (auto ok = check_finite(message.q(), message.v()); !ok) return ok.error();
  auto objects_result = from_messages(message.objects());
  if (!objects_result) return objects_result.error();
  return Seen{.robot = {.stamp = seconds(message.header()),
                        .q = message.q(),
                        .v = message.v(),
                        .object_in_hand = in_hand_from(message.in_hand())},
              .objects = std::move(objects_result).value()};
}

}  // namespace jostle::world
