#include "services/bags/play/remote_control.hpp"

#include <fmt/format.h>

#include <random>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::bags {
namespace {

using namespace std::chrono_literals;
using jostle_msgs::msg::PlayControl;
using jostle_msgs::msg::PlayStatus;
using Statuses = wire::Inbox<PlayStatus>;

constexpr auto kRepeat = 200ms;  // until answered: a reader that was just found may miss a sample

Error no_playback(const RemoteOptions& options, int domain) {
  return {
      Code::kUnavailable,
      fmt::format("got no answer from a playback in domain {} within {:g} s; remedy: --domain, or `jostle play BAG`",
                  domain, std::chrono::duration<double>(options.timeout).count())};
}

std::uint64_t random_id() {
  std::random_device entropy;
  return (std::uint64_t{entropy()} << 32 | entropy()) | 1;  // 0 means none
}

bool is_done(const PlayStatus& status, const PlayControl& control) {
  return status.control_id() == control.id() && (!status.control_error().empty() || status.state() != "seeking");
}

}  // namespace

Result<PlayStatus> control_remotely(const std::vector<Control>& controls, const RemoteOptions& options,
                                    std::stop_token stop) {
  const auto participant_result =
      wire::Participant::open({.name = "jostle_play_control", .domain = options.domain, .role = wire::Role::kRobot});
  if (!participant_result) return participant_result.error();
  const int domain = participant_result->domain();
  wire::Writer<PlayControl> writer(*participant_result, wire::topics::kPlayControl);
  Statuses statuses(*participant_result, wire::topics::kPlayStatus, 256);

  auto deadline = std::chrono::steady_clock::now() + options.timeout;
  auto status = statuses.take(deadline, stop);
  for (const Control& wanted : controls) {
    PlayControl control;
    control.id(random_id());
    control.command(wanted.command);
    control.value(wanted.value);
    deadline = std::chrono::steady_clock::now() + options.timeout;
    do {
      if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      if (std::chrono::steady_clock::now() >= deadline) return no_playback(options, domain);
      (void)writer.write(control);  // repeated until a status answers it
      const auto again = std::min(deadline, std::chrono::steady_clock::now() + kRepeat);
      do status = statuses.take(again, stop);
      while (status && !is_done(*status, control));
    } while (!status);
    if (!status->control_error().empty()) return Error{Code::kInvalidArgument, status->control_error()};
  }
  if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
  if (!status) return no_playback(options, domain);
  return *status;
}

}  // namespace jostle::bags
