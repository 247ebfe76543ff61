#include "services/tools/render/frames.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "idl/text/json.hpp"
#include "services/common/process/files.hpp"

namespace jostle::tools {
namespace {

using nlohmann::json;

// Where we are in a file, for complaints.
class Reader {
 public:
  explicit Reader(std::string origin) : origin_(std::move(origin)) {}

  Error wrong(const std::string& field, const std::string& problem) const {
    return {Code::kInvalidArgument, fmt::format("{}: {}: {}", origin_, field, problem)};
  }

  Result<Frames> read(const json& root) const {
    if (!root.is_object() || !root.contains("scene") || !root["scene"].is_string()) {
      return wrong("scene", "missing or not text, wanted the YAML text of a scene");
    }
    auto scene_result = physics_pool::parse_scene(root["scene"].get<std::string>(), origin_ + ": scene");
    if (!scene_result) return scene_result.error();
    if (!root.contains("frames") || !root["frames"].is_array() || root["frames"].empty()) {
      return wrong("frames", "missing or empty, wanted a list of {caption, q}");
    }
    Frames result{.scene = std::move(scene_result).value()};
    for (const json& entry : root["frames"]) {
      auto frame_result = read_frame(entry, fmt::format("frames[{}]", result.frames.size()),
                                     static_cast<std::size_t>(layout_of(result.scene).nq));
      if (!frame_result) return frame_result.error();
      result.frames.push_back(std::move(frame_result).value());
    }
    return result;
  }

 private:
  Result<Frame> read_frame(const json& entry, const std::string& field, std::size_t nq) const {
    if (!entry.is_object()) return wrong(field, fmt::format("got {}, wanted {{caption, q}}", entry.type_name()));
    const json caption = entry.value("caption", json(""));
    if (!caption.is_string()) {
      return wrong(field + ".caption", fmt::format("got {}, wanted text", caption.type_name()));
    }
    const json q = entry.value("q", json::array());
    if (!q.is_array() || q.size() != nq) {
      return wrong(field + ".q", fmt::format("got {} values, wanted {} for this scene", q.size(), nq));
    }
    Frame frame{.caption = caption.get<std::string>()};
    for (const json& value : q) {
      if (!value.is_number()) {
        return wrong(fmt::format("{}.q[{}]", field, frame.state.q.size()),
                     fmt::format("got {}, wanted a number", value.type_name()));
      }
      frame.state.q.push_back(value.get<double>());
    }
    return frame;
  }

  std::string origin_;
};

}  // namespace

Result<Frames> load_frames(const std::filesystem::path& file) {
  const auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  const auto json_result = parse_json(*text_result);
  if (!json_result)
    return Error{json_result.error().code, fmt::format("{}: {}", file.string(), json_result.error().message)};
  try {
    return Reader(file.string()).read(*json_result);
  } catch (const json::exception& error) {
    return Error{Code::kInvalidArgument, fmt::format("{}: {}", file.string(), error.what())};
  }
}

Result<Frames> load_start(const std::filesystem::path& file) {
  auto scene_result = physics_pool::load_scene(file);
  if (!scene_result) return scene_result.error();
  State start = physics_pool::initial_state(*scene_result);
  return Frames{.scene = std::move(scene_result).value(), .frames = {{.state = std::move(start)}}};
}

}  // namespace jostle::tools
