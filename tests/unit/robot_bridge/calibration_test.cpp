// An arm's calibration, as its controller tells it.

#include "robot_bridge/ur/calibration.hpp"

#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <cmath>
#include <thread>

#include "robot_bridge/ur_sim/script_server.hpp"
#include "tests/support/exact_plant.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

using namespace std::chrono_literals;
using net::Clock;
using ::testing::HasSubstr;

const planar::Mounting kMounting;

TEST(Calibration, OfAnArmAsDrawnIsNowhereOff) {
  const ur::CalibrationError off = ur::compare(ur::Dh::ur5(), kMounting);
  EXPECT_EQ(off.distance, 0.0);
  EXPECT_LT(off.angle, 1e-7);  // what an angle of a rotation's matrix loses
}

TEST(Calibration, ShoulderThatIsHigherPutsTheHandAsMuchHigher) {
  ur::Dh dh = ur::Dh::ur5();
  dh.rows[0].d += 0.002;
  EXPECT_NEAR(ur::compare(dh, kMounting).distance, 0.002, 1e-12);
}

TEST(Calibration, BaseThatIsTurnedTurnsTheHandAsMuchAndFarthestAtItsLongestReach) {
  ur::Dh dh = ur::Dh::ur5();
  dh.rows[0].theta = 0.001;
  const ur::CalibrationError off = ur::compare(dh, kMounting);
  EXPECT_NEAR(off.angle, 0.001, 1e-6);
  EXPECT_GT(off.distance, 0.0009);  // 0.9 to 1.05 m from the base
  EXPECT_LT(off.distance, 0.00105);
}

// Makers write axes that are nearly parallel as far away and back: such numbers say nothing by themselves.
TEST(Calibration, ShoulderAndElbowThatAreMovedAlongTheirCommonAxisAndBackAreNoError) {
  ur::Dh dh = ur::Dh::ur5();
  dh.rows[1].d += 300.0;
  dh.rows[2].d -= 300.0;
  EXPECT_TRUE(ur::check_calibration(dh, kMounting));
}

TEST(Calibration, OfAnotherArmIsRefused) {
  ur::Dh longer = ur::Dh::ur5();
  longer.rows[1].a = -0.612;  // a UR10's
  const auto checked = ur::check_calibration(longer, kMounting);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().code, Code::kInvalidArgument);
  EXPECT_THAT(checked.error().message, HasSubstr("wanted at most 8 mm"));
}

class CalibrationLink : public ::testing::Test {
 protected:
  CalibrationLink() {
    server_ = ScriptServer::listen(context_, controller, "127.0.0.1", 0, false).value();
    port = server_->port();
  }

  // Time goes on for as long as somebody reads.
  Result<ur::Dh> read(std::chrono::milliseconds patience) {
    std::jthread ticks([this](std::stop_token stop) {
      while (!stop.stop_requested()) {
        context_.restart();
        context_.run_for(1ms);
        if (!controller.tick()) return;
        server_->publish();
      }
    });
    return ur::read_calibration("127.0.0.1", port, Clock::now() + patience);
  }

  tests::ExactPlant plant;
  Controller controller{plant, Generation::cb3()};
  std::uint16_t port = 0;

 private:
  boost::asio::io_context context_{1};
  std::unique_ptr<ScriptServer> server_;
};

TEST_F(CalibrationLink, IsReadToTheLastBit) {
  for (std::size_t j = 0; j < 6; ++j) {
    controller.kinematics.rows[j].a += 1e-4 * static_cast<double>(j + 1);
    controller.kinematics.rows[j].d -= 1e-5;
    controller.kinematics.rows[j].alpha += 1e-6;
    controller.kinematics.rows[j].theta = 1e-3 * static_cast<double>(j);
  }
  const auto dh = read(20s);
  ASSERT_TRUE(dh) << dh.error().message;
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_EQ(dh->rows[j].a, controller.kinematics.rows[j].a);
    EXPECT_EQ(dh->rows[j].d, controller.kinematics.rows[j].d);
    EXPECT_EQ(dh->rows[j].alpha, controller.kinematics.rows[j].alpha);
    EXPECT_EQ(dh->rows[j].theta, controller.kinematics.rows[j].theta);
  }
}

TEST_F(CalibrationLink, ThatIsNotFiniteIsNone) {
  controller.kinematics.rows[3].d = std::nan("");
  const auto dh = read(20s);
  ASSERT_FALSE(dh);
  EXPECT_THAT(dh.error().message, HasSubstr("kinematics of joint 3: got nan"));
}

TEST(CalibrationLinkOfNobody, IsUnavailable) {
  const auto dh = ur::read_calibration("127.0.0.1", 1, Clock::now() + 5s);
  ASSERT_FALSE(dh);
  EXPECT_EQ(dh.error().code, Code::kUnavailable);
}

}  // namespace
}  // namespace jostle::robot_bridge::ur_sim
