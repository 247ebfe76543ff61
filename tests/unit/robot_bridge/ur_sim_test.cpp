// The simulated controller without sockets: motions, programs, modes, stops.

#include <gmock/gmock.h>

#include <cmath>

#include "robot_bridge/ur/control_program.hpp"
#include "robot_bridge/ur/primary.hpp"
#include "robot_bridge/ur_sim/controller.hpp"
#include "robot_bridge/ur_sim/dashboard_server.hpp"
#include "robot_bridge/ur_sim/gripper_server.hpp"
#include "robot_bridge/ur_sim/script_server.hpp"
#include "tests/support/exact_plant.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tests::ExactPlant;
using ur::RobotMode;
using ur::RuntimeState;
using ur::SafetyMode;

class UrSim : public ::testing::Test {
 protected:
  UrSim() {
    sut.on_event = [this](const Controller::Event& event) { events.push_back(event.text); };
  }

  void let(double seconds) {
    for (double left = seconds; left > 1e-9; left -= sut.generation().cycle) ASSERT_TRUE(sut.tick());
  }

  void switch_on() {
    ASSERT_TRUE(sut.power_on());
    let(1.1);
    ASSERT_TRUE(sut.brake_release());
    let(0.6);
    ASSERT_EQ(sut.robot_mode(), RobotMode::kRunning);
  }

  void run_control() {
    auto program = parse_program(ur::control_program(sut.generation().cycle));
    ASSERT_TRUE(program);
    sut.run(*program);
    ASSERT_TRUE(sut.is_running());
  }

  // As a bridge does in each cycle.
  void command(std::int32_t code, const Joints& values, double acceleration = 10.0) {
    for (std::size_t j = 0; j < values.size(); ++j) {
      sut.set_input("input_double_register_" + std::to_string(24 + j), values[j]);
    }
    sut.set_input("input_double_register_30", acceleration);
    sut.set_input("input_int_register_25", ++number);
    sut.set_input("input_int_register_24", code);
  }

  double fastest() const {
    double most = 0.0;
    for (const double v : plant.velocities()) most = std::max(most, std::abs(v));
    return most;
  }

  ExactPlant plant;
  Controller sut{plant, Generation::cb3()};
  std::vector<std::string> events;
  std::int32_t number = 0;
};

TEST_F(UrSim, IsSwitchedOnInSteps) {
  EXPECT_EQ(sut.robot_mode(), RobotMode::kPowerOff);
  EXPECT_FALSE(sut.brake_release());
  EXPECT_TRUE(sut.power_on());
  let(0.6);
  EXPECT_EQ(sut.robot_mode(), RobotMode::kPowerOn);
  let(0.5);
  EXPECT_EQ(sut.robot_mode(), RobotMode::kIdle);
  EXPECT_TRUE(sut.brake_release());
  let(0.6);
  EXPECT_EQ(sut.robot_mode(), RobotMode::kRunning);
}

TEST_F(UrSim, AskedTwiceItIsSwitchedOnNoLater) {
  ASSERT_TRUE(sut.power_on());
  let(0.4);
  EXPECT_TRUE(sut.power_on());
  let(0.2);
  EXPECT_EQ(sut.robot_mode(), RobotMode::kPowerOn);
}

TEST_F(UrSim, OurProgramObeysSpeedsAndCountsThem) {
  switch_on();
  run_control();
  for (int i = 0; i < 50; ++i) {
    command(9, {0.5, 0, 0, 0, 0, -0.25});
    let(0.008);
  }
  EXPECT_NEAR(plant.velocities()[0], 0.5, 1e-3);
  EXPECT_NEAR(plant.velocities()[5], -0.25, 1e-3);
  EXPECT_EQ(std::get<std::int32_t>(*sut.output("output_int_register_24")), 1);
  EXPECT_EQ(std::get<std::int32_t>(*sut.output("output_int_register_25")), number);
}

// What keeps an arm from going on when whoever commands it is gone.
TEST_F(UrSim, StopsWithin200MillisecondsWhenNobodyWritesItsRegisters) {
  switch_on();
  run_control();
  for (int i = 0; i < 50; ++i) {
    command(9, {1.0, 0, 0, 0, 0, 0});
    let(0.008);
  }
  ASSERT_GT(fastest(), 0.9);
  let(0.2);
  EXPECT_LT(fastest(), 0.02);
  EXPECT_FALSE(sut.is_running());
  EXPECT_THAT(events, ::testing::Contains(HasSubstr("watchdog")));
}

TEST_F(UrSim, AProtectiveStopHoldsTheArmUntilItIsUnlockedFiveSecondsLater) {
  switch_on();
  run_control();
  command(9, {1.0, 0, 0, 0, 0, 0});
  let(0.04);
  sut.protective_stop("a test");
  EXPECT_EQ(sut.robot_mode(), RobotMode::kRunning);
  EXPECT_EQ(sut.safety_mode(), SafetyMode::kProtectiveStop);
  EXPECT_EQ(sut.runtime_state(), RuntimeState::kPaused);
  command(9, {1.0, 0, 0, 0, 0, 0});
  let(1.0);
  EXPECT_LT(fastest(), 1e-9);
  EXPECT_FALSE(sut.unlock_protective_stop());
  let(4.1);
  EXPECT_TRUE(sut.unlock_protective_stop());
  EXPECT_EQ(sut.safety_mode(), SafetyMode::kNormal);
  let(0.1);
  EXPECT_LT(fastest(), 1e-9);  // paused: it does not go on by itself
}

TEST_F(UrSim, AnEmergencyStopSwitchesItOff) {
  switch_on();
  run_control();
  sut.emergency_stop();
  let(0.1);
  EXPECT_EQ(sut.robot_mode(), RobotMode::kPowerOff);
  EXPECT_FALSE(sut.power_on());
  sut.restart_safety();
  EXPECT_TRUE(sut.power_on());
}

TEST_F(UrSim, AfterARebootTimeBeginsAnewAndNothingIsRemembered) {
  switch_on();
  run_control();
  command(9, {1.0, 0, 0, 0, 0, 0});
  sut.reboot();
  EXPECT_LT(sut.time(), 0.01);
  EXPECT_EQ(std::get<std::int32_t>(*sut.output("input_int_register_24")), 0);
  let(1.1);
  EXPECT_EQ(sut.robot_mode(), RobotMode::kPowerOff);
  EXPECT_EQ(sut.boots(), 2);
}

TEST_F(UrSim, MoveJArrivesWithAllJointsAtOnceAndNoFasterThanItMay) {
  switch_on();
  auto program = parse_program("def go():\n  movej([0.5, -1.0, 0.2, 0, 0, 0], a=1.0, v=0.8)\nend\n");
  ASSERT_TRUE(program) << program.error().message;
  sut.run(*program);
  double most = 0.0;
  for (int i = 0; i < 1000 && sut.is_running(); ++i) {
    let(0.008);
    most = std::max(most, fastest());
  }
  EXPECT_FALSE(sut.is_running());
  EXPECT_LE(most, 0.81);
  EXPECT_GT(most, 0.7);
  EXPECT_NEAR(plant.positions()[0], 0.5, 1e-3);
  EXPECT_NEAR(plant.positions()[1], -1.0, 1e-3);
  EXPECT_THAT(events, ElementsAre("go", "go"));
}

TEST_F(UrSim, MeetingSomethingIsAProtectiveStop) {
  switch_on();
  run_control();
  plant.is_stuck = true;
  for (int i = 0; i < 200 && sut.safety_mode() == SafetyMode::kNormal; ++i) {
    command(9, {1.0, 0, 0, 0, 0, 0});
    let(0.008);
  }
  EXPECT_EQ(sut.safety_mode(), SafetyMode::kProtectiveStop);
  EXPECT_THAT(sut.popup(), HasSubstr("joint 0"));
}

TEST(UrProgram, OfOursObeysRegistersAndHasAWatchdog) {
  const auto program = parse_program(ur::control_program(0.002));
  ASSERT_TRUE(program) << program.error().message;
  EXPECT_EQ(program->name, "jostle_control");
  EXPECT_EQ(program->registers, 24);
  EXPECT_TRUE(program->streams);
  EXPECT_EQ(program->watchdog, 15.0);
}

TEST(UrProgram, WithWhatNobodySimulatesIsRefusedByItsLine) {
  const auto program = parse_program("def go():\n  force_mode(p[0,0,0,0,0,0])\nend\n");
  ASSERT_FALSE(program);
  EXPECT_THAT(program.error().message, HasSubstr("force_mode"));
  EXPECT_FALSE(parse_program("movej([1, 2], a=1)\n"));
  EXPECT_FALSE(parse_program("movej([0,0,0,0,0,nan], a=1)\n"));
}

TEST(UrScripts, AreCutAtTheEndOfTheFirstColumn) {
  Scripts sut;
  const std::string text = "def a():\n  x = 1\nend\nmovej([0,0,0,0,0,0])\n\ndef b():\nend";
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  // However the network splits them.
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    Scripts scripts;
    std::vector<std::string> got;
    for (const auto part : {bytes.first(cut), bytes.subspan(cut)}) {
      scripts.append(part);
      while (const auto script = scripts.next()) got.push_back(*script);
    }
    EXPECT_THAT(got, ElementsAre("def a():\n  x = 1\nend\n", "movej([0,0,0,0,0,0])\n"));
  }
}

TEST_F(UrSim, DashboardSaysAndDoesWhatItIsAsked) {
  EXPECT_EQ(answer_dashboard(sut, "robotmode"), "Robotmode: POWER_OFF");
  EXPECT_EQ(answer_dashboard(sut, "SafetyMode"), "Safetymode: NORMAL");
  EXPECT_EQ(answer_dashboard(sut, "brake release"), "Failed to execute: brake release");
  EXPECT_EQ(answer_dashboard(sut, "power on"), "Powering on");
  EXPECT_EQ(answer_dashboard(sut, "running"), "Program running: false");
  EXPECT_EQ(answer_dashboard(sut, "load x.urp"), "File not found: x.urp");
  EXPECT_EQ(answer_dashboard(sut, "close safety popup"), "closing safety popup");
  EXPECT_THAT(answer_dashboard(sut, "nonsense"), HasSubstr("could not understand"));
  EXPECT_THAT(answer_dashboard(sut, "PolyscopeVersion"), HasSubstr("URSoftware 3."));
}

TEST(UrSimESeries, ObeysOnlyInRemoteControl) {
  ExactPlant plant;
  Controller sut(plant, Generation::e_series());
  sut.set_remote_control(false);
  EXPECT_EQ(answer_dashboard(sut, "power on"), "Not in remote control mode");
  EXPECT_EQ(answer_dashboard(sut, "is in remote control"), "false");
  EXPECT_EQ(answer_dashboard(sut, "robotmode"), "Robotmode: POWER_OFF");
}

TEST_F(UrSim, StatesCarryTheKinematics) {
  ur::primary::State state{.kinematics = ur::Dh::ur5()};
  state.q = plant.positions();
  const Bytes bytes = ur::primary::state_packet(state);
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    ur::primary::PacketStream stream;
    stream.append(std::span(bytes).first(cut));
    auto early = stream.next();
    ASSERT_TRUE(early);
    EXPECT_FALSE(*early);
    stream.append(std::span(bytes).subspan(cut));
    auto packet = stream.next();
    ASSERT_TRUE(packet && *packet);
    auto dh = ur::primary::read_kinematics(**packet);
    ASSERT_TRUE(dh && *dh);
    EXPECT_EQ((*dh)->rows[1].a, -0.425);
  }
}

class RobotiqSim : public ::testing::Test {
 protected:
  void let(double seconds) {
    for (double left = seconds; left > 0; left -= 0.008) ASSERT_TRUE(plant.step({}, sut.opening_rate(0.008), 0.008));
  }
  void activate() {
    EXPECT_EQ(sut.answer("SET ACT 1"), "ack");
    let(3.0);
    ASSERT_EQ(sut.answer("GET STA"), "STA 3\n");
  }

  ExactPlant plant;
  Gripper sut{plant};
};

TEST_F(RobotiqSim, ClosesAndOpensOnceToActivate) {
  EXPECT_EQ(sut.answer("GET STA"), "STA 0\n");
  EXPECT_EQ(sut.answer("SET ACT 1"), "ack");
  let(0.3);
  EXPECT_EQ(sut.answer("GET STA"), "STA 1\n");
  EXPECT_LT(plant.opening(), 0.06);
  let(3.0);
  EXPECT_EQ(sut.answer("GET STA"), "STA 3\n");
  EXPECT_NEAR(plant.opening(), robotiq::kStroke, 0.005);
}

TEST_F(RobotiqSim, GoesToARequestAndSaysSo) {
  activate();
  EXPECT_EQ(sut.answer("SET POS 120 SPE 255 FOR 50 GTO 1"), "ack");
  EXPECT_EQ(sut.answer("GET PRE"), "PRE 120\n");
  EXPECT_EQ(sut.answer("GET OBJ"), "OBJ 0\n");
  let(2.0);
  EXPECT_EQ(sut.answer("GET OBJ"), "OBJ 3\n");
  EXPECT_NEAR(plant.opening(), robotiq::opening_of(120), 1e-3);
}

TEST_F(RobotiqSim, SaysWhatItMetAndThatItWasLost) {
  activate();
  plant.narrowest = 0.04;
  sut.answer("SET POS 255 SPE 255 FOR 50 GTO 1");
  let(2.0);
  EXPECT_EQ(sut.answer("GET OBJ"), "OBJ 2\n");
  plant.narrowest = 0.0;
  let(0.05);
  EXPECT_EQ(sut.answer("GET OBJ"), "OBJ 0\n");
  let(2.0);
  EXPECT_EQ(sut.answer("GET OBJ"), "OBJ 3\n");
}

TEST(Robotiq, OpeningsAndPositionsAgree) {
  EXPECT_NEAR(robotiq::opening_of(robotiq::kOpenCount), 0.0849, 1e-4);
  EXPECT_NEAR(robotiq::opening_of(robotiq::kClosedCount), 0.0001, 1e-4);
  for (int position = robotiq::kOpenCount; position <= robotiq::kClosedCount; ++position) {
    EXPECT_EQ(robotiq::position_of(robotiq::opening_of(position)), position);
  }
}

}  // namespace
}  // namespace jostle::robot_bridge::ur_sim
