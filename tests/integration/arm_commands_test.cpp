// An arm that moves, and a commander that says what it should not.

#include <gmock/gmock.h>

#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"
#include "tests/support/arm_parts.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using jostle_msgs::msg::RobotStatus;
using jostle_msgs::msg::VelocityCommand;
using ::testing::HasSubstr;

struct BadCommand {
  const char* name;
  const char* error;  // what the robot says of it
  std::function<void(VelocityCommand&)> spoil;
};

class ArmCommands : public ArmParts {
 protected:
  static constexpr std::uint64_t kNumber = 5;

  // Moves the hand sideways for some seconds, saying so again as commanders do, until it moves.
  void begin_moving() {
    arm = program("jostle_ur_sim", {easy, "--address", address, "--no-eyes"});
    bridge = program("jostle_bridge", {"ur5", "--host", address, "--silence", silence, "--watchdog", "1"});
    ASSERT_TRUE(bridge->says("ready on domain", kPatience)) << bridge->err() << arm->err();
    participant = std::make_unique<wire::Participant>(wire::Participant::open({.domain = domain}).value());
    statuses = std::make_unique<wire::Inbox<RobotStatus>>(*participant, wire::topics::kRobotStatus, 256);
    commands = std::make_unique<wire::Writer<VelocityCommand>>(*participant, wire::topics::kRobotCommand);
    ASSERT_TRUE(commands->wait_for_readers(Clock::now() + kPatience));
    command.epoch(77);
    command.sequence_number(kNumber);
    command.velocities({0.0, 0.06, 0.0, 0.0});
    command.duration(4.0);
    repeats = std::jthread([this](std::stop_token stop) {
      while (!stop.stop_requested()) {
        ASSERT_TRUE(commands->write(command));
        poll(nullptr, 0, 10);  // ms
      }
    });
    onlooker = std::make_unique<Onlooker>(address);
    Onlooker::Sample sample;
    const auto deadline = Clock::now() + kPatience;
    while (sample.fastest < 5 * kStill && Clock::now() < deadline) sample = onlooker->next();
    ASSERT_GE(sample.fastest, 5 * kStill) << bridge->err();
  }

  // Nothing of it is obeyed any more, though it is said again.
  void expect_to_stand() {
    ASSERT_TRUE(commands->write(command));
    const double since = onlooker->next().time;
    for (auto sample = onlooker->next(); sample.time < since + 1.0; sample = onlooker->next()) {
      ASSERT_LT(sample.fastest, kStill) << sample.time - since;
    }
  }

  // What the robot says of a failure.
  Error error() {
    const auto deadline = Clock::now() + kPatience;
    while (const auto status = statuses->take(deadline)) {
      if (!status->error().empty()) return {static_cast<Code>(status->error_code()), status->error()};
    }
    return {Code::kInternal, "nothing"};
  }

  std::unique_ptr<wire::Participant> participant;
  std::unique_ptr<wire::Inbox<RobotStatus>> statuses;
  std::unique_ptr<wire::Writer<VelocityCommand>> commands;
  VelocityCommand command;
  std::jthread repeats;
};

class ArmCommands_Bad : public ArmCommands, public ::testing::WithParamInterface<BadCommand> {};

// The commander is heard all the while: only what it says ends the motion.
TEST_P(ArmCommands_Bad, StopTheMovingArmWithin200Milliseconds) {
  silence = "10";
  ASSERT_NO_FATAL_FAILURE(begin_moving());
  VelocityCommand bad = command;
  bad.sequence_number(kNumber + 1);
  GetParam().spoil(bad);
  repeats = {};
  ASSERT_TRUE(commands->write(bad));
  const double said = onlooker->next().time;
  EXPECT_LT(time_to_stand(said), 0.2) << bridge->err();
  const Error told = error();
  EXPECT_EQ(told.code, Code::kInvalidArgument);
  EXPECT_THAT(told.message, HasSubstr(GetParam().error));
  expect_to_stand();
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
INSTANTIATE_TEST_SUITE_P(
    , ArmCommands_Bad,
    ::testing::Values(BadCommand{"NotFinite", "velocities[0]: got nan", [](auto& bad) { bad.velocities()[0] = kNaN; }},
                      BadCommand{"TooFast", "velocities[1]: got 0.6", [](auto& bad) { bad.velocities()[1] = 0.6; }},
                      BadCommand{"TooLong", "duration: got 600", [](auto& bad) { bad.duration(600); }},
                      BadCommand{"OutOfOrder", "out of order", [](auto& bad) { bad.sequence_number(3); }},
                      BadCommand{"OfAnotherEpoch", "while one of epoch 77 was at work",
                                 [](auto& bad) { bad.epoch(78); }}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_F(ArmCommands, ThatAreLateStopTheMovingArmWithin200Milliseconds) {
  silence = "0.06";  // as it is unless told otherwise
  ASSERT_NO_FATAL_FAILURE(begin_moving());
  repeats = {};
  const double last = onlooker->next().time;
  EXPECT_LT(time_to_stand(last), 0.2) << bridge->err();
  const Error told = error();
  EXPECT_EQ(told.code, Code::kUnavailable);
  EXPECT_THAT(told.message, HasSubstr("was not heard for 60 ms"));
  expect_to_stand();  // what comes late is not obeyed
}

// As rqt_robot_monitor shows it.
TEST_F(ArmCommands, DiagnosticsTellHowArmAndGripperAre) {
  ASSERT_NO_FATAL_FAILURE(begin_moving());
  wire::Inbox<diagnostic_msgs::msg::DiagnosticArray> diagnostics(*participant, wire::topics::kDiagnostics, 16);
  const auto message = diagnostics.take(Clock::now() + kPatience);
  ASSERT_TRUE(message);
  ASSERT_EQ(message->status().size(), 2u);
  EXPECT_GT(message->header().stamp().sec(), 1'600'000'000);
  for (const auto& status : message->status()) {
    EXPECT_EQ(status.level(), diagnostic_msgs::msg::DiagnosticStatus_Constants::OK) << status.message();
    EXPECT_EQ(status.message(), "ready");
    EXPECT_EQ(status.hardware_id(), address);
  }
  std::map<std::string, std::string> values;
  for (const auto& value : message->status().front().values()) values[value.key()] = value.value();
  EXPECT_EQ(message->status().front().name(), "ur5: arm");
  EXPECT_EQ(values["robot mode"], "RUNNING");
  EXPECT_EQ(values["safety mode"], "NORMAL");
  EXPECT_EQ(values["program"], "running");
  EXPECT_EQ(values["calibration: hand off by, mm"], "0.00") << "the simulated arm is as drawn";
  EXPECT_EQ(message->status().back().name(), "ur5: gripper");
}

}  // namespace
}  // namespace jostle::tests
