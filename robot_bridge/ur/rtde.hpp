#pragma once
/// \file
/// RTDE, the real-time data exchange of Universal Robots controllers (TCP port 30004): its packets, fields and
/// recipes, for either side. No sockets here.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "idl/types/bytes.hpp"
#include "idl/types/result.hpp"

namespace jostle::robot_bridge::ur::rtde {

inline constexpr std::uint16_t kPort = 30004;

/// The two versions of the protocol. A connection is in the first until both sides have agreed on the second: there
/// recipes have no number, so that there is one of each direction; outputs come as often as they may; a text has no
/// source.
enum class Version : std::uint16_t { k1 = 1, k2 = 2 };
inline constexpr double kRateOfVersion1 = 125.0;  ///< samples/s

enum class PacketType : std::uint8_t {
  kProtocolVersion = 'V',
  kControllerVersion = 'v',
  kText = 'M',
  kOutputs = 'O',
  kInputs = 'I',
  kStart = 'S',
  kPause = 'P',
  kData = 'U'
};

struct Packet {
  PacketType type = PacketType::kText;
  Bytes payload;

  bool operator==(const Packet&) const = default;
};

/// Returns the bytes of a packet: size, including its own two bytes, type, payload. The payload has at most 65,532
/// bytes.
Bytes encode(const Packet& packet);

/// A PacketStream cuts a TCP stream into packets, however the network merged or split them.
class PacketStream {
 public:
  void append(std::span<const std::uint8_t> bytes) { waiting_.insert(waiting_.end(), bytes.begin(), bytes.end()); }

  /// Returns the next whole packet; nothing while its end is missing.
  /// Error kInvalidArgument: a size below 3, after which the stream has no meaning.
  Result<std::optional<Packet>> next();

 private:
  Bytes waiting_;
};

/// What a field is made of.
enum class FieldType {
  kBool,
  kUint8,
  kInt32,
  kUint32,
  kUint64,
  kDouble,
  kVector3d,
  kVector6d,
  kVector6Int32,
  kVector6Uint32
};

using Value =
    std::variant<bool, std::uint8_t, std::int32_t, std::uint32_t, std::uint64_t, double, std::array<double, 3>,
                 std::array<double, 6>, std::array<std::int32_t, 6>, std::array<std::uint32_t, 6>>;

/// Returns "VECTOR6D" and the like, as it stands on the wire.
const char* name_of(FieldType type);
/// Returns the number of bytes on the wire.
std::size_t size_of(FieldType type);
std::optional<FieldType> parse_field_type(std::string_view name);
/// Returns a value of that type, all of it 0.
Value zero_of(FieldType type);

/// Returns the type of a field that controllers give out, or take, by its name: "actual_q",
/// "input_double_register_24". Nothing if there is no such field.
std::optional<FieldType> output_field(std::string_view name);
std::optional<FieldType> input_field(std::string_view name);

/// A Recipe is the list of fields that a data packet carries, one after the other.
struct Recipe {
  std::uint8_t id = 0;  ///< 0: none, refused; of version 1, which has none: 1
  std::vector<std::string> names;
  std::vector<FieldType> types;

  std::size_t size() const;  ///< bytes of its fields
  /// Returns where a field begins in a payload whose recipe id was taken off; nothing if it is not part of it.
  std::optional<std::size_t> offset(std::string_view name) const;
};

/// Returns the data packet of a recipe. `values`: one per field, of its type.
Packet pack(const Recipe& recipe, const std::vector<Value>& values, Version version = Version::k2);
/// Returns the values of a data packet.
/// Error kInvalidArgument naming the id or the size that do not fit the recipe.
Result<std::vector<Value>> unpack(const Recipe& recipe, const Packet& packet, Version version = Version::k2);

/// A text that either side sends. In version 1 without its source.
struct Text {
  enum class Level : std::uint8_t { kException = 0, kError = 1, kWarning = 2, kInfo = 3 };
  Level level = Level::kInfo;
  std::string text, source;

  bool operator==(const Text&) const = default;
};

struct ControllerVersion {
  std::uint32_t major = 0, minor = 0, bugfix = 0, build = 0;

  bool operator==(const ControllerVersion&) const = default;
};

/// What a controller answers to a list of fields: types, or NOT_FOUND and IN_USE, with which the recipe is refused: its
/// id is 0 then. In version 1 the types alone say so; an id is made of them.
struct RecipeReply {
  std::uint8_t id = 0;
  std::vector<std::string> types;

  bool operator==(const RecipeReply&) const = default;
};

/// Client to controller.
Packet protocol_request(std::uint16_t version);
Packet version_request();
/// frequency: 1/s; version 1 does not say it.
Packet outputs_request(double frequency, const std::vector<std::string>& names, Version version = Version::k2);
Packet inputs_request(const std::vector<std::string>& names);
Packet start_request();
Packet pause_request();
/// Controller to client.
Packet accepted_reply(PacketType of, bool accepted);  ///< of V, S and P
Packet version_reply(const ControllerVersion& version);
Packet recipe_reply(PacketType of, const RecipeReply& reply, Version version = Version::k2);  ///< of O and I
/// Either way.
Packet text_packet(const Text& text, Version version = Version::k2);

/// Readers of the same. Errors kInvalidArgument: "rtde V: got 3 bytes, wanted 2".
Result<std::uint16_t> read_protocol_request(const Packet& packet);
struct OutputsRequest {
  double frequency = 0.0;  ///< 1/s
  std::vector<std::string> names;
};
Result<OutputsRequest> read_outputs_request(const Packet& packet, Version version = Version::k2);
Result<std::vector<std::string>> read_inputs_request(const Packet& packet);
Result<bool> read_accepted(const Packet& packet);
Result<ControllerVersion> read_version(const Packet& packet);
Result<RecipeReply> read_recipe_reply(const Packet& packet, Version version = Version::k2);
Result<Text> read_text(const Packet& packet, Version version = Version::k2);

/// Makes a client's recipe of a reply to these names.
/// Error kInvalidArgument naming every field that is not known, or in use by another client.
Result<Recipe> agree(const std::vector<std::string>& names, const RecipeReply& reply);

}  // namespace jostle::robot_bridge::ur::rtde
