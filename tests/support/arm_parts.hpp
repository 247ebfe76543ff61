#pragma once
/// \file
/// An arm behind its own protocols, each part a process of its own that may die alone; and somebody who looks on.

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "robot_bridge/net/tcp_client.hpp"
#include "robot_bridge/ur/control_program.hpp"
#include "robot_bridge/ur/modes.hpp"
#include "robot_bridge/ur/rtde.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {

inline constexpr double kStill = 0.01;  // rad/s
inline constexpr std::uint16_t kPendant = 29990;

/// Listens to a controller, and commands nothing.
class Onlooker {
  using Clock = robot_bridge::net::Clock;

 public:
  explicit Onlooker(const std::string& address) {
    soon(kPatience, [&] {
      auto tcp = robot_bridge::net::TcpClient::connect(address, robot_bridge::ur::rtde::kPort,
                                                       Clock::now() + std::chrono::seconds(1));
      if (tcp) tcp_.emplace(std::move(*tcp));
      return tcp_.has_value();
    });
    if (!tcp_) throw std::runtime_error("no controller at " + address);
    for (const auto& packet :
         {robot_bridge::ur::rtde::protocol_request(2),
          robot_bridge::ur::rtde::outputs_request(
              125, {"timestamp", "actual_qd", "robot_mode", "safety_mode", "runtime_state", "output_int_register_24"}),
          robot_bridge::ur::rtde::start_request()}) {
      if (!tcp_->write(robot_bridge::ur::rtde::encode(packet), Clock::now() + kPatience))
        throw std::runtime_error("it does not listen");
    }
  }

  struct Sample {
    double time = 0.0, fastest = 0.0;  // s of the controller, rad/s of the fastest joint
    bool may_move = false;             // on, brakes released, no stop
    bool is_commanded = false;         // and the bridge's program runs
  };
  Sample next() {
    std::array<std::uint8_t, 4096> room;
    for (;;) {
      auto packet = stream_.next();
      if (!packet) throw std::runtime_error(packet.error().message);
      if (*packet && (*packet)->type == robot_bridge::ur::rtde::PacketType::kData) {
        BigEndianReader in((*packet)->payload);
        (void)in.get<std::uint8_t>();
        Sample sample{.time = in.get<double>()};
        for (const double v : in.get_array<double, 6>()) sample.fastest = std::max(sample.fastest, std::abs(v));
        const auto robot_mode = static_cast<robot_bridge::ur::RobotMode>(in.get<std::int32_t>());
        const auto safety_mode = static_cast<robot_bridge::ur::SafetyMode>(in.get<std::int32_t>());
        sample.may_move =
            robot_mode == robot_bridge::ur::RobotMode::kRunning && safety_mode == robot_bridge::ur::SafetyMode::kNormal;
        const auto runtime = static_cast<robot_bridge::ur::RuntimeState>(in.get<std::uint32_t>());
        sample.is_commanded = runtime == robot_bridge::ur::RuntimeState::kPlaying && sample.may_move &&
                              in.get<std::int32_t>() == robot_bridge::ur::contract::kReady;
        return sample;
      }
      if (*packet) continue;
      auto bytes = tcp_->read(room, Clock::now() + kPatience);
      if (!bytes) throw std::runtime_error(bytes.error().message);
      stream_.append(*bytes);
    }
  }

 private:
  std::optional<robot_bridge::net::TcpClient> tcp_;
  robot_bridge::ur::rtde::PacketStream stream_;
};

/// A system whose parts were started one by one.
class ArmParts : public RunFixture {
 protected:
  using Clock = robot_bridge::net::Clock;
  using Start = std::function<std::unique_ptr<ProgramProcess>(const std::string&, const std::vector<std::string>&)>;

  /// Starts all parts and waits until the arm moves towards the target, and further on until it moves at a moment
  /// that each repetition (--gtest_repeat) draws anew. Returns the onlooker's newest sample.
  Onlooker::Sample start_moving() {
    arm = at_the_arm("jostle_ur_sim", {easy, "--address", address, "--pendant", std::to_string(kPendant)});
    bridge = at_the_planner("jostle_bridge", {"ur5", "--host", address, "--silence", silence, "--watchdog", watchdog});
    coordinator = at_the_planner("jostle_coordinator", {});
    worker = at_the_planner("jostle_worker", {"--threads", "2"});
    EXPECT_TRUE(bridge->says("ready on domain", kPatience)) << bridge->err() << arm->err();
    goal = at_the_planner("jostle_goal", {easy, "--parameters", plain, "--headless", "--wait", "60"});
    look_on([this] { onlooker = std::make_unique<Onlooker>(address); });
    const auto deadline = Clock::now() + kPatience;
    const auto moves = [&](Onlooker::Sample sample, double since) {
      while ((sample.fastest < 5 * kStill || sample.time < since) && Clock::now() < deadline) sample = onlooker->next();
      return sample;
    };
    const Onlooker::Sample first = moves({}, 0.0);
    EXPECT_GE(first.fastest, 5 * kStill) << goal->err() << coordinator->err() << bridge->err();
    static unsigned repetition = 0;
    std::mt19937 random(++repetition);
    const double moment = std::uniform_real_distribution<double>(0.0, kWindow)(random);
    const Onlooker::Sample sample = moves(first, first.time + moment);
    EXPECT_GE(sample.fastest, 5 * kStill) << "at " << moment << " s: " << goal->err();
    return sample;
  }

  /// Seconds of the controller's clock until it stands still; at most 3.
  double time_to_stand(double since) {
    Onlooker::Sample sample;
    do sample = onlooker->next();
    while (sample.fastest > kStill && sample.time < since + 3.0);
    const double took = sample.time - since;
    fmt::print("stood still after {:.0f} ms of the controller's clock\n", 1e3 * took);
    return took;
  }

  static constexpr double kWindow = 2.5;  // s; the first motion of a run is longer, pauses included
  std::string address = fmt::format("127.0.1.{}", domain + 1);
  std::string silence = "1", watchdog = "1";  // s: on a busy machine a commander and a bridge may be late
  const Start here = [this](const auto& name, const auto& arguments) { return program(name, arguments); };
  Start at_the_arm = here, at_the_planner = here;
  std::function<void(const std::function<void()>&)> look_on = [](const auto& act) { act(); };
  std::unique_ptr<ProgramProcess> arm, bridge, coordinator, worker, goal;
  std::unique_ptr<Onlooker> onlooker;
};

}  // namespace jostle::tests
