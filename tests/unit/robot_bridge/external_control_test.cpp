// The contracts of programs that other clients upload: external control over three sockets, and registers obeyed one
// command at a time.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <cmath>

#include "robot_bridge/ur_sim/external_control.hpp"
#include "tests/support/exact_plant.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

using ::testing::ElementsAre;
using tests::ExactPlant;

constexpr int kServo = 1, kSpeed = 2, kForward = 3, kIdle = 0, kStop = -2;

class Contracts : public ::testing::Test {
 protected:
  void let(double seconds) {
    for (double left = seconds; left > 1e-9; left -= controller.generation().cycle) {
      context.restart();
      context.poll();
      sut.tick();
      ASSERT_TRUE(controller.tick());
    }
  }

  void switch_on() {
    controller.power_on();
    let(1.1);
    controller.brake_release();
    let(0.6);
    ASSERT_EQ(controller.robot_mode(), ur::RobotMode::kRunning);
  }

  double speed(std::size_t joint) const { return plant.velocities()[joint]; }

  boost::asio::io_context context{1};
  ExactPlant plant;
  Controller controller{plant, Generation::e_series()};
  ExternalControl sut{context, controller};
};

// Who commands, with its three ports.
class ExternalDriver : public Contracts {
 protected:
  ExternalDriver() {
    for (int i = 0; i < 3; ++i) {
      auto server = net::TcpServer::listen(context, "127.0.0.1", 0, [this, i](const auto& peer) {
        order.push_back(i);
        peers[i] = peer;
        peer->start({.on_bytes = [this, i](auto bytes) { heard[i].insert(heard[i].end(), bytes.begin(), bytes.end()); },
                     .on_end = [this, i] { peers[i].reset(); }});
      });
      if (!server) throw std::runtime_error(server.error().message);
      servers[i] = std::move(server).value();
    }
    switch_on();
    auto program =
        parse_program(fmt::format("def externalControl():\n"
                                  "  socket_open(\"127.0.0.1\", {}, \"trajectory_socket\")\n"
                                  "  socket_open(\"127.0.0.1\", {}, \"script_command_socket\")\n"
                                  "  socket_open(\"127.0.0.1\", {}, \"reverse_socket\")\n"
                                  "  x = read_input_integer_register(0)\nend\n",
                                  servers[0]->port(), servers[1]->port(), servers[2]->port()));
    if (!program) throw std::runtime_error(program.error().message);
    controller.run(*program);
    for (int i = 0; i < 1000 && order.size() < 3; ++i) let(0.002);
  }
  ~ExternalDriver() override {
    for (auto& peer : peers) {
      if (peer) peer->abandon();
    }
  }

  void send(int timeout_ms, const std::array<double, 6>& values, int mode) {
    BigEndianWriter out;
    out.put(std::int32_t{timeout_ms});
    for (const double value : values) out.put(static_cast<std::int32_t>(std::lround(value * 1e6)));
    out.put(std::int32_t{mode});
    peers[2]->send(out.bytes());
  }
  void send_raw(const std::array<std::int32_t, 8>& words) { peers[2]->send(BigEndianWriter().put(words).bytes()); }
  void send_point(const Joints& q, const Joints& qd, const Joints& qdd, double duration, int blend_or_kind, int type) {
    BigEndianWriter out;
    for (const Joints& part : {q, qd, qdd}) {
      for (const double value : part) out.put(static_cast<std::int32_t>(std::lround(value * 1e6)));
    }
    out.put(static_cast<std::int32_t>(std::lround(duration * 1e6)))
        .put(std::int32_t{blend_or_kind})
        .put(std::int32_t{type});
    peers[0]->send(out.bytes());
  }

  std::array<std::unique_ptr<net::TcpServer>, 3> servers;
  std::array<std::shared_ptr<net::Peer>, 3> peers;
  std::array<Bytes, 3> heard;
  std::vector<int> order;
};

TEST_F(ExternalDriver, IsConnectedToInOrder) { EXPECT_THAT(order, ElementsAre(0, 1, 2)); }

TEST_F(ExternalDriver, SpeedsAreObeyedUntilTheyStopComing) {
  for (int i = 0; i < 100; ++i) {
    send(20, {0.3, 0, 0, 0, 0, -0.1}, kSpeed);
    let(0.002);
  }
  EXPECT_NEAR(speed(0), 0.3, 0.01);
  EXPECT_NEAR(speed(5), -0.1, 0.01);
  let(0.15);
  EXPECT_LT(std::abs(speed(0)), 0.01);
  EXPECT_FALSE(controller.is_running());
  EXPECT_FALSE(peers[2]);  // it hung up
}

TEST_F(ExternalDriver, ServoTargetsAreFollowed) {
  Joints q = plant.positions();
  for (int i = 0; i < 500; ++i) {
    q[0] += 0.0005;
    send(20, q, kServo);
    let(0.002);
  }
  EXPECT_NEAR(plant.positions()[0], q[0], 0.02);
  EXPECT_NEAR(speed(0), 0.25, 0.02);
  // One that nobody could reach in a cycle is ignored.
  Joints far = q;
  far[1] += 1.0;
  send(20, far, kServo);
  let(0.002);
  EXPECT_LT(std::abs(speed(1)), 0.01);
}

TEST_F(ExternalDriver, IdleKeepsTheProgramAndStopEndsIt) {
  for (int i = 0; i < 20; ++i) {
    send(0, {}, kIdle);
    let(0.1);
  }
  EXPECT_TRUE(controller.is_running());
  send(0, {}, kStop);
  let(0.1);
  EXPECT_FALSE(controller.is_running());
}

TEST_F(ExternalDriver, TrajectoriesAreMovedThroughAndAnswered) {
  const Joints start = plant.positions();
  Joints one = start, two = start;
  one[0] += 0.2;
  two[0] += 0.2;
  two[1] -= 0.1;
  send_raw({0, 1, 3, 0, 0, 0, 0, kForward});
  send_point(one, {}, {1.0, 2.0, 0, 0, 0, 0}, 0.0, 0, 0);  // movej by speed
  send_point(two, {}, {}, 1.0, 1, 51);                     // cubic
  send_point(start, {}, {}, 1.0, 2, 51);                   // quintic
  for (int i = 0; i < 10 && plant.positions()[0] < one[0] - 0.02; ++i) let(0.2);
  EXPECT_NEAR(plant.positions()[0], one[0], 0.05);
  let(4.0);
  EXPECT_NEAR(plant.positions()[0], start[0], 1e-3);
  EXPECT_NEAR(plant.positions()[1], start[1], 1e-3);
  EXPECT_EQ(heard[0], (Bytes{0, 0, 0, 0}));
  // Cancelled in the middle.
  send_raw({0, 1, 1, 0, 0, 0, 0, kForward});
  send_point(one, {}, {}, 2.0, 1, 51);
  let(0.5);
  send_raw({0, -1, 0, 0, 0, 0, 0, kForward});
  let(0.5);
  EXPECT_EQ(heard[0], (Bytes{0, 0, 0, 0, 0, 0, 0, 1}));
  EXPECT_LT(std::abs(speed(0)), 0.01);
}

// Packets that the network cuts anywhere.
TEST_F(ExternalDriver, PacketsAreUnderstoodHoweverTheyAreCut) {
  const Bytes packet = BigEndianWriter().put(std::array<std::int32_t, 8>{0, 200'000, 0, 0, 0, 0, 0, kSpeed}).take();
  for (std::size_t cut = 1; cut < packet.size(); ++cut) {
    peers[2]->send(std::span(packet).first(cut));
    let(0.002);
    peers[2]->send(std::span(packet).subspan(cut));
    let(0.02);
    EXPECT_NEAR(speed(0), 0.2, 0.1) << cut;
  }
}

// The contract of registers, one command at a time, with the registers' offset in the text.
class RegisterClient : public Contracts {
 protected:
  void start(int offset) {
    base = offset;
    switch_on();
    auto program =
        parse_program(fmt::format("def rtde_control():\n"
                                  "  reg_offset_int = {}\n  reg_offset_float = {}\n"
                                  "  def read(i):\n    return read_input_integer_register(i + reg_offset_int)\n  end\n"
                                  "end\n",
                                  offset, offset));
    ASSERT_TRUE(program) << program.error().message;
    EXPECT_EQ(program->registers, offset);
    EXPECT_FALSE(program->streams);
    controller.run(*program);
    let(0.01);
    ASSERT_EQ(state(), 1);
  }
  int state() const { return std::get<std::int32_t>(*controller.output(fmt::format("output_int_register_{}", base))); }
  void command(int code, const std::vector<double>& arguments, int asynchronous = 0) {
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      controller.set_input(fmt::format("input_double_register_{}", base + static_cast<int>(i)), arguments[i]);
    }
    controller.set_input(fmt::format("input_int_register_{}", base + 1), std::int32_t{asynchronous});
    controller.set_input(fmt::format("input_int_register_{}", base), std::int32_t{code});
  }
  void clear() {
    controller.set_input(fmt::format("input_int_register_{}", base), std::int32_t{0});
    let(0.004);
    EXPECT_EQ(state(), 1);
  }

  int base = 0;
};

TEST_F(RegisterClient, MovesAreDoneWhenTheyAreThere) {
  for (const int offset : {0, 24}) {
    start(offset);
    Joints q = plant.positions();
    q[0] += 0.3;
    command(1, {q[0], q[1], q[2], q[3], q[4], q[5], 1.0, 2.0});
    let(0.2);
    EXPECT_NE(state(), 2);
    let(1.0);
    EXPECT_EQ(state(), 2);
    EXPECT_NEAR(plant.positions()[0], q[0], 1e-3);
    clear();
    q[0] -= 0.3;
    command(1, {q[0], q[1], q[2], q[3], q[4], q[5], 1.0, 2.0}, 1);
    let(0.01);
    EXPECT_EQ(state(), 2);  // it is not waited for
    let(1.0);
    EXPECT_NEAR(plant.positions()[0], q[0], 1e-3);
    clear();
    controller.power_off();
    let(0.1);
  }
}

TEST_F(RegisterClient, StraightLinesEndAtTheirPose) {
  start(0);
  const auto X = ur::flange_pose(ur::Dh::ur5(), plant.positions());
  const Eigen::AngleAxisd turn(X.linear());
  const Eigen::Vector3d p = X.translation() + Eigen::Vector3d(0, 0, 0.1), r = turn.angle() * turn.axis();
  command(3, {p.x(), p.y(), p.z(), r.x(), r.y(), r.z(), 0.25, 1.2});
  let(2.0);
  EXPECT_EQ(state(), 2);
  const auto there = ur::flange_pose(ur::Dh::ur5(), plant.positions());
  EXPECT_LT((there.translation() - p).norm(), 1e-3);
  EXPECT_LT(Eigen::AngleAxisd(there.linear().transpose() * X.linear()).angle(), 1e-3);
}

TEST_F(RegisterClient, SpeedsAreAcknowledgedAndStopped) {
  start(0);
  for (int i = 0; i < 100; ++i) {
    command(9, {0.4, 0, 0, 0, 0, 0, 5.0, 0.01});
    let(0.004);
    EXPECT_EQ(state(), 1);
    clear();
  }
  EXPECT_NEAR(speed(0), 0.4, 0.02);
  command(15, {10.0});
  let(0.3);
  EXPECT_EQ(state(), 2);
  EXPECT_LT(std::abs(speed(0)), 0.01);
}

}  // namespace
}  // namespace jostle::robot_bridge::ur_sim
