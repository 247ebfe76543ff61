#pragma once
/// \file
/// What is said over a viewer's socket: `foxglove.websocket.v1`, as @foxglove/ws-protocol 0.8.0 speaks it. No socket in
/// it.

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/message.hpp"

namespace jostle::tools {

/// The name that both sides give when they open a socket.
inline constexpr std::string_view kViewProtocol = "foxglove.websocket.v1";

/// Values that viewers may read and, as far as their owner allows it, set; by name. A value is a number or true or
/// false.
using ViewParameters = std::map<std::string, nlohmann::json>;

enum class ViewStatus { kInfo = 0, kWarning = 1, kError = 2 };

/// What a viewer asks for.
struct Subscribe {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> subscriptions;  ///< its own number, and the channel
};
struct Unsubscribe {
  std::vector<std::uint32_t> subscriptions;
};
struct GetParameters {
  std::vector<std::string> names;  ///< empty: all
  std::optional<std::string> id;   ///< comes back with the answer
};
struct SetParameters {
  ViewParameters values;
  std::optional<std::string> id;
};
struct FollowParameters {
  std::vector<std::string> names;  ///< empty: all
  bool follow = true;              ///< false: no longer
};
using ViewRequest = std::variant<Subscribe, Unsubscribe, GetParameters, SetParameters, FollowParameters>;

/// Reads a text frame of a viewer. Error kInvalidArgument: no JSON, an operation that is not offered, a field that is
/// not as it should be; says which, got and wanted.
Result<ViewRequest> parse_view_request(std::string_view text);

/// These return text frames for viewers. `session` is another one each time a server starts.
/// `has_time`: it tells what time it is; `has_parameters`: there are some.
std::string server_info_text(const std::string& name, bool has_time, bool has_parameters, const std::string& session);
/// Channels by number, in the order given: the first has the number `first`.
std::string advertise_text(std::uint32_t first, const std::vector<bags::Topic>& topics);
std::string status_text(ViewStatus level, const std::string& message);
std::string parameters_text(const ViewParameters& values, const std::optional<std::string>& id);

/// Returns what stands before a sample in its frame: one byte of kind, the viewer's number, the time, little-endian.
std::array<std::uint8_t, 13> sample_header(std::uint32_t subscription, bags::Time time);
/// Returns the frame that says what time it is on a bag's clock.
std::array<std::uint8_t, 9> time_frame(bags::Time time);

}  // namespace jostle::tools
