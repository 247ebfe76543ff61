#include "robot_bridge/ur/primary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace jostle::robot_bridge::ur::primary {
namespace {

constexpr std::size_t kHeader = 5;  // bytes: length and type
constexpr std::size_t kLongestPacket = 1 << 20;
constexpr std::uint8_t kKinematicsPart = 5;
constexpr std::uint8_t kFromController = 0xFE;  // the source of a message: -2

Bytes packet(std::uint8_t type, const Bytes& body) {
  BigEndianWriter out;
  out.put(static_cast<std::int32_t>(kHeader + body.size())).put(type);
  Bytes bytes = out.take();
  bytes.insert(bytes.end(), body.begin(), body.end());
  return bytes;
}

// A part of a state packet has the same head, with an unsigned length.
void add_part(Bytes& body, std::uint8_t kind, const Bytes& content) {
  const Bytes part = packet(kind, content);
  body.insert(body.end(), part.begin(), part.end());
}

BigEndianWriter message_head(std::uint8_t kind, std::uint64_t time) {
  BigEndianWriter out;
  out.put(time).put(kFromController).put(kind);
  return out;
}

Bytes robot_mode_part(const State& state) {
  BigEndianWriter out;
  const bool powered = state.robot_mode >= RobotMode::kPowerOn;
  const bool stopped = state.safety_mode == SafetyMode::kRobotEmergencyStop;
  const bool protective = state.safety_mode == SafetyMode::kProtectiveStop;
  out.put(state.time).put(true).put(true).put(powered).put(stopped).put(protective);
  out.put(state.is_program_running).put(state.is_program_paused);
  out.put(static_cast<std::int8_t>(state.robot_mode)).put(std::uint8_t{0});
  out.put(state.speed_fraction).put(state.speed_fraction).put(1.0).put(std::uint8_t{0});
  return out.take();
}

Bytes joints_part(const State& state) {
  BigEndianWriter out;
  const JointMode mode = state.robot_mode == RobotMode::kRunning ? JointMode::kRunning
                         : state.robot_mode == RobotMode::kIdle  ? JointMode::kIdle
                                                                 : JointMode::kPowerOff;
  for (std::size_t j = 0; j < state.q.size(); ++j) {
    out.put(state.q[j]).put(state.q_target[j]).put(state.qd[j]);
    out.put(0.0f).put(48.0f).put(30.0f).put(30.0f).put(static_cast<std::uint8_t>(mode));
  }
  return out.take();
}

Bytes kinematics_part(const Dh& dh) {
  BigEndianWriter out;
  for (std::size_t j = 0; j < dh.rows.size(); ++j) out.put(std::uint32_t{0});  // checksums
  for (const DhRow& row : dh.rows) out.put(row.theta);
  for (const DhRow& row : dh.rows) out.put(row.a);
  for (const DhRow& row : dh.rows) out.put(row.d);
  for (const DhRow& row : dh.rows) out.put(row.alpha);
  out.put(std::uint32_t{2});  // valid
  return out.take();
}

}  // namespace

Bytes version_message(const Version& version, std::uint64_t time) {
  BigEndianWriter out = message_head(3, time);
  out.put(static_cast<std::int8_t>(version.project.size())).put(version.project);
  out.put(version.major).put(version.minor).put(version.bugfix).put(version.build).put(version.date);
  return packet(kMessageType, out.take());
}

Bytes key_message(const std::string& title, const std::string& text, std::uint64_t time) {
  BigEndianWriter out = message_head(7, time);
  out.put(std::int32_t{0}).put(std::int32_t{0}).put(static_cast<std::uint8_t>(title.size())).put(title).put(text);
  return packet(kMessageType, out.take());
}

Bytes error_message(std::int32_t code, std::int32_t argument, const std::string& text, std::uint64_t time) {
  constexpr std::int32_t kViolation = 3;
  BigEndianWriter out = message_head(6, time);
  out.put(code).put(argument).put(kViolation).put(std::uint32_t{0}).put(std::uint32_t{0}).put(text);
  return packet(kMessageType, out.take());
}

Bytes text_message(const std::string& text, std::uint64_t time) {
  BigEndianWriter out = message_head(0, time);
  out.put(text);
  return packet(kMessageType, out.take());
}

Bytes state_packet(const State& state) {
  Bytes body;
  add_part(body, 0, robot_mode_part(state));
  add_part(body, 1, joints_part(state));
  add_part(body, kKinematicsPart, kinematics_part(state.kinematics));
  return packet(kStateType, body);
}

Result<std::optional<Packet>> PacketStream::next() {
  if (waiting_.size() < kHeader) return std::optional<Packet>();
  BigEndianReader in(waiting_);
  const auto length = in.get<std::int32_t>();
  if (length < static_cast<std::int32_t>(kHeader) || length > static_cast<std::int32_t>(kLongestPacket)) {
    return Error{Code::kInvalidArgument, fmt::format("primary interface: got a packet of {} bytes, wanted {} to {}",
                                                     length, kHeader, kLongestPacket)};
  }
  const auto size = static_cast<std::size_t>(length);
  if (waiting_.size() < size) return std::optional<Packet>();
  Packet result{.type = in.get<std::uint8_t>(), .body = Bytes(waiting_.begin() + kHeader, waiting_.begin() + length)};
  waiting_.erase(waiting_.begin(), waiting_.begin() + length);
  return std::optional(std::move(result));
}

Result<std::optional<Dh>> read_kinematics(const Packet& packet) {
  if (packet.type != kStateType) return std::optional<Dh>();
  std::span<const std::uint8_t> left(packet.body);
  while (!left.empty()) {
    BigEndianReader in(left);
    const auto length = in.get<std::uint32_t>();
    const auto kind = in.get<std::uint8_t>();
    if (!in.ok() || length < kHeader || length > left.size()) {
      return Error{Code::kInvalidArgument,
                   fmt::format("state packet: got a part of {} bytes, wanted {} to {}", length, kHeader, left.size())};
    }
    BigEndianReader part(left.subspan(kHeader, length - kHeader));
    left = left.subspan(length);
    if (kind != kKinematicsPart) continue;
    (void)part.get_array<std::uint32_t, 6>();
    const auto theta = part.get_array<double, 6>();
    const auto a = part.get_array<double, 6>(), d = part.get_array<double, 6>(), alpha = part.get_array<double, 6>();
    const auto status = part.get<std::uint32_t>();
    if (!part.ok()) {
      return Error{Code::kInvalidArgument,
                   fmt::format("state packet: got a kinematics part of {} bytes, wanted 225", length)};
    }
    if (status != 2) continue;  // not valid
    Dh dh;
    for (std::size_t j = 0; j < dh.rows.size(); ++j) {
      dh.rows[j] = {.a = a[j], .d = d[j], .alpha = alpha[j], .theta = theta[j]};
      for (const double value : {a[j], d[j], alpha[j], theta[j]}) {
        if (std::isfinite(value)) continue;
        return Error{Code::kInvalidArgument,
                     fmt::format("state packet: kinematics of joint {}: got {}, wanted finite numbers", j, value)};
      }
    }
    return std::optional(dh);
  }
  return std::optional<Dh>();
}

}  // namespace jostle::robot_bridge::ur::primary
