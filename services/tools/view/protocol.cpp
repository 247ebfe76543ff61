#include "services/tools/view/protocol.hpp"

#include <fmt/format.h>

#include <limits>
#include <span>

#include "idl/text/json.hpp"

namespace jostle::tools {
namespace {

using nlohmann::json;

constexpr std::size_t kMostEntries = 1024;  // of one request's list
constexpr std::size_t kShown = 40;          // characters of what was got

// What failed to be read, as a message has it.
std::string shown(const json& value) {
  const std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  return text.size() > kShown ? text.substr(0, kShown) + "..." : text;
}

std::string dump(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

const json& field(const json& object, const char* name) {
  static const json kNothing;
  const auto found = object.find(name);
  return found == object.end() ? kNothing : *found;
}

Result<std::uint32_t> number(const json& object, const char* name) {
  const json& value = field(object, name);
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  if (value.is_number_unsigned() && value.get<std::uint64_t>() <= kMost) return value.get<std::uint32_t>();
  return invalid(name, shown(value), fmt::format("a whole number from 0 to {}", kMost));
}

Result<const json*> list(const json& object, const char* name) {
  const json& value = field(object, name);
  if (!value.is_array()) return invalid(name, shown(value), "a list");
  if (value.size() > kMostEntries) {
    return invalid(name, fmt::format("{} entries", value.size()), fmt::format("at most {}", kMostEntries));
  }
  return &value;
}

Result<std::vector<std::string>> names(const json& object, const char* name) {
  const auto list_result = list(object, name);
  if (!list_result) return list_result.error();
  std::vector<std::string> found;
  for (const json& entry : **list_result) {
    if (!entry.is_string()) return invalid(name, shown(entry), "names");
    found.push_back(entry.get<std::string>());
  }
  return found;
}

Result<std::optional<std::string>> optional_id(const json& object) {
  const json& value = field(object, "id");
  if (value.is_null()) return std::optional<std::string>();
  if (!value.is_string()) return invalid("id", shown(value), "a text");
  return std::optional(value.get<std::string>());
}

Result<ViewRequest> subscribe(const json& object) {
  const auto list_result = list(object, "subscriptions");
  if (!list_result) return list_result.error();
  Subscribe request;
  for (const json& entry : **list_result) {
    if (!entry.is_object()) return invalid("subscriptions", shown(entry), "objects with id and channelId");
    const auto id_result = number(entry, "id");
    if (!id_result) return id_result.error();
    const auto channel_result = number(entry, "channelId");
    if (!channel_result) return channel_result.error();
    request.subscriptions.emplace_back(*id_result, *channel_result);
  }
  return ViewRequest(std::move(request));
}

Result<ViewRequest> unsubscribe(const json& object) {
  const auto list_result = list(object, "subscriptionIds");
  if (!list_result) return list_result.error();
  Unsubscribe request;
  for (const json& entry : **list_result) {
    const auto id_result = number(json{{"subscriptionIds", entry}}, "subscriptionIds");
    if (!id_result) return id_result.error();
    request.subscriptions.push_back(*id_result);
  }
  return ViewRequest(std::move(request));
}

Result<ViewRequest> get_parameters(const json& object) {
  auto names_result = names(object, "parameterNames");
  if (!names_result) return names_result.error();
  auto id_result = optional_id(object);
  if (!id_result) return id_result.error();
  return ViewRequest(GetParameters{std::move(names_result).value(), std::move(id_result).value()});
}

Result<ViewRequest> set_parameters(const json& object) {
  const auto list_result = list(object, "parameters");
  if (!list_result) return list_result.error();
  SetParameters request;
  for (const json& entry : **list_result) {
    const json& name = entry.is_object() ? field(entry, "name") : entry;
    if (!entry.is_object() || !name.is_string()) return invalid("parameters", shown(entry), "objects with name, value");
    const json& value = field(entry, "value");
    if (!value.is_number() && !value.is_boolean()) {
      return invalid(name.get<std::string>(), shown(value), "a number, true or false");
    }
    request.values[name.get<std::string>()] = value;
  }
  auto id_result = optional_id(object);
  if (!id_result) return id_result.error();
  request.id = std::move(id_result).value();
  return ViewRequest(std::move(request));
}

Result<ViewRequest> follow_parameters(const json& object, bool follow) {
  auto names_result = names(object, "parameterNames");
  if (!names_result) return names_result.error();
  return ViewRequest(FollowParameters{std::move(names_result).value(), follow});
}

template <class T>
void put(std::span<std::uint8_t> place, T value) {
  for (std::size_t i = 0; i < sizeof value; ++i) {
    place[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
  }
}

}  // namespace

Result<ViewRequest> parse_view_request(std::string_view text) {
  const auto object_result = parse_json(text);
  if (!object_result) return Error{object_result.error().code, "request: " + object_result.error().message};
  const json& object = *object_result;
  if (!object.is_object()) return invalid("request", shown(object), "an object");
  const json& op = field(object, "op");
  if (op == "subscribe") return subscribe(object);
  if (op == "unsubscribe") return unsubscribe(object);
  if (op == "getParameters") return get_parameters(object);
  if (op == "setParameters") return set_parameters(object);
  if (op == "subscribeParameterUpdates") return follow_parameters(object, true);
  if (op == "unsubscribeParameterUpdates") return follow_parameters(object, false);
  return invalid("op", shown(op), "subscribe, unsubscribe, or one about parameters: this server only shows");
}

std::string server_info_text(const std::string& name, bool has_time, bool has_parameters, const std::string& session) {
  json capabilities = json::array();
  if (has_time) capabilities.push_back("time");
  if (has_parameters) {
    capabilities.push_back("parameters");
    capabilities.push_back("parametersSubscribe");
  }
  return dump({{"op", "serverInfo"},
               {"name", name},
               {"capabilities", std::move(capabilities)},
               {"supportedEncodings", json::array()},
               {"metadata", json::object()},
               {"sessionId", session}});
}

std::string advertise_text(std::uint32_t first, const std::vector<bags::Topic>& topics) {
  json channels = json::array();
  for (const bags::Topic& topic : topics) {
    channels.push_back({{"id", first++},
                        {"topic", topic.name},
                        {"encoding", topic.encoding},
                        {"schemaName", topic.type},
                        {"schema", topic.definition},
                        {"schemaEncoding", topic.schema}});
  }
  return dump({{"op", "advertise"}, {"channels", std::move(channels)}});
}

std::string status_text(ViewStatus level, const std::string& message) {
  return dump({{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}});
}

std::string parameters_text(const ViewParameters& values, const std::optional<std::string>& id) {
  json parameters = json::array();
  for (const auto& [name, value] : values) parameters.push_back({{"name", name}, {"value", value}});
  json object{{"op", "parameterValues"}, {"parameters", std::move(parameters)}};
  if (id) object["id"] = *id;
  return dump(object);
}

std::array<std::uint8_t, 13> sample_header(std::uint32_t subscription, bags::Time time) {
  std::array<std::uint8_t, 13> header{1};
  put(std::span(header).subspan(1), subscription);
  put(std::span(header).subspan(5), time);
  return header;
}

std::array<std::uint8_t, 9> time_frame(bags::Time time) {
  std::array<std::uint8_t, 9> frame{2};
  put(std::span(frame).subspan(1), time);
  return frame;
}

}  // namespace jostle::tools
