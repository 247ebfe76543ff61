// An arm behind its own protocols: coordinator, DDS, bridge, RTDE, a simulated controller with physics, a gripper by
// its socket. All of them processes of their own.

#include <gmock/gmock.h>

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "robot_bridge/net/tcp_client.hpp"
#include "robot_bridge/ur/rtde.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using robot_bridge::net::TcpClient;
using ::testing::HasSubstr;
namespace rtde = robot_bridge::ur::rtde;
using Clock = robot_bridge::net::Clock;

constexpr double kStill = 0.01;  // rad/s
constexpr std::uint16_t kPendant = 29990;

// Listens to a controller, and commands nothing.
class Onlooker {
 public:
  explicit Onlooker(const std::string& address) {
    soon(kPatience, [&] {
      auto tcp = TcpClient::connect(address, rtde::kPort, Clock::now() + 1s);
      if (tcp) tcp_.emplace(std::move(*tcp));
      return tcp_.has_value();
    });
    if (!tcp_) throw std::runtime_error("no controller at " + address);
    for (const auto& packet :
         {rtde::protocol_request(2), rtde::outputs_request(125, {"timestamp", "actual_qd"}), rtde::start_request()}) {
      if (!tcp_->write(rtde::encode(packet), Clock::now() + kPatience)) throw std::runtime_error("it does not listen");
    }
  }

  struct Sample {
    double time = 0.0, fastest = 0.0;  // s of the controller, rad/s of the fastest joint
  };
  Sample next() {
    std::array<std::uint8_t, 4096> room;
    for (;;) {
      auto packet = stream_.next();
      if (!packet) throw std::runtime_error(packet.error().message);
      if (*packet && (*packet)->type == rtde::PacketType::kData) {
        BigEndianReader in((*packet)->payload);
        (void)in.get<std::uint8_t>();
        Sample sample{.time = in.get<double>()};
        for (const double v : in.get_array<double, 6>()) sample.fastest = std::max(sample.fastest, std::abs(v));
        return sample;
      }
      if (*packet) continue;
      auto bytes = tcp_->read(room, Clock::now() + kPatience);
      if (!bytes) throw std::runtime_error(bytes.error().message);
      stream_.append(*bytes);
    }
  }

 private:
  std::optional<TcpClient> tcp_;
  rtde::PacketStream stream_;
};

class ArmRun : public RunFixture {
 protected:
  void start_arm(std::vector<std::string> more = {}) {
    more.insert(more.begin(), {easy, "--arm", "ur-sim", "--workers", "2", "--parameters", plain});
    start(std::move(more));
  }
  const std::string address = fmt::format("127.0.1.{}", domain + 1);
};

TEST_F(ArmRun, GraspsIsRecordedAndReplaysBitEqual) {
  const std::string bag = folder.path() / "bag", picture = folder.path() / "picture.png",
                    report = folder.path() / "run.json";
  start_arm({"--record", bag, "--picture", picture, "--json", report});
  ASSERT_EQ(run->wait(2 * kPatience), 0) << run->err() << log("bridge.log") << log("ur_sim.log");

  const auto result = nlohmann::json::parse(contents(report));
  EXPECT_TRUE(result["success"]);
  EXPECT_GT(result["actions"], 1);
  EXPECT_TRUE(std::filesystem::file_size(picture) > 1000);
  const auto replay = program("jostle_replay", {bag});
  EXPECT_EQ(replay->wait(kPatience), 0) << replay->out() << replay->err();
  EXPECT_THAT(replay->out(), HasSubstr("BIT-EQUAL"));
}

// A system whose parts were started one by one, so that each may die alone.
class ArmParts : public RunFixture {
 protected:
  // Until the arm moves towards the target; returns the onlooker's newest sample.
  Onlooker::Sample start_moving() {
    arm = program("jostle_ur_sim", {easy, "--address", address, "--pendant", std::to_string(kPendant)});
    bridge = program("jostle_bridge", {"ur5", "--host", address, "--silence", silence, "--watchdog", watchdog});
    coordinator = program("jostle_coordinator", {});
    worker = program("jostle_worker", {"--threads", "2"});
    EXPECT_TRUE(bridge->says("ready on domain", kPatience)) << bridge->err() << arm->err();
    goal = program("jostle_goal", {easy, "--parameters", plain, "--headless"});
    onlooker = std::make_unique<Onlooker>(address);
    Onlooker::Sample sample;
    const auto deadline = Clock::now() + kPatience;
    while (sample.fastest < 5 * kStill && Clock::now() < deadline) sample = onlooker->next();
    EXPECT_GE(sample.fastest, 5 * kStill) << goal->err() << coordinator->err() << bridge->err();
    return sample;
  }

  // Seconds of the controller's clock until it stands still; at most 3.
  double time_to_stand(double since) {
    Onlooker::Sample sample;
    do sample = onlooker->next();
    while (sample.fastest > kStill && sample.time < since + 3.0);
    return sample.time - since;
  }

  const std::string address = fmt::format("127.0.1.{}", domain + 1);
  std::string silence = "1", watchdog = "1";  // s: on a busy machine a commander and a bridge may be late
  std::unique_ptr<ProgramProcess> arm, bridge, coordinator, worker, goal;
  std::unique_ptr<Onlooker> onlooker;
};

class ArmParts_Deaths : public ArmParts, public ::testing::WithParamInterface<int> {};

// By the controller's own clock, whatever this machine does meanwhile.
TEST_P(ArmParts_Deaths, OfTheBridgeStopTheArmWithin200Milliseconds) {
  watchdog = "0.067";  // as it is unless told otherwise
  start_moving();
  bridge->signal(GetParam());
  const double dead = onlooker->next().time;
  EXPECT_LT(time_to_stand(dead), 0.2);
  if (GetParam() == SIGSTOP) {
    // Back again, it sends nothing that is old.
    bridge->signal(SIGCONT);
    const double back = onlooker->next().time;
    for (auto sample = onlooker->next(); sample.time < back + 1.0; sample = onlooker->next()) {
      ASSERT_LT(sample.fastest, kStill) << sample.time - back;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(, ArmParts_Deaths, ::testing::Values(SIGKILL, SIGSTOP, SIGTERM));

class ArmParts_Coordinators : public ArmParts, public ::testing::WithParamInterface<int> {};

// Whoever commands the bridge is silent.
TEST_P(ArmParts_Coordinators, DeathStopsTheArmWithin200Milliseconds) {
  silence = "0.07";  // as it is unless told otherwise
  start_moving();
  coordinator->signal(GetParam());
  const double dead = onlooker->next().time;
  EXPECT_LT(time_to_stand(dead), 0.2);
  EXPECT_FALSE(bridge->code());  // it waits for the next one
}
INSTANTIATE_TEST_SUITE_P(, ArmParts_Coordinators, ::testing::Values(SIGKILL, SIGSTOP));

class ArmParts_Stops : public ArmParts, public ::testing::WithParamInterface<const char*> {
 protected:
  void press(const std::string& button) {
    auto tcp = TcpClient::connect(address, kPendant, Clock::now() + kPatience);
    ASSERT_TRUE(tcp) << tcp.error().message;
    ASSERT_TRUE(tcp->write(button + "\n", Clock::now() + kPatience));
    EXPECT_EQ(tcp->read_line(Clock::now() + kPatience).value(), "ok");
  }

  // How fast it moves at most until the bridge has it ready again.
  double fastest_until_ready() {
    double most = 0.0;
    soon(kPatience, [&] {
      const auto sample = onlooker->next();
      most = std::max(most, sample.fastest);
      return count(bridge->err(), "the arm is ready again") > 0;
    });
    return most;
  }
  static int count(const std::string& text, const std::string& word) {
    int found = 0;
    for (auto at = text.find(word); at != text.npos; at = text.find(word, at + 1)) ++found;
    return found;
  }
};

// The run ends with the reason; the bridge gets the arm ready again, which does not move meanwhile; and the next run
// grasps.
TEST_P(ArmParts_Stops, EndTheRunAndTheNextOneGrasps) {
  const std::string button = GetParam();
  const double moving = start_moving().time;
  press(button);
  if (button != "reboot") {
    EXPECT_LT(time_to_stand(moving), 1.0);
  }
  EXPECT_EQ(goal->wait(kPatience), 3) << goal->err();
  EXPECT_THAT(goal->err(), HasSubstr("robot: "));
  if (button == "emergency stop") press("restart safety");
  if (button == "reboot") onlooker = std::make_unique<Onlooker>(address);
  EXPECT_LT(fastest_until_ready(), button == "reboot" ? 10.0 : 5 * kStill);
  ASSERT_EQ(count(bridge->err(), "the arm is ready again"), 1) << bridge->err() << arm->err();
  const auto next = program("jostle_goal", {easy, "--parameters", plain, "--headless"});
  EXPECT_EQ(next->wait(kPatience), 0) << next->err() << bridge->err() << coordinator->err();
}
INSTANTIATE_TEST_SUITE_P(, ArmParts_Stops, ::testing::Values("protective stop", "emergency stop", "reboot"));

TEST_F(ArmRun, OfAPusherOrAWrongNameIsRefusedAndNobodyIsWaitedForAloud) {
  const std::string push = folder.path() / "push.yaml";
  ASSERT_EQ(program("jostle_scene", {"generate", "--chapter", "6", "-o", push})->wait(kPatience), 0);
  start({push, "--arm", "ur-sim"});
  EXPECT_NE(run->wait(kPatience), 0);
  EXPECT_THAT(run->err(), HasSubstr("wanted planar_gripper"));
  const auto nobody = program("jostle_run", {easy, "--arm", "ur:127.0.3.3", "--headless"});
  EXPECT_TRUE(nobody->says("waiting: 127.0.3.3:30004: connecting: Connection refused", kPatience)) << nobody->err();
  nobody->signal(SIGINT);
  EXPECT_EQ(nobody->wait(kPatience), 130);
  const auto wrong = program("jostle_run", {easy, "--arm", "ur6"});
  EXPECT_EQ(wrong->wait(kPatience), 2);
  EXPECT_THAT(wrong->err(), HasSubstr("wanted sim, ur-sim or ur:HOST"));
}

}  // namespace
}  // namespace jostle::tests
