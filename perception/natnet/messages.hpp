#pragma once
/// \file
/// NatNet: what motion capture of OptiTrack says on UDP. Messages as bytes, for either side.
///
/// Little-endian, packed, strings end with a zero. Versions 3.0, 3.1, 4.0 and 4.1; source: the description and the
/// samples that come with NaturalPoint's NatNet SDK.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "idl/types/bytes.hpp"
#include "idl/types/result.hpp"

namespace jostle::perception::natnet {

inline constexpr std::uint16_t kCommandPort = 1510, kDataPort = 1511;
inline constexpr const char* kGroup = "239.255.42.99";
inline constexpr std::size_t kLargest = 65'507;  ///< bytes of a datagram

struct Version {
  std::uint8_t major = 4, minor = 1;

  auto operator<=>(const Version&) const = default;
  bool is_known() const { return *this >= Version{3, 0} && *this <= Version{4, 1}; }
};

enum class MessageId : std::uint16_t {
  kConnect = 0,
  kServerInfo = 1,
  kRequest = 2,
  kResponse = 3,
  kModelRequest = 4,
  kModels = 5,
  kFrame = 7,
  kText = 8,
  kDisconnect = 9,
  kKeepAlive = 10,
  kTimedOut = 11,
  kEcho = 12,
  kEchoReply = 13,
  kDiscovery = 14,
  kUnrecognised = 100
};

struct Message {
  MessageId id = MessageId::kKeepAlive;
  Bytes payload;

  bool operator==(const Message&) const = default;
};

/// Returns a datagram: id, size, payload. The payload has at most 65,503 bytes.
Bytes encode(const Message& message);
/// Error kInvalidArgument: shorter than its head, or than its head says. What comes after is left out, as some
/// programs pad their messages.
Result<Message> decode(std::span<const std::uint8_t> datagram);

/// Who answers a connect, and where its frames go.
struct ServerInfo {
  std::string name;
  std::array<std::uint8_t, 4> app_version{}, natnet_version{};
  std::uint64_t clock_hz = 0;  ///< of its ticks
  std::uint16_t data_port = kDataPort;
  bool multicast = false;
  std::array<std::uint8_t, 4> group{};

  Version version() const { return {natnet_version[0], natnet_version[1]}; }
  bool operator==(const ServerInfo&) const = default;
};
Bytes encode(const ServerInfo& info);
Result<ServerInfo> decode_server_info(std::span<const std::uint8_t> payload);

/// A rigid body in a frame.
struct Body {
  std::int32_t id = 0;
  std::array<float, 3> position{};               ///< m
  std::array<float, 4> orientation{1, 0, 0, 0};  ///< unit quaternion w, x, y, z; on the wire x, y, z, w
  float mean_error = 0.0F;                       ///< m, of its markers
  bool tracked = true;                           ///< else it is occluded, and its pose old or zero

  bool operator==(const Body&) const = default;
};

struct LabelledMarker {
  std::int32_t id = 0;  ///< asset << 16 | member
  std::array<float, 3> position{};
  float size = 0.0F;
  std::int16_t flags = 0;
  float residual = 0.0F;

  bool operator==(const LabelledMarker&) const = default;
};

/// What was seen at one moment. Other parts of a frame (marker sets, skeletons, assets, force plates, devices) are
/// passed over.
struct Frame {
  std::int32_t number = 0;
  std::vector<Body> bodies;
  std::vector<LabelledMarker> markers;
  double timestamp = 0.0;                ///< s since the server's start
  std::uint64_t mid_exposure = 0;        ///< ticks of the server's clock; when it was so
  std::uint64_t received = 0, sent = 0;  ///< ticks
  bool models_changed = false;           ///< names and ids are to be asked for again

  bool operator==(const Frame&) const = default;
};
Bytes encode(const Frame& frame, Version version);
/// Errors   kInvalidArgument  shorter than it must be, a count beyond its bytes, a pose that is not finite; says of
/// what
Result<Frame> decode_frame(std::span<const std::uint8_t> payload, Version version);

/// A rigid body's name.
struct Model {
  std::int32_t id = 0;
  std::string name;

  bool operator==(const Model&) const = default;
};
Bytes encode(const std::vector<Model>& models, Version version);
/// Returns the rigid bodies. Before 4.1 what follows a model of an unknown kind cannot be read, and is left out.
/// Errors   kInvalidArgument, as above
Result<std::vector<Model>> decode_models(std::span<const std::uint8_t> payload, Version version);

/// Returns the version that a request "Bitstream,4.1" asks for; nothing if it is another request.
std::optional<Version> requested_bitstream(std::span<const std::uint8_t> payload);

}  // namespace jostle::perception::natnet
