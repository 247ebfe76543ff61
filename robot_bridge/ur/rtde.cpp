#include "robot_bridge/ur/rtde.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "idl/types/number.hpp"

namespace jostle::robot_bridge::ur::rtde {
namespace {

constexpr std::size_t kHeader = 3;  // bytes: size and type

// In the order of FieldType.
struct TypeRow {
  const char* name;
  std::size_t size;
};
constexpr std::array<TypeRow, 10> kTypes{{{"BOOL", 1},
                                          {"UINT8", 1},
                                          {"INT32", 4},
                                          {"UINT32", 4},
                                          {"UINT64", 8},
                                          {"DOUBLE", 8},
                                          {"VECTOR3D", 24},
                                          {"VECTOR6D", 48},
                                          {"VECTOR6INT32", 24},
                                          {"VECTOR6UINT32", 24}}};

const TypeRow& row(FieldType type) { return kTypes[static_cast<std::size_t>(type)]; }

using FieldRow = std::pair<std::string_view, FieldType>;
using enum FieldType;

// Registers aside. Source: the maker's guide to RTDE.
constexpr FieldRow kOutputFields[] = {
    {"timestamp", kDouble},
    {"actual_execution_time", kDouble},
    {"target_q", kVector6d},
    {"target_qd", kVector6d},
    {"target_qdd", kVector6d},
    {"target_current", kVector6d},
    {"target_moment", kVector6d},
    {"actual_q", kVector6d},
    {"actual_qd", kVector6d},
    {"actual_current", kVector6d},
    {"actual_current_window", kVector6d},
    {"joint_control_output", kVector6d},
    {"joint_temperatures", kVector6d},
    {"actual_joint_voltage", kVector6d},
    {"joint_mode", kVector6Int32},
    {"actual_TCP_pose", kVector6d},
    {"actual_TCP_speed", kVector6d},
    {"actual_TCP_force", kVector6d},
    {"target_TCP_pose", kVector6d},
    {"target_TCP_speed", kVector6d},
    {"tcp_offset", kVector6d},
    {"ft_raw_wrench", kVector6d},
    {"tcp_force_scalar", kDouble},
    {"robot_mode", kInt32},
    {"safety_mode", kInt32},
    {"safety_status", kInt32},
    {"runtime_state", kUint32},
    {"robot_status_bits", kUint32},
    {"safety_status_bits", kUint32},
    {"script_control_line", kUint32},
    {"speed_scaling", kDouble},
    {"target_speed_fraction", kDouble},
    {"actual_digital_input_bits", kUint64},
    {"actual_digital_output_bits", kUint64},
    {"analog_io_types", kUint32},
    {"standard_analog_input0", kDouble},
    {"standard_analog_input1", kDouble},
    {"standard_analog_output0", kDouble},
    {"standard_analog_output1", kDouble},
    {"io_current", kDouble},
    {"tool_mode", kUint32},
    {"tool_analog_input_types", kUint32},
    {"tool_analog_input0", kDouble},
    {"tool_analog_input1", kDouble},
    {"tool_output_voltage", kInt32},
    {"tool_output_current", kDouble},
    {"tool_temperature", kDouble},
    {"tool_output_mode", kUint8},
    {"tool_digital_output0_mode", kUint8},
    {"tool_digital_output1_mode", kUint8},
    {"actual_momentum", kDouble},
    {"actual_main_voltage", kDouble},
    {"actual_robot_voltage", kDouble},
    {"actual_robot_current", kDouble},
    {"actual_tool_accelerometer", kVector3d},
    {"elbow_position", kVector3d},
    {"elbow_velocity", kVector3d},
    {"payload_cog", kVector3d},
    {"payload", kDouble},
    {"payload_inertia", kVector6d},
    {"joint_position_deviation_ratio", kDouble},
};

constexpr FieldRow kInputFields[] = {
    {"speed_slider_mask", kUint32},
    {"speed_slider_fraction", kDouble},
    {"standard_digital_output_mask", kUint8},
    {"standard_digital_output", kUint8},
    {"configurable_digital_output_mask", kUint8},
    {"configurable_digital_output", kUint8},
    {"tool_digital_output_mask", kUint8},
    {"tool_digital_output", kUint8},
    {"standard_analog_output_mask", kUint8},
    {"standard_analog_output_type", kUint8},
    {"standard_analog_output_0", kDouble},
    {"standard_analog_output_1", kDouble},
    {"external_force_torque", kVector6d},
};

// "input_int_register_7" and the like, behind "input_" or "output_".
std::optional<FieldType> register_field(std::string_view name) {
  if (name == "bit_registers0_to_31" || name == "bit_registers32_to_63") return kUint32;
  struct Family {
    std::string_view prefix;
    int first, last;
    FieldType type;
  };
  constexpr Family kFamilies[] = {
      {"bit_register_", 64, 127, kBool}, {"int_register_", 0, 47, kInt32}, {"double_register_", 0, 47, kDouble}};
  for (const Family& family : kFamilies) {
    if (!name.starts_with(family.prefix)) continue;
    const std::string_view digits = name.substr(family.prefix.size());
    if (digits.size() > 1 && digits.front() == '0') return {};
    if (parse_whole(digits, family.first, family.last)) return family.type;
  }
  return {};
}

std::optional<FieldType> find_field(std::span<const FieldRow> rows, std::string_view registers, std::string_view name) {
  const auto found = std::ranges::find(rows, name, &FieldRow::first);
  if (found != rows.end()) return found->second;
  if (name.starts_with(registers)) return register_field(name.substr(registers.size()));
  return {};
}

// Some clients end their list with a comma: empty names are none.
std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> words;
  std::size_t begin = 0;
  while (begin <= list.size()) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    if (end > begin) words.push_back(list.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

Error wrong(const Packet& packet, const std::string& wanted) {
  return invalid(fmt::format("rtde {}", static_cast<char>(packet.type)), fmt::format("{} bytes", packet.payload.size()),
                 wanted);
}

Packet with_text(PacketType type, const std::vector<std::string>& names, BigEndianWriter before = {}) {
  before.put(std::string_view(fmt::format("{}", fmt::join(names, ","))));
  return {.type = type, .payload = before.take()};
}

Value read_value(FieldType type, BigEndianReader& in) {
  switch (type) {
    case kBool:
      return in.get<bool>();
    case kUint8:
      return in.get<std::uint8_t>();
    case kInt32:
      return in.get<std::int32_t>();
    case kUint32:
      return in.get<std::uint32_t>();
    case kUint64:
      return in.get<std::uint64_t>();
    case kDouble:
      return in.get<double>();
    case kVector3d:
      return in.get_array<double, 3>();
    case kVector6d:
      return in.get_array<double, 6>();
    case kVector6Int32:
      return in.get_array<std::int32_t, 6>();
    case kVector6Uint32:
      return in.get_array<std::uint32_t, 6>();
  }
  return {};
}

}  // namespace

Bytes encode(const Packet& packet) {
  BigEndianWriter out;
  out.put(static_cast<std::uint16_t>(kHeader + packet.payload.size())).put(static_cast<std::uint8_t>(packet.type));
  Bytes bytes = out.take();
  bytes.insert(bytes.end(), packet.payload.begin(), packet.payload.end());
  return bytes;
}

Result<std::optional<Packet>> PacketStream::next() {
  if (waiting_.size() < kHeader) return std::optional<Packet>{};
  BigEndianReader in(waiting_);
  const std::size_t size = in.get<std::uint16_t>();
  if (size < kHeader) return invalid("rtde packet", fmt::format("a size of {} bytes", size), "at least 3");
  if (waiting_.size() < size) return std::optional<Packet>{};
  const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(size);
  Packet packet{.type = static_cast<PacketType>(in.get<std::uint8_t>()),
                .payload = {waiting_.begin() + static_cast<std::ptrdiff_t>(kHeader), end}};
  waiting_.erase(waiting_.begin(), end);
  return std::optional(std::move(packet));
}

const char* name_of(FieldType type) { return row(type).name; }

std::size_t size_of(FieldType type) { return row(type).size; }

std::optional<FieldType> parse_field_type(std::string_view name) {
  const auto found = std::ranges::find(kTypes, name, [](const TypeRow& type) { return std::string_view(type.name); });
  if (found == kTypes.end()) return {};
  return static_cast<FieldType>(found - kTypes.begin());
}

Value zero_of(FieldType type) {
  BigEndianReader nothing({});  // reads as 0
  return read_value(type, nothing);
}

std::optional<FieldType> output_field(std::string_view name) {
  if (const auto type = find_field(kOutputFields, "output_", name)) return type;
  return name.starts_with("input_") ? input_field(name) : std::nullopt;  // inputs can be read back
}

std::optional<FieldType> input_field(std::string_view name) { return find_field(kInputFields, "input_", name); }

std::size_t Recipe::size() const {
  std::size_t bytes = 0;
  for (const FieldType type : types) bytes += size_of(type);
  return bytes;
}

std::optional<std::size_t> Recipe::offset(std::string_view name) const {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == name) return bytes;
    bytes += size_of(types[i]);
  }
  return {};
}

Packet pack(const Recipe& recipe, const std::vector<Value>& values, Version version) {
  BigEndianWriter out;
  if (version == Version::k2) out.put(recipe.id);
  for (const Value& value : values) std::visit([&](const auto& v) { out.put(v); }, value);
  return {.type = PacketType::kData, .payload = out.take()};
}

Result<std::vector<Value>> unpack(const Recipe& recipe, const Packet& packet, Version version) {
  BigEndianReader in(packet.payload);
  if (version == Version::k2) {
    const auto id = in.get<std::uint8_t>();
    if (id != recipe.id) return invalid("rtde U", fmt::format("recipe {}", id), std::to_string(recipe.id));
  }
  if (in.left() != recipe.size()) return wrong(packet, fmt::format("a recipe of {} bytes", recipe.size()));
  std::vector<Value> values;
  for (const FieldType type : recipe.types) values.push_back(read_value(type, in));
  return values;
}

Packet protocol_request(std::uint16_t version) {
  return {.type = PacketType::kProtocolVersion, .payload = BigEndianWriter().put(version).take()};
}

Packet version_request() { return {.type = PacketType::kControllerVersion, .payload = {}}; }

Packet outputs_request(double frequency, const std::vector<std::string>& names, Version version) {
  BigEndianWriter before;
  if (version == Version::k2) before.put(frequency);
  return with_text(PacketType::kOutputs, names, std::move(before));
}

Packet inputs_request(const std::vector<std::string>& names) { return with_text(PacketType::kInputs, names); }

Packet start_request() { return {.type = PacketType::kStart, .payload = {}}; }

Packet pause_request() { return {.type = PacketType::kPause, .payload = {}}; }

Packet accepted_reply(PacketType of, bool accepted) {
  return {.type = of, .payload = BigEndianWriter().put(accepted).take()};
}

Packet version_reply(const ControllerVersion& version) {
  BigEndianWriter out;
  out.put(version.major).put(version.minor).put(version.bugfix).put(version.build);
  return {.type = PacketType::kControllerVersion, .payload = out.take()};
}

Packet recipe_reply(PacketType of, const RecipeReply& reply, Version version) {
  BigEndianWriter before;
  if (version == Version::k2) before.put(reply.id);
  return with_text(of, reply.types, std::move(before));
}

Packet text_packet(const Text& text, Version version) {
  constexpr std::size_t kLongest = 255;
  BigEndianWriter out;
  if (version == Version::k1) {
    out.put(static_cast<std::uint8_t>(text.level)).put(std::string_view(text.text).substr(0, kLongest));
    return {.type = PacketType::kText, .payload = out.take()};
  }
  for (const std::string& part : {text.text, text.source}) {
    const std::string_view shown = std::string_view(part).substr(0, kLongest);
    out.put(static_cast<std::uint8_t>(shown.size())).put(shown);
  }
  out.put(static_cast<std::uint8_t>(text.level));
  return {.type = PacketType::kText, .payload = out.take()};
}

Result<std::uint16_t> read_protocol_request(const Packet& packet) {
  BigEndianReader in(packet.payload);
  const auto version = in.get<std::uint16_t>();
  if (!in.done()) return wrong(packet, "2");
  return version;
}

Result<OutputsRequest> read_outputs_request(const Packet& packet, Version version) {
  BigEndianReader in(packet.payload);
  if (version == Version::k1) return OutputsRequest{.frequency = kRateOfVersion1, .names = split(in.get_rest())};
  OutputsRequest request{.frequency = in.get<double>(), .names = split(in.get_rest())};
  if (!in.ok()) return wrong(packet, "a frequency of 8 bytes, then names");
  if (!(request.frequency > 0 && request.frequency <= 1000)) {  // not NaN
    return invalid("rtde O: frequency", fmt::format("{}", request.frequency), "more than 0, at most 1000 Hz");
  }
  return request;
}

Result<std::vector<std::string>> read_inputs_request(const Packet& packet) {
  return split(BigEndianReader(packet.payload).get_rest());
}

Result<bool> read_accepted(const Packet& packet) {
  BigEndianReader in(packet.payload);
  const bool accepted = in.get<bool>();
  if (!in.done()) return wrong(packet, "1");
  return accepted;
}

Result<ControllerVersion> read_version(const Packet& packet) {
  BigEndianReader in(packet.payload);
  ControllerVersion version;
  version.major = in.get<std::uint32_t>();
  version.minor = in.get<std::uint32_t>();
  version.bugfix = in.get<std::uint32_t>();
  version.build = in.get<std::uint32_t>();
  if (!in.done()) return wrong(packet, "16");
  return version;
}

Result<RecipeReply> read_recipe_reply(const Packet& packet, Version version) {
  BigEndianReader in(packet.payload);
  if (version == Version::k1) {
    RecipeReply reply{.id = 0, .types = split(in.get_rest())};
    const auto is_type = [](const std::string& name) { return parse_field_type(name).has_value(); };
    if (!reply.types.empty() && std::ranges::all_of(reply.types, is_type)) reply.id = 1;
    return reply;
  }
  RecipeReply reply{.id = in.get<std::uint8_t>(), .types = split(in.get_rest())};
  if (!in.ok()) return wrong(packet, "a recipe id of 1 byte, then types");
  return reply;
}

Result<Text> read_text(const Packet& packet, Version version) {
  BigEndianReader in(packet.payload);
  Text text;
  std::uint8_t level = 0;
  if (version == Version::k1) {
    level = in.get<std::uint8_t>();
    text.text = in.get_rest();
  } else {
    text.text = in.get_text(in.get<std::uint8_t>());
    text.source = in.get_text(in.get<std::uint8_t>());
    level = in.get<std::uint8_t>();
  }
  if (!in.done() || level > static_cast<std::uint8_t>(Text::Level::kInfo)) {
    return wrong(packet, version == Version::k1 ? "a level of 0 to 3, and a text"
                                                : "a text and a source, each behind its length, and a level of 0 to 3");
  }
  text.level = static_cast<Text::Level>(level);
  return text;
}

Result<Recipe> agree(const std::vector<std::string>& names, const RecipeReply& reply) {
  if (reply.types.size() != names.size()) {
    return invalid("rtde recipe", fmt::format("{} types", reply.types.size()), fmt::format("{}", names.size()));
  }
  Recipe recipe{.id = reply.id, .names = names, .types = {}};
  std::vector<std::string> unknown, taken;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (const auto type = parse_field_type(reply.types[i])) {
      recipe.types.push_back(*type);
    } else {
      (reply.types[i] == "IN_USE" ? taken : unknown).push_back(names[i]);
    }
  }
  if (!unknown.empty()) {
    return invalid("rtde recipe", fmt::format("no field {}", fmt::join(unknown, ", ")),
                   "fields that this controller has; is its software older than these fields?");
  }
  if (!taken.empty()) {
    return invalid("rtde recipe", fmt::format("{} in use by another client", fmt::join(taken, ", ")),
                   "inputs that nobody else writes: end that client, or use other registers");
  }
  if (recipe.id == 0) return invalid("rtde recipe", "a refusal", "an id from 1 to 255");
  return recipe;
}

}  // namespace jostle::robot_bridge::ur::rtde
