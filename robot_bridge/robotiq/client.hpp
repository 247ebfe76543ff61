#pragma once
/// \file
/// A Robotiq gripper over its socket, on a thread of its own.

#include <atomic>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "robot_bridge/net/tcp_client.hpp"
#include "robot_bridge/robotiq/gripper.hpp"

namespace jostle::robot_bridge::robotiq {

/// A Client activates the gripper, moves it to openings, and reads what it says of itself about 50 times a second. It
/// connects again when it was lost.
///
/// Threads  any.
class Client {
 public:
  struct Options {
    std::string host = "127.0.0.1";
    std::uint16_t port = kPort;
    int force = 100;  ///< FOR, 0 to 255
  };
  struct Report {
    bool is_ready = false;  ///< connected, active, no fault
    double opening = 0.0;   ///< m
    double velocity = 0.0;  ///< m/s, of the opening
    Object object = Object::kAtRequest;
    std::string trouble;  ///< why it is not ready
  };

  explicit Client(Options options);
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Goes to an opening, m, at a speed, m/s.
  void move(double opening, double speed);
  Report report() const;

 private:
  void run(std::stop_token stop);
  Result<void> serve(net::TcpClient& tcp, std::stop_token stop);
  Result<int> get(net::TcpClient& tcp, const char* variable);
  Result<void> set(net::TcpClient& tcp, const std::string& request);

  const Options options_;
  mutable std::mutex mutex_;  // guards the three below
  Report report_;
  double wanted_ = -1.0, speed_ = kFastest;  // m, m/s; below 0: nothing yet
  std::jthread thread_;
};

}  // namespace jostle::robot_bridge::robotiq
