#pragma once
/// \file
/// A simulated Robotiq gripper, and its socket (TCP port 63352).

#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "robot_bridge/net/tcp_server.hpp"
#include "robot_bridge/robotiq/gripper.hpp"
#include "robot_bridge/ur_sim/plant.hpp"

namespace jostle::robot_bridge::ur_sim {

/// A Gripper moves the fingers of a plant as its variables say. One thread.
class Gripper {
 public:
  explicit Gripper(const Plant& plant) : plant_(plant) {}

  /// Returns how fast the opening should change for the next dt seconds, m/s.
  double opening_rate(double dt);

  /// Returns the reply to one request, with its end where it has one.
  std::string answer(std::string_view request);

 private:
  int value(std::string_view variable) const;
  bool set(std::string_view variable, int value);
  void look_for_objects(double dt);

  const Plant& plant_;
  robotiq::Status status_ = robotiq::Status::kReset;
  robotiq::Object object_ = robotiq::Object::kAtRequest;
  std::map<std::string, int, std::less<>> written_{{"ACT", 0}, {"GTO", 0}, {"POS", 0}, {"SPE", 255},
                                                   {"FOR", 0}, {"ATR", 0}, {"ARD", 0}};
  bool opens_again_ = false;  // of the activation: it closes, then opens
  double stalled_ = 0.0;      // s
};

/// Serves the gripper to any number of clients. One thread, the io_context's.
/// Error kUnavailable: the port is taken.
Result<std::unique_ptr<net::TcpServer>> serve_gripper(boost::asio::io_context& context, Gripper& gripper,
                                                      const std::string& address, std::uint16_t port);

}  // namespace jostle::robot_bridge::ur_sim
