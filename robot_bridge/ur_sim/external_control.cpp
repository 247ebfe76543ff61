#include "robot_bridge/ur_sim/external_control.hpp"

#include <boost/asio/connect.hpp>
#include <cmath>
#include <utility>

namespace jostle::robot_bridge::ur_sim {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr int kTrajectory = 0, kScriptCommand = 1, kReverse = 2;
constexpr std::int32_t kSuccess = 0, kCancelled = 1, kFailure = 2;
constexpr std::int32_t kMoveJPoint = 0, kMoveLPoint = 1, kSplinePoint = 51;
constexpr std::int32_t kQuintic = 2;
constexpr std::size_t kMostPoints = 100'000;

Joints six(const std::vector<std::int32_t>& words, std::size_t first) {
  Joints values;
  for (std::size_t j = 0; j < values.size(); ++j) values[j] = words[first + j] / ExternalControl::kScale;
  return values;
}

}  // namespace

std::optional<std::vector<std::int32_t>> ExternalControl::Words::next(std::size_t count) {
  if (waiting.size() < 4 * count) return {};
  BigEndianReader in(waiting);
  std::vector<std::int32_t> words(count);
  for (std::int32_t& word : words) word = in.get<std::int32_t>();
  waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(4 * count));
  return words;
}

ExternalControl::ExternalControl(asio::io_context& context, Controller& controller)
    : context_(context), controller_(controller) {
  controller_.on_external = [this](const Program::External& external) {
    leave();
    connect(external, kTrajectory);
  };
}

ExternalControl::~ExternalControl() {
  controller_.on_external = {};
  for (Link& link : links_) {
    if (link.peer) link.peer->abandon();
  }
}

// One after the other: the reverse connection, the last, means that the program runs.
void ExternalControl::connect(const Program::External& external, int step) {
  const std::uint16_t port = step == kTrajectory      ? external.trajectory
                             : step == kScriptCommand ? external.script_command
                                                      : external.reverse;
  if (port == 0) return connect(external, step + 1);  // older drivers have no script commands
  boost::system::error_code code;
  const auto places = tcp::resolver(context_).resolve(tcp::v4(), external.host, std::to_string(port), code);
  const auto socket = std::make_shared<tcp::socket>(context_);
  asio::async_connect(*socket, places, [this, external, step, socket](boost::system::error_code failed, const auto&) {
    if (failed) return (void)controller_.stop();
    const auto peer = std::make_shared<net::Peer>(std::move(*socket));
    links_[static_cast<std::size_t>(step)] = {peer, {}};
    peer->start({.on_bytes =
                     [this, step](std::span<const std::uint8_t> bytes) {
                       Bytes& waiting = links_[static_cast<std::size_t>(step)].words.waiting;
                       waiting.insert(waiting.end(), bytes.begin(), bytes.end());
                       take(step);
                     },
                 .on_end =
                     [this, step] {
                       if (step == kReverse) controller_.stop();
                     }});
    if (step != kReverse) connect(external, step + 1);
  });
  if (code) controller_.stop();
}

void ExternalControl::take(int step) {
  Words& words = links_[static_cast<std::size_t>(step)].words;
  if (step == kReverse) {
    while (const auto packet = words.next(kReverseWords)) obey(*packet);
  } else if (step == kTrajectory) {
    while (const auto point = words.next(kPointWords)) add_point(*point);
  } else {
    words.waiting.clear();  // payload, tool voltage, …: nothing here that they change
  }
}

void ExternalControl::obey(const std::vector<std::int32_t>& packet) {
  if (!controller_.is_running()) return;
  deadline_ = packet[0] > 0 ? controller_.time() + packet[0] / 1e3 : 0.0;
  const int mode = packet[7];
  if (mode_ == kForward && mode != kForward && is_forwarding_) finish_trajectory(kCancelled);
  if (mode != mode_ && (mode_ == kServo || mode_ == kSpeed || mode_ == kSpeedL)) controller_.begin(StopJ{kStop});
  mode_ = mode;
  const Joints values = six(packet, 1);
  const double cycle = controller_.generation().cycle;
  switch (mode) {
    case kServo: {
      for (std::size_t j = 0; j < values.size(); ++j) {
        if (std::abs(values[j] - controller_.target()[j]) / cycle > kIgnored) return;
      }
      controller_.begin(ServoJ{.q = values, .t = cycle});
      has_target_ = true;
      break;
    }
    case kSpeed:
      controller_.begin(SpeedJ{.qd = values, .a = 40.0, .t = cycle});
      break;
    case kSpeedL:
      controller_.begin(SpeedL{.xd = values, .a = 40.0, .t = cycle});
      break;
    case kForward:
      forward(packet);
      break;
    case kStopped:
      controller_.stop();
      leave();
      break;
    default:
      break;
  }
}

void ExternalControl::forward(const std::vector<std::int32_t>& packet) {
  constexpr std::int32_t kStart = 1, kCancel = -1;
  if (packet[1] == kStart) {
    points_.clear();
    points_left_ = packet[2];
    is_forwarding_ = true;
    point_runs_ = false;
    take(kTrajectory);
  } else if (packet[1] == kCancel && is_forwarding_) {
    controller_.begin(StopJ{kStop});
    finish_trajectory(kCancelled);
  }
}

void ExternalControl::add_point(const std::vector<std::int32_t>& words) {
  if (!is_forwarding_ || points_left_ <= 0 || points_.size() >= kMostPoints) return;
  --points_left_;
  const Joints first = six(words, 0), second = six(words, 6), third = six(words, 12);
  const double duration = words[18] / kScale;
  switch (words[20]) {
    case kMoveJPoint:
      points_.emplace_back(
          MoveJ{.q = first, .a = third[1] > 0 ? third[1] : 1.4, .v = third[0] > 0 ? third[0] : 1.05, .t = duration});
      break;
    case kMoveLPoint:
      points_.emplace_back(
          MoveL{.pose = first, .a = third[1] > 0 ? third[1] : 1.2, .v = third[0] > 0 ? third[0] : 0.25, .t = duration});
      break;
    case kSplinePoint:
      points_.emplace_back(
          Spline{.q = first, .qd = second, .qdd = third, .t = duration, .is_quintic = words[19] == kQuintic});
      break;
    default:
      finish_trajectory(kFailure);  // arcs and the like
  }
}

void ExternalControl::finish_trajectory(std::int32_t result) {
  is_forwarding_ = point_runs_ = false;
  points_.clear();
  points_left_ = 0;
  if (links_[kTrajectory].peer) links_[kTrajectory].peer->send(BigEndianWriter().put(result).bytes());
}

void ExternalControl::leave() {
  for (Link& link : links_) {
    if (link.peer) link.peer->close();
    link = {};
  }
  mode_ = kIdle;
  deadline_ = 0.0;
  is_forwarding_ = false;
}

void ExternalControl::tick() {
  if (!links_[kReverse].peer) return;
  if (controller_.runtime_state() == ur::RuntimeState::kStopped) return leave();
  if (!controller_.is_running()) return;
  if (deadline_ > 0.0 && controller_.time() > deadline_) {
    controller_.begin(StopJ{kStop});
    controller_.stop();
    return leave();
  }
  const double cycle = controller_.generation().cycle;
  // A cycle without a new target: on, with the last speed.
  if (mode_ == kServo && !std::exchange(has_target_, false) && controller_.motion_is_done()) {
    controller_.begin(SpeedJ{.qd = controller_.target_speed(), .a = 40.0, .t = cycle});
  }
  if (!is_forwarding_) return;
  if (point_runs_ && !controller_.motion_is_done()) return;
  if (points_.empty()) {
    if (point_runs_ && points_left_ == 0) {
      controller_.begin(StopJ{kStop});
      finish_trajectory(kSuccess);
    }
    return;
  }
  controller_.begin(points_.front());
  points_.pop_front();
  point_runs_ = true;
}

}  // namespace jostle::robot_bridge::ur_sim
