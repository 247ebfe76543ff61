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
    arm = program("jostle_ur_sim", {easy, "--address", address});
    bridge = program("jostle_bridge", {"ur5", "--host", address});
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
  std::unique_ptr<ProgramProcess> arm, bridge, coordinator, worker, goal;
  std::unique_ptr<Onlooker> onlooker;
};

class ArmParts_Deaths : public ArmParts, public ::testing::WithParamInterface<int> {};

// By the controller's own clock, whatever this machine does meanwhile.
TEST_P(ArmParts_Deaths, OfTheBridgeStopTheArmWithin200Milliseconds) {
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

TEST_F(ArmRun, OfAPusherIsRefusedByTheRobotsName) {
  const std::string push = folder.path() / "push.yaml";
  ASSERT_EQ(program("jostle_scene", {"generate", "--chapter", "6", "-o", push})->wait(kPatience), 0);
  start({push, "--arm", "ur-sim"});
  EXPECT_NE(run->wait(kPatience), 0);
  EXPECT_THAT(run->err(), HasSubstr("wanted planar_gripper"));
  const auto wrong = program("jostle_run", {easy, "--arm", "ur6"});
  EXPECT_EQ(wrong->wait(kPatience), 2);
  EXPECT_THAT(wrong->err(), HasSubstr("wanted sim, ur-sim or ur:HOST"));
}

}  // namespace
}  // namespace jostle::tests
