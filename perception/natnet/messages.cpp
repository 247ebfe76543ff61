#include "perception/natnet/messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>

namespace jostle::perception::natnet {
namespace {

constexpr std::size_t kHead = 4;    // bytes: id, size of the payload
constexpr std::size_t kName = 256;  // bytes of a server's name, the ending zero included
constexpr Version kSized{4, 1};     // from here on sections say their bytes
constexpr Version kMarkerNames{4, 0};

enum ModelKind : std::int32_t { kMarkerSet = 0, kRigidBody = 1, kSkeleton = 2, kCamera = 5 };
constexpr std::int16_t kTracked = 1, kModelsChanged = 2;  // flags of a body, of a frame

using Reader = LittleEndianReader;
using Writer = LittleEndianWriter;

Error bad(const char* what, const std::string& got, const std::string& wanted) {
  return {Code::kInvalidArgument, fmt::format("natnet {}: got {}, wanted {}", what, got, wanted)};
}

Error cut(const char* what) { return bad(what, "too few bytes", "all of it"); }

// A text up to its zero.
std::string text(Reader& in) {
  std::string result;
  while (in.ok()) {
    const char next = static_cast<char>(in.get<std::uint8_t>());
    if (next == '\0') break;
    result.push_back(next);
  }
  return result;
}

// Reads `count` items of at least `least` bytes each; stops where there are too few for them.
bool each(Reader& in, std::int32_t count, std::size_t least, const std::function<void()>& read) {
  if (count < 0 || static_cast<std::size_t>(count) > in.left() / least) return false;
  for (std::int32_t i = 0; i < count && in.ok(); ++i) read();
  return in.ok();
}

// A section: count, from 4.1 on its bytes, items. `item` reads one of at least `least` bytes.
bool section(Reader& in, Version version, std::size_t least, const std::function<void(Reader&)>& item) {
  const auto count = in.get<std::int32_t>();
  if (version < kSized) return each(in, count, least, [&] { item(in); });
  const auto size = in.get<std::int32_t>();
  if (!in.ok() || size < 0 || static_cast<std::size_t>(size) > in.left()) return false;
  Reader inner = in.part(static_cast<std::size_t>(size));
  return each(inner, count, least, [&] { item(inner); });
}

constexpr std::size_t kPoint = 12, kBody = 4 + 12 + 16 + 4 + 2, kMarker = 4 + 12 + 4 + 2 + 4;

void pass_point_set(Reader& in) {
  (void)text(in);
  (void)each(in, in.get<std::int32_t>(), kPoint, [&] { in.skip(kPoint); });
}

Body body(Reader& in) {
  Body body;
  body.id = in.get<std::int32_t>();
  body.position = in.get_array<float, 3>();
  const auto xyzw = in.get_array<float, 4>();
  body.orientation = {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
  body.mean_error = in.get<float>();
  body.tracked = (in.get<std::int16_t>() & kTracked) != 0;
  return body;
}

LabelledMarker marker(Reader& in) {
  LabelledMarker marker;
  marker.id = in.get<std::int32_t>();
  marker.position = in.get_array<float, 3>();
  marker.size = in.get<float>();
  marker.flags = in.get<std::int16_t>();
  marker.residual = in.get<float>();
  return marker;
}

void pass_channels(Reader& in) {
  (void)in.get<std::int32_t>();
  (void)each(in, in.get<std::int32_t>(), 4,
             [&] { (void)each(in, in.get<std::int32_t>(), 4, [&] { (void)in.get<float>(); }); });
}

// Poses of what is seen are numbers; of what is not, they may be anything.
bool is_pose(const Body& body) {
  const auto finite = [](float value) { return std::isfinite(value); };
  return !body.tracked || (std::ranges::all_of(body.position, finite) && std::ranges::all_of(body.orientation, finite));
}

// Appends a section whose items are written already.
void put_section(Writer& out, Version version, std::size_t count, const Bytes& items) {
  out.put(static_cast<std::int32_t>(count));
  if (version >= kSized) out.put(static_cast<std::int32_t>(items.size()));
  out.put(std::span(items));
}

void put_text(Writer& out, const std::string& text) { out.put(std::string_view(text)).put(std::uint8_t{0}); }

}  // namespace

Bytes encode(const Message& message) {
  Writer out;
  out.put(static_cast<std::uint16_t>(message.id)).put(static_cast<std::uint16_t>(message.payload.size()));
  out.put(std::span(message.payload));
  return out.take();
}

Result<Message> decode(std::span<const std::uint8_t> datagram) {
  Reader in(datagram);
  const auto id = in.get<std::uint16_t>(), size = in.get<std::uint16_t>();
  if (!in.ok() || in.left() < size) {
    return bad("message", fmt::format("{} bytes", datagram.size()), fmt::format("{}", kHead + size));
  }
  const auto payload = datagram.subspan(kHead, size);
  return Message{.id = static_cast<MessageId>(id), .payload = {payload.begin(), payload.end()}};
}

Bytes encode(const ServerInfo& info) {
  Writer out;
  std::string name = info.name.substr(0, kName - 1);
  name.resize(kName, '\0');
  out.put(std::string_view(name)).put(info.app_version).put(info.natnet_version).put(info.clock_hz).put(info.data_port);
  out.put(info.multicast).put(info.group);
  return out.take();
}

Result<ServerInfo> decode_server_info(std::span<const std::uint8_t> payload) {
  Reader in(payload);
  ServerInfo info;
  info.name = in.get_text(kName);
  info.name.resize(std::min(info.name.find('\0'), info.name.size()));
  info.app_version = in.get_array<std::uint8_t, 4>();
  info.natnet_version = in.get_array<std::uint8_t, 4>();
  info.clock_hz = in.get<std::uint64_t>();
  info.data_port = in.get<std::uint16_t>();
  info.multicast = in.get<bool>();
  info.group = in.get_array<std::uint8_t, 4>();
  if (!in.ok()) return bad("server info", fmt::format("{} bytes", payload.size()), "279");
  if (info.clock_hz == 0) return bad("server info", "a clock of 0 Hz", "ticks per second");
  return info;
}

Bytes encode(const Frame& frame, Version version) {
  Writer out;
  const auto put_empty = [&] { put_section(out, version, 0, {}); };
  out.put(frame.number);
  put_empty();  // marker sets
  put_empty();  // other markers
  Writer bodies;
  for (const Body& one : frame.bodies) {
    const auto& [w, x, y, z] = one.orientation;
    bodies.put(one.id).put(one.position).put(x).put(y).put(z).put(w).put(one.mean_error);
    bodies.put(static_cast<std::int16_t>(one.tracked ? kTracked : 0));
  }
  put_section(out, version, frame.bodies.size(), bodies.bytes());
  put_empty();                         // skeletons
  if (version >= kSized) put_empty();  // assets
  Writer markers;
  for (const LabelledMarker& one : frame.markers) {
    markers.put(one.id).put(one.position).put(one.size).put(one.flags).put(one.residual);
  }
  put_section(out, version, frame.markers.size(), markers.bytes());
  put_empty();                                                           // force plates
  put_empty();                                                           // devices
  out.put(std::uint32_t{0}).put(std::uint32_t{0}).put(frame.timestamp);  // no time code
  out.put(frame.mid_exposure).put(frame.received).put(frame.sent);
  if (version >= kSized) out.put(std::uint32_t{0}).put(std::uint32_t{0});  // no precision time
  out.put(static_cast<std::int16_t>(frame.models_changed ? kModelsChanged : 0)).put(std::int32_t{0});
  return out.take();
}

Result<Frame> decode_frame(std::span<const std::uint8_t> payload, Version version) {
  Reader in(payload);
  Frame frame;
  frame.number = in.get<std::int32_t>();
  if (!section(in, version, 5, pass_point_set)) return cut("frame: marker sets");
  if (!section(in, version, kPoint, [](Reader& from) { from.skip(kPoint); })) return cut("frame: other markers");
  if (!section(in, version, kBody, [&](Reader& from) { frame.bodies.push_back(body(from)); })) {
    return cut("frame: rigid bodies");
  }
  const auto pass_bodies = [](Reader& from) {
    (void)from.get<std::int32_t>();
    (void)each(from, from.get<std::int32_t>(), kBody, [&] { from.skip(kBody); });
  };
  if (!section(in, version, 8, pass_bodies)) return cut("frame: skeletons");
  const auto pass_asset = [&](Reader& from) {
    pass_bodies(from);
    (void)each(from, from.get<std::int32_t>(), kMarker, [&] { from.skip(kMarker); });
  };
  if (version >= kSized && !section(in, version, 12, pass_asset)) return cut("frame: assets");
  if (!section(in, version, kMarker, [&](Reader& from) { frame.markers.push_back(marker(from)); })) {
    return cut("frame: labelled markers");
  }
  if (!section(in, version, 8, pass_channels)) return cut("frame: force plates");
  if (!section(in, version, 8, pass_channels)) return cut("frame: devices");
  in.skip(8);  // time code
  frame.timestamp = in.get<double>();
  frame.mid_exposure = in.get<std::uint64_t>();
  frame.received = in.get<std::uint64_t>();
  frame.sent = in.get<std::uint64_t>();
  if (version >= kSized) in.skip(8);
  frame.models_changed = (in.get<std::int16_t>() & kModelsChanged) != 0;
  (void)in.get<std::int32_t>();
  if (!in.ok()) return cut("frame");
  if (!std::isfinite(frame.timestamp)) return bad("frame: timestamp", fmt::format("{}", frame.timestamp), "seconds");
  const auto wrong = std::ranges::find_if_not(frame.bodies, is_pose);
  if (wrong != frame.bodies.end()) {
    return bad("frame: rigid body", fmt::format("a pose of {} that is not finite", wrong->id), "numbers");
  }
  return frame;
}

Bytes encode(const std::vector<Model>& models, Version version) {
  Writer out;
  out.put(static_cast<std::int32_t>(models.size()));
  for (const Model& model : models) {
    Writer one;
    put_text(one, model.name);
    one.put(model.id).put(std::int32_t{-1}).put(std::array<float, 3>{}).put(std::int32_t{0});  // no parent, no markers
    out.put(std::int32_t{kRigidBody});
    if (version >= kSized) out.put(static_cast<std::int32_t>(one.bytes().size()));
    out.put(std::span(one.bytes()));
  }
  return out.take();
}

namespace {

Model rigid_body(Reader& in, Version version) {
  Model model;
  model.name = text(in);
  model.id = in.get<std::int32_t>();
  in.skip(4 + kPoint);  // parent, offset
  const auto markers = in.get<std::int32_t>();
  (void)each(in, markers, kPoint, [&] { in.skip(kPoint); });
  (void)each(in, markers, 4, [&] { in.skip(4); });
  if (version >= kMarkerNames) (void)each(in, markers, 1, [&] { (void)text(in); });
  return model;
}

// Passes over a model; returns false where its kind says nothing of its length.
bool pass_model(Reader& in, std::int32_t kind, Version version) {
  switch (kind) {
    case kMarkerSet:
      (void)text(in);
      (void)each(in, in.get<std::int32_t>(), 1, [&] { (void)text(in); });
      return true;
    case kSkeleton:
      (void)text(in);
      (void)in.get<std::int32_t>();
      (void)each(in, in.get<std::int32_t>(), 25, [&] { (void)rigid_body(in, version); });
      return true;
    case kCamera:
      (void)text(in);
      in.skip(7 * 4);
      return true;
    default:
      return false;
  }
}

}  // namespace

Result<std::vector<Model>> decode_models(std::span<const std::uint8_t> payload, Version version) {
  Reader in(payload);
  std::vector<Model> models;
  const auto count = in.get<std::int32_t>();
  if (!in.ok() || count < 0 || static_cast<std::size_t>(count) > in.left() / 4) return cut("models");
  for (std::int32_t i = 0; i < count; ++i) {
    const auto kind = in.get<std::int32_t>();
    if (version >= kSized) {
      const auto size = in.get<std::int32_t>();
      if (!in.ok() || size < 0 || static_cast<std::size_t>(size) > in.left()) return cut("models");
      Reader inner = in.part(static_cast<std::size_t>(size));
      if (kind == kRigidBody) models.push_back(rigid_body(inner, version));
      if (!inner.ok()) return cut("models: rigid body");
    } else if (kind == kRigidBody) {
      models.push_back(rigid_body(in, version));
    } else if (!pass_model(in, kind, version)) {
      return models;
    }
    if (!in.ok()) return cut("models");
  }
  return models;
}

std::optional<Version> requested_bitstream(std::span<const std::uint8_t> payload) {
  std::string words(payload.begin(), payload.end());
  words.resize(std::min(words.find('\0'), words.size()));
  constexpr std::string_view kRequest = "Bitstream,";
  if (!words.starts_with(kRequest)) return {};
  const char* const end = words.data() + words.size();
  Version version{0, 0};
  const auto [dot, failed] = std::from_chars(words.data() + kRequest.size(), end, version.major);
  if (failed != std::errc()) return {};
  if (dot == end) return version;
  if (*dot != '.') return {};
  if (std::from_chars(dot + 1, end, version.minor).ec != std::errc()) return {};
  return version;
}

}  // namespace jostle::perception::natnet
