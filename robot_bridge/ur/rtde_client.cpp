#include "robot_bridge/ur/rtde_client.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <utility>

namespace jostle::robot_bridge::ur {
namespace {

using rtde::Packet;
using rtde::PacketType;
using TimePoint = net::Clock::time_point;

std::string register_name(const char* direction_and_kind, int index) {
  return fmt::format("{}_register_{}", direction_and_kind, index);
}

// In the order of decode().
std::vector<std::string> output_names() {
  return {"timestamp",
          "actual_q",
          "actual_qd",
          "target_q",
          "robot_mode",
          "safety_mode",
          "runtime_state",
          "speed_scaling",
          register_name("output_int", contract::kBase),
          register_name("output_int", contract::kBase + 1)};
}

// In the order of send().
std::vector<std::string> input_names() {
  std::vector<std::string> names{register_name("input_int", contract::kBase),
                                 register_name("input_int", contract::kBase + 1)};
  for (int i = 0; i < 7; ++i) names.push_back(register_name("input_double", contract::kBase + i));
  return names;
}

}  // namespace

Result<RtdeClient> RtdeClient::connect(const std::string& host, std::uint16_t port, double frequency,
                                       TimePoint deadline) {
  auto tcp_result = net::TcpClient::connect(host, port, deadline);
  if (!tcp_result) return tcp_result.error();
  RtdeClient client(std::move(tcp_result).value());
  if (auto ok = client.agree(frequency, deadline); !ok) {
    return Error{ok.error().code, fmt::format("RTDE at {}: {}", client.tcp_.place(), ok.error().message)};
  }
  return client;
}

Result<Packet> RtdeClient::answer(const Packet& request, TimePoint deadline) {
  if (auto ok = tcp_.write(rtde::encode(request), deadline); !ok) return ok.error();
  std::array<std::uint8_t, 4096> room;
  for (;;) {
    for (;;) {
      auto packet_result = stream_.next();
      if (!packet_result) return packet_result.error();
      if (!*packet_result) break;
      Packet packet = std::move(**packet_result);
      if (packet.type == request.type) return packet;
      if (packet.type != PacketType::kText) continue;  // samples may come in between
      const auto text_result = rtde::read_text(packet, protocol_);
      if (text_result && text_result->level <= rtde::Text::Level::kError) {
        return Error{Code::kInvalidArgument, text_result->text};
      }
    }
    auto bytes_result = tcp_.read(room, deadline);
    if (!bytes_result) return bytes_result.error();
    stream_.append(*bytes_result);
  }
}

Result<void> RtdeClient::agree(double frequency, TimePoint deadline) {
  const auto accepted = [&](const Packet& request) -> Result<bool> {
    auto packet_result = answer(request, deadline);
    if (!packet_result) return packet_result.error();
    return rtde::read_accepted(*packet_result);
  };
  const auto refused = [](const char* what) {
    return Error{Code::kInvalidArgument, fmt::format("the controller refused {}", what)};
  };
  const auto recipe = [&](const Packet& request, const std::vector<std::string>& names) -> Result<rtde::Recipe> {
    auto packet_result = answer(request, deadline);
    if (!packet_result) return packet_result.error();
    const auto reply_result = rtde::read_recipe_reply(*packet_result, protocol_);
    if (!reply_result) return reply_result.error();
    return rtde::agree(names, *reply_result);
  };
  auto agreed = accepted(rtde::protocol_request(2));
  if (agreed && *agreed) {
    protocol_ = rtde::Version::k2;
  } else if (agreed) {
    agreed = accepted(rtde::protocol_request(1));
  }
  if (!agreed) return agreed.error();
  if (!*agreed) return refused("versions 2 and 1 of the protocol");
  auto version_packet = answer(rtde::version_request(), deadline);
  if (!version_packet) return version_packet.error();
  auto version_result = rtde::read_version(*version_packet);
  if (!version_result) return version_result.error();
  version_ = *version_result;
  auto outputs_result =
      recipe(rtde::outputs_request(frequency > 0 ? frequency : std::round(1.0 / cycle()), output_names(), protocol_),
             output_names());
  if (!outputs_result) return outputs_result.error();
  outputs_ = std::move(outputs_result).value();
  auto inputs_result = recipe(rtde::inputs_request(input_names()), input_names());
  if (!inputs_result) return inputs_result.error();
  inputs_ = std::move(inputs_result).value();
  const auto started = accepted(rtde::start_request());
  if (!started) return started.error();
  if (!*started) return refused("to start");
  return {};
}

Result<ArmState> RtdeClient::decode(const Packet& packet) const {
  BigEndianReader in(packet.payload);
  const auto id = protocol_ == rtde::Version::k2 ? in.get<std::uint8_t>() : outputs_.id;
  if (id != outputs_.id || in.left() != outputs_.size()) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got a sample of recipe {} with {} bytes, wanted {} with {}",
                                                     tcp_.place(), id, in.left(), outputs_.id, outputs_.size())};
  }
  ArmState state;
  state.timestamp = in.get<double>();
  state.q = in.get_array<double, 6>();
  state.qd = in.get_array<double, 6>();
  state.q_target = in.get_array<double, 6>();
  state.robot_mode = static_cast<RobotMode>(in.get<std::int32_t>());
  state.safety_mode = static_cast<SafetyMode>(in.get<std::int32_t>());
  state.runtime_state = static_cast<RuntimeState>(in.get<std::uint32_t>());
  state.speed_scaling = in.get<double>();
  state.program_state = in.get<std::int32_t>();
  state.obeyed = in.get<std::int32_t>();
  state.received = net::Clock::now();
  for (std::size_t j = 0; j < state.q.size(); ++j) {
    if (!std::isfinite(state.q[j]) || !std::isfinite(state.qd[j])) {
      return Error{Code::kInvalidArgument, fmt::format("{}: got {} rad and {} rad/s of joint {}, wanted finite numbers",
                                                       tcp_.place(), state.q[j], state.qd[j], j)};
    }
  }
  return state;
}

Result<ArmState> RtdeClient::next(TimePoint deadline) {
  std::array<std::uint8_t, 4096> room;
  std::optional<Packet> newest;
  for (;;) {
    auto packet_result = stream_.next();
    if (!packet_result) return packet_result.error();
    if (*packet_result) {
      if ((*packet_result)->type != PacketType::kData) continue;
      if (newest) ++skipped_;
      newest = std::move(**packet_result);
      continue;
    }
    // Nothing whole is left here; more may have come while this thread did something else.
    auto bytes_result = tcp_.read(room, newest ? net::Clock::now() : deadline);
    if (bytes_result) {
      stream_.append(*bytes_result);
    } else if (newest && bytes_result.error().code == Code::kDeadline) {
      return decode(*newest);
    } else {
      return bytes_result.error();
    }
  }
}

Result<void> RtdeClient::send(const ArmCommand& command, TimePoint deadline) {
  values_.clear();
  values_.emplace_back(static_cast<std::int32_t>(command.command));
  values_.emplace_back(command.number);
  for (const double value : command.values) values_.emplace_back(value);
  values_.emplace_back(command.acceleration);
  return tcp_.write(rtde::encode(rtde::pack(inputs_, values_, protocol_)), deadline);
}

}  // namespace jostle::robot_bridge::ur
