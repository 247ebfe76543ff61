#pragma once
/// \file
/// The controller's side of the external-control contract: the program that ROS drivers of these arms upload. It
/// connects back to three ports of whoever sent it, and obeys packets of big-endian 32-bit words.

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <deque>
#include <memory>

#include "robot_bridge/net/tcp_server.hpp"
#include "robot_bridge/ur_sim/controller.hpp"

namespace jostle::robot_bridge::ur_sim {

/// Performs the contract for a controller whose program opens its sockets. One thread, the io_context's.
///
/// Obeyed are servoj, speedj, speedl, idle and stop, and trajectories of movej, movel and spline points. A packet that
/// does not come within the time that the one before it allowed ends the program, and the arm stops at kStop.
class ExternalControl {
 public:
  static constexpr double kStop = 4.0;      ///< rad/s²
  static constexpr double kScale = 1e6;     ///< words per unit
  static constexpr double kIgnored = 20.0;  ///< rad/s: what would need more is not obeyed
  static constexpr std::size_t kReverseWords = 8, kPointWords = 21;

  /// Sets the controller's on_external.
  ExternalControl(boost::asio::io_context& context, Controller& controller);
  ~ExternalControl();

  /// Once per cycle, before the controller's.
  void tick();

 private:
  enum Mode : std::int32_t { kStopped = -2, kIdle = 0, kServo = 1, kSpeed = 2, kForward = 3, kSpeedL = 4, kPose = 5 };
  // Words that came over a socket, cut into packets.
  struct Words {
    Bytes waiting;
    std::optional<std::vector<std::int32_t>> next(std::size_t count);
  };
  struct Link {
    std::shared_ptr<net::Peer> peer;
    Words words;
  };

  void connect(const Program::External& external, int step);
  void take(int step);
  void obey(const std::vector<std::int32_t>& packet);
  void forward(const std::vector<std::int32_t>& packet);
  void add_point(const std::vector<std::int32_t>& words);
  void finish_trajectory(std::int32_t result);
  void leave();

  boost::asio::io_context& context_;
  Controller& controller_;
  std::array<Link, 3> links_;  // in the order of connecting: trajectory, script command, reverse
  int mode_ = kIdle;
  double deadline_ = 0.0;  // s of the controller, for the next packet; 0: none
  bool has_target_ = false;
  std::int32_t points_left_ = 0;  // of a trajectory that is received
  bool is_forwarding_ = false, point_runs_ = false;
  std::deque<Motion> points_;
};

}  // namespace jostle::robot_bridge::ur_sim
