#pragma once
/// \file
/// A UR5's hand behind its own protocols, over loopback, as one more implementation of Robot.

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>

#include "robot_bridge/ur/arm_hand.hpp"
#include "robot_bridge/ur_sim/dashboard_server.hpp"
#include "robot_bridge/ur_sim/gripper_server.hpp"
#include "robot_bridge/ur_sim/rtde_server.hpp"
#include "robot_bridge/ur_sim/script_server.hpp"
#include "tests/support/exact_plant.hpp"
#include "tests/support/soon.hpp"
#include "tests/support/world_rigs.hpp"

namespace jostle::tests {

/// A simulated controller and gripper in real time, switched on, on ports of their own.
class ArmMachine {
 public:
  explicit ArmMachine(const robot_bridge::ur::Joints& start) : plant_(start) {
    using namespace robot_bridge;
    controller_.opening_rate = [this](double dt) { return gripper_.opening_rate(dt); };
    rtde_ = must(ur_sim::RtdeServer::listen(context_, controller_, kAddress, 0));
    secondary_ = must(ur_sim::ScriptServer::listen(context_, controller_, kAddress, 0, false));
    dashboard_ = must(ur_sim::serve_dashboard(context_, controller_, kAddress, 0));
    gripper_server_ = must(ur_sim::serve_gripper(context_, gripper_, kAddress, 0));
    controller_.power_on();
    let(2.0);
    controller_.brake_release();
    (void)gripper_.answer("SET ACT 1");
    let(5.0);
    thread_ = std::jthread([this](std::stop_token stop) { run(std::move(stop)); });
  }

  robot_bridge::ur::PlanarArmOptions arm_options() const {
    return {.host = kAddress,
            .rtde_port = rtde_->port(),
            .dashboard_port = dashboard_->port(),
            .script_port = secondary_->port(),
            .mounting = {},
            .watchdog = 1.0};  // a busy machine may be late
  }
  robot_bridge::robotiq::Client::Options gripper_options() const {
    return {.host = kAddress, .port = gripper_server_->port()};
  }

  static constexpr const char* kAddress = "127.0.0.1";

 private:
  template <class T>
  static T must(Result<T> result) {
    if (!result) throw std::runtime_error(result.error().message);
    return std::move(result).value();
  }

  // Before anybody looks on, as fast as it can.
  void let(double seconds) {
    for (double left = seconds; left > 0; left -= controller_.generation().cycle) {
      if (!controller_.tick()) throw std::runtime_error("the controller broke");
    }
  }

  void run(std::stop_token stop) {
    using Clock = std::chrono::steady_clock;
    const auto cycle =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(controller_.generation().cycle));
    auto next = Clock::now();
    while (!stop.stop_requested()) {
      next = std::max(next + cycle, Clock::now() - 5 * cycle);
      if (context_.stopped()) context_.restart();
      context_.run_until(next);
      if (!controller_.tick()) return;
      rtde_->publish();
      secondary_->publish();
    }
  }

  boost::asio::io_context context_{1};
  ExactPlant plant_;
  robot_bridge::ur_sim::Controller controller_{plant_, robot_bridge::ur_sim::Generation::cb3()};
  robot_bridge::ur_sim::Gripper gripper_{plant_};
  std::unique_ptr<robot_bridge::ur_sim::RtdeServer> rtde_;
  std::unique_ptr<robot_bridge::ur_sim::ScriptServer> secondary_;
  std::unique_ptr<robot_bridge::net::TcpServer> dashboard_, gripper_server_;
  std::jthread thread_;  // last: it uses all of the above
};

/// robot_bridge/ur/arm_hand with an ArmMachine behind it; it starts where the scene's gripper does.
class ArmRig final : public WorldRig {
 public:
  explicit ArmRig(const physics_pool::Scene& its_scene) : WorldRig(its_scene) {
    if (!soon(std::chrono::seconds(60), [this] { return robot_.trouble().empty(); }))
      throw std::runtime_error("the arm does not get ready: " + robot_.trouble());
  }

  robot_bridge::Robot& robot() override { return robot_; }
  perception::ObjectSource& objects() override { return objects_; }
  double time() override { return robot_.read().value().stamp; }
  State truth() override { throw std::logic_error("only the arm knows"); }
  std::vector<double> limits() const override { return robot_bridge::ur::ArmHand::limits(); }
  bool time_goes_on() const override { return true; }
  double play() const override { return 2e-3; }

 private:
  static robot_bridge::ur::Joints start_of(const physics_pool::Scene& scene) {
    const auto q = robot_bridge::planar::joints_at({}, robot_bridge::ur::Dh::ur5(),
                                                   {scene.robot.q[0], scene.robot.q[1], scene.robot.q[2]});
    if (!q) throw std::runtime_error("the scene's start is out of the arm's reach");
    return *q;
  }

  ArmMachine machine_{start_of(scene)};
  robot_bridge::ur::PlanarArm arm_{machine_.arm_options()};
  robot_bridge::robotiq::Client gripper_{machine_.gripper_options()};
  robot_bridge::ur::ArmHand robot_{arm_, &gripper_};
  State x_ = physics_pool::initial_state(scene);
  KinematicObjects objects_{layout, x_};
};

}  // namespace jostle::tests
