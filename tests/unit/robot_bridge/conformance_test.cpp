// What is said on the wires of an arm, byte by byte. Each talk is held twice: our client talks to somebody who reads
// the controller's lines from the page, and somebody who reads the client's lines talks to our simulated controller.
// Source: the protocols' published descriptions; no line was recorded from a product.

#include <gmock/gmock.h>

#include <array>
#include <atomic>
#include <bit>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "robot_bridge/robotiq/client.hpp"
#include "robot_bridge/ur/dashboard.hpp"
#include "robot_bridge/ur/rtde_client.hpp"
#include "robot_bridge/ur_sim/dashboard_server.hpp"
#include "robot_bridge/ur_sim/gripper_server.hpp"
#include "robot_bridge/ur_sim/rtde_server.hpp"
#include "tests/support/exact_plant.hpp"
#include "tests/support/soon.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

using namespace std::chrono_literals;
using namespace std::string_literals;
using net::Clock;
using tests::soon;

constexpr auto kPatience = 20s;

struct Line {
  enum class Who { kClient, kController, kWorld };
  Who who = Who::kClient;
  std::string words;
  std::size_t fixed = std::string::npos;          // how many of a controller's bytes the protocol prescribes
  std::function<void(Controller&)> happens = {};  // to the simulated controller
};
using Talk = std::vector<Line>;

Line client(std::string words) { return {.who = Line::Who::kClient, .words = std::move(words)}; }
Line controller(std::string words, std::size_t fixed = std::string::npos) {
  return {.who = Line::Who::kController, .words = std::move(words), .fixed = fixed};
}
Line passes(double seconds) {
  return {.who = Line::Who::kWorld, .words = {}, .happens = [seconds](Controller& sut) {
            for (double left = seconds; left > 0; left -= sut.generation().cycle) ASSERT_TRUE(sut.tick());
          }};
}

// --- RTDE ---------------------------------------------------------------------------

// By hand: what is tested must not write its own page.
std::string packet(char type, const std::string& payload) {
  const std::size_t size = payload.size() + 3;
  return std::string{static_cast<char>(size >> 8), static_cast<char>(size & 0xFF), type} + payload;
}
std::string big_endian(std::uint64_t bits, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(bits >> (8 * i) & 0xFF);
  return text;
}
std::string number(double value) { return big_endian(std::bit_cast<std::uint64_t>(value), 8); }
std::string number(int value) { return big_endian(static_cast<std::uint32_t>(value), 4); }

const std::string kOutputNames =
    "timestamp,actual_q,actual_qd,target_q,robot_mode,safety_mode,runtime_state,speed_scaling,output_int_register_24,"
    "output_int_register_25";
const std::string kOutputTypes = "DOUBLE,VECTOR6D,VECTOR6D,VECTOR6D,INT32,INT32,UINT32,DOUBLE,INT32,INT32";
const std::string kInputNames =
    "input_int_register_24,input_int_register_25,input_double_register_24,input_double_register_25,"
    "input_double_register_26,input_double_register_27,input_double_register_28,input_double_register_29,"
    "input_double_register_30";
const std::string kInputTypes = "INT32,INT32,DOUBLE,DOUBLE,DOUBLE,DOUBLE,DOUBLE,DOUBLE,DOUBLE";
const std::string k125Hz = "\x40\x5F\x40\0\0\0\0\0"s;

// An arm that is switched off, as tests::ExactPlant has it, one cycle of 8 ms after the start of its time, 60 s.
std::string sample() {
  const double q[] = {0, -1.5, 1.5, -1.5, -1.5, 0};
  std::string values = number(60.0 + 0.008);
  for (const double angle : q) values += number(angle);
  for (int j = 0; j < 6; ++j) values += number(0.0);
  for (const double angle : q) values += number(angle);
  return values + number(3) + number(1) + number(1) + number(0.0) + number(0) + number(0);
}
std::string command() {
  std::string values = number(9) + number(1234567);
  for (const double speed : {0.1, -0.2, 0.3, -0.4, 0.5, -0.6}) values += number(speed);
  return values + number(15.0);
}
const std::string kVersion = number(3) + number(15) + number(8) + number(106339);

Talk rtde_2() {
  return {
      client("\0\5V\0\2"s),
      controller("\0\4V\1"s),
      client("\0\3v"s),
      controller("\0\x13v"s + kVersion),
      client(packet('O', k125Hz + kOutputNames)),
      controller(packet('O', "\1" + kOutputTypes)),
      client(packet('I', kInputNames)),
      controller(packet('I', "\1" + kInputTypes)),
      client("\0\3S"s),
      controller("\0\4S\1"s),
      passes(0.008),
      controller("\0\xB8U\1"s + sample()),
      client(packet('U', "\1" + command())),
  };
}

Talk rtde_1() {
  return {
      client("\0\5V\0\2"s),
      controller("\0\4V\0"s),
      client("\0\5V\0\1"s),
      controller("\0\4V\1"s),
      client("\0\3v"s),
      controller("\0\x13v"s + kVersion),
      client(packet('O', kOutputNames)),
      controller(packet('O', kOutputTypes)),
      client(packet('I', kInputNames)),
      controller(packet('I', kInputTypes)),
      client("\0\3S"s),
      controller("\0\4S\1"s),
      passes(0.008),
      controller("\0\xB7U"s + sample()),
      client(packet('U', command())),
  };
}

// --- the others -----------------------------------------------------------------------

const std::string kBanner = "Connected: Universal Robots Dashboard Server\n";

Talk dashboard() {
  return {
      controller(kBanner),
      client("robotmode\n"),
      controller("Robotmode: POWER_OFF\n"),
      client("brake release\n"),
      controller("Failed to execute: brake release\n"),
      client("POWER on\n"),
      controller("Powering on\n"),
      passes(3.0),
      client("robotmode\n"),
      controller("Robotmode: IDLE\n"),
      client("brake release\n"),
      controller("Brake releasing\n"),
      passes(3.0),
      client("robotmode\n"),
      controller("Robotmode: RUNNING\n"),
      client("safetymode\n"),
      controller("Safetymode: NORMAL\n"),
      client("safetystatus\n"),
      controller("Safetystatus: NORMAL\n"),
      client("running\n"),
      controller("Program running: false\n"),
      client("programState\n"),
      controller("STOPPED <unnamed>\n", 8),
      client("get loaded program\n"),
      controller("No program loaded\n"),
      client("load stack.urp\n"),
      controller("File not found: stack.urp\n"),
      client("play\n"),
      controller("Failed to execute: play\n"),
      client("pause\n"),
      controller("Failed to execute: pause\n"),
      client("popup hello\n"),
      controller("showing popup\n"),
      client("close popup\n"),
      controller("closing popup\n"),
      client("addToLog hello\n"),
      controller("Added log message\n"),
      client("PolyscopeVersion\n"),
      controller("URSoftware 3.15.8.106339 (Jan 01 2022)\n", 25),
      client("get robot model\n"),
      controller("UR5\n"),
      client("get serial number\n"),
      controller("20195500001\n", 2),
      {.who = Line::Who::kWorld, .words = {}, .happens = [](Controller& sut) { sut.protective_stop("it was pushed"); }},
      client("safetymode\n"),
      controller("Safetymode: PROTECTIVE_STOP\n"),
      client("close safety popup\n"),
      controller("closing safety popup\n"),
      client("unlock protective stop\n"),
      controller("Cannot unlock protective stop until 5s after occurrence\n", 55),
      passes(5.1),
      client("unlock protective stop\n"),
      controller("Protective stop releasing\n"),
      passes(0.1),
      client("safetymode\n"),
      controller("Safetymode: NORMAL\n"),
      client("power off\n"),
      controller("Powering off\n"),
      client("restart safety\n"),
      controller("Restarting safety\n"),
      client("quit\n"),
      controller("Disconnected\n"),
  };
}

// The last three requests go on for ever.
Talk robotiq() {
  return {
      client("GET STA\n"),        controller("STA 0\n"), client("SET ACT 0\n"),
      controller("ack"),          client("SET ATR 0\n"), controller("ack"),
      client("SET ACT 1\n"),      controller("ack"),     passes(3.0),
      client("GET STA\n"),        controller("STA 3\n"), client("SET POS 120 SPE 255 FOR 100 GTO 1\n"),
      controller("ack"),          passes(3.0),           client("GET POS\n"),
      controller("POS 120\n", 5), client("GET OBJ\n"),   controller("OBJ 3\n"),
      client("GET FLT\n"),        controller("FLT 0\n"),
  };
}

// --- the controller's lines, from the page --------------------------------------------

class Prompter {
 public:
  /// From line `again` on the talk goes on for ever, if there is one.
  explicit Prompter(Talk talk, std::size_t again = std::string::npos) : talk_(std::move(talk)), again_(again) {
    acceptor_.non_blocking(true);
    thread_ = std::jthread([this](std::stop_token stop) { run(stop); });
  }

  std::uint16_t port() const { return acceptor_.local_endpoint().port(); }
  bool is_done() const { return done_; }
  /// What the client said that is not on the page; once it is done, or has gone.
  std::string trouble() {
    thread_.request_stop();
    if (thread_.joinable()) thread_.join();
    return trouble_;
  }

 private:
  void run(const std::stop_token& stop) {
    boost::asio::ip::tcp::socket socket(context_);
    boost::system::error_code code;
    const auto waits = [&] {
      poll(nullptr, 0, 1);
      return !stop.stop_requested();
    };
    for (acceptor_.accept(socket, code); code; acceptor_.accept(socket, code)) {
      if (!waits()) return;
    }
    socket.non_blocking(true, code);
    for (std::size_t i = 0; i < talk_.size();) {
      const Line& line = talk_[i];
      if (line.who == Line::Who::kController) {
        (void)socket.send(boost::asio::buffer(line.words), 0, code);
      } else if (line.who == Line::Who::kClient) {
        std::string heard(line.words.size(), '\0');
        for (std::size_t at = 0; at < heard.size();) {
          const std::size_t more = socket.receive(boost::asio::buffer(heard.data() + at, heard.size() - at), 0, code);
          at += more;
          if (code && code != boost::asio::error::would_block) {
            trouble_ = "the client has gone before line " + std::to_string(i);
            return;
          }
          if (more == 0 && !waits()) return;
        }
        if (heard != line.words) {
          trouble_ = "line " + std::to_string(i) + ": got " + testing::PrintToString(heard) + ", wanted " +
                     testing::PrintToString(line.words);
          return;
        }
      }
      if (++i < talk_.size()) continue;
      done_ = true;
      if (again_ < talk_.size()) i = again_;
    }
    while (waits()) {
    }
  }

  const Talk talk_;
  const std::size_t again_;
  boost::asio::io_context context_;
  boost::asio::ip::tcp::acceptor acceptor_{context_,
                                           boost::asio::ip::tcp::endpoint(boost::asio::ip::address_v4::loopback(), 0)};
  std::atomic<bool> done_ = false;
  std::string trouble_;
  std::jthread thread_;  // last: it uses all of the above
};

// --- the client's lines, from the page ------------------------------------------------

class Simulator {
 public:
  explicit Simulator(const Generation& generation) : controller(plant, generation) {
    controller.opening_rate = [this](double dt) { return gripper.opening_rate(dt); };
  }

  /// Says the client's lines to a port, and expects the controller's.
  void hold(const Talk& talk, std::uint16_t port) {
    auto tcp = net::TcpClient::connect("127.0.0.1", port, Clock::now() + kPatience);
    ASSERT_TRUE(tcp) << tcp.error().message;
    for (std::size_t i = 0; i < talk.size(); ++i) {
      const Line& line = talk[i];
      switch (line.who) {
        case Line::Who::kClient:
          ASSERT_TRUE(tcp->write(line.words, Clock::now() + kPatience));
          break;
        case Line::Who::kWorld:
          context.restart();
          context.poll();
          line.happens(controller);
          if (rtde) rtde->publish();
          break;
        case Line::Who::kController:
          ASSERT_EQ(heard(*tcp, line), line.words) << "line " << i;
      }
    }
    context.restart();
    for (const auto end = Clock::now() + 50ms; Clock::now() < end;) context.poll();  // the last words of the client
  }

  tests::ExactPlant plant;
  Controller controller;
  Gripper gripper{plant};
  boost::asio::io_context context{1};
  std::unique_ptr<RtdeServer> rtde;
  std::unique_ptr<net::TcpServer> lines;

 private:
  // As many bytes as the page has, or a line whose end the protocol does not prescribe: that is put there.
  std::string heard(net::TcpClient& tcp, const Line& line) {
    std::string text;
    const bool is_open = line.fixed != std::string::npos;
    const auto is_whole = [&] { return is_open ? text.ends_with('\n') : text.size() == line.words.size(); };
    soon(kPatience, [&] {
      context.restart();
      context.poll();
      std::array<std::uint8_t, 1> room;
      while (!is_whole()) {
        const auto bytes = tcp.read(room, Clock::now());
        if (!bytes) return bytes.error().code != Code::kDeadline;
        text.append(bytes->begin(), bytes->end());
      }
      return true;
    });
    return is_open ? text.substr(0, line.fixed) + line.words.substr(line.fixed) : text;
  }
};

template <class T>
void take(Result<T> result, T& place) {
  ASSERT_TRUE(result) << result.error().message;
  place = std::move(result).value();
}

// --- the suite -------------------------------------------------------------------------

class RtdeConformance : public ::testing::TestWithParam<ur::rtde::Version> {
 protected:
  Talk talk() const { return GetParam() == ur::rtde::Version::k2 ? rtde_2() : rtde_1(); }
};

TEST_P(RtdeConformance, OfTheClient) {
  Prompter prompter(talk());
  auto sut = ur::RtdeClient::connect("127.0.0.1", prompter.port(), 0.0, Clock::now() + kPatience);
  ASSERT_TRUE(sut) << sut.error().message << prompter.trouble();
  EXPECT_EQ(sut->protocol(), GetParam());
  EXPECT_EQ(sut->version(), (ur::rtde::ControllerVersion{3, 15, 8, 106339}));
  const auto state = sut->next(Clock::now() + kPatience);
  ASSERT_TRUE(state) << state.error().message;
  EXPECT_EQ(state->timestamp, 60.0 + 0.008);
  EXPECT_EQ(state->q, (ur::Joints{0, -1.5, 1.5, -1.5, -1.5, 0}));
  EXPECT_EQ(state->qd, ur::Joints{});
  EXPECT_EQ(state->q_target, state->q);
  EXPECT_EQ(state->robot_mode, ur::RobotMode::kPowerOff);
  EXPECT_EQ(state->safety_mode, ur::SafetyMode::kNormal);
  EXPECT_EQ(state->runtime_state, ur::RuntimeState::kStopped);
  ASSERT_TRUE(sut->send({.command = ur::contract::kSpeeds,
                         .number = 1234567,
                         .values = {0.1, -0.2, 0.3, -0.4, 0.5, -0.6},
                         .acceleration = 15.0},
                        Clock::now() + kPatience));
  EXPECT_TRUE(soon(kPatience, [&] { return prompter.is_done(); }));
  EXPECT_EQ(prompter.trouble(), "");
}

TEST_P(RtdeConformance, OfTheSimulatedController) {
  Generation generation = Generation::cb3();
  generation.newest_rtde = GetParam();
  Simulator sut(generation);
  take(RtdeServer::listen(sut.context, sut.controller, "127.0.0.1", 0), sut.rtde);
  sut.hold(talk(), sut.rtde->port());
  EXPECT_EQ(sut.controller.output("input_int_register_24"), ur::rtde::Value(std::int32_t{9}));
  EXPECT_EQ(sut.controller.output("input_int_register_25"), ur::rtde::Value(std::int32_t{1234567}));
  EXPECT_EQ(sut.controller.output("input_double_register_29"), ur::rtde::Value(-0.6));
  EXPECT_EQ(sut.controller.output("input_double_register_30"), ur::rtde::Value(15.0));
}
INSTANTIATE_TEST_SUITE_P(, RtdeConformance, ::testing::Values(ur::rtde::Version::k1, ur::rtde::Version::k2),
                         [](const auto& test) { return "Version" + std::to_string(static_cast<int>(test.param)); });

TEST(DashboardConformance, OfTheClient) {
  const Talk talk = dashboard();
  Prompter prompter(talk);
  auto sut = ur::Dashboard::connect("127.0.0.1", prompter.port(), Clock::now() + kPatience);
  ASSERT_TRUE(sut) << sut.error().message;
  for (std::size_t i = 1; i < talk.size(); ++i) {
    if (talk[i].who != Line::Who::kClient) continue;
    const auto reply = sut->ask(talk[i].words.substr(0, talk[i].words.size() - 1), kPatience);
    ASSERT_TRUE(reply) << reply.error().message << prompter.trouble();
    EXPECT_EQ(*reply + "\n", talk[i + 1].words);
  }
  EXPECT_TRUE(soon(kPatience, [&] { return prompter.is_done(); }));
  EXPECT_EQ(prompter.trouble(), "");
}

TEST(DashboardConformance, OfTheSimulatedController) {
  Simulator sut(Generation::cb3());
  take(serve_dashboard(sut.context, sut.controller, "127.0.0.1", 0), sut.lines);
  sut.hold(dashboard(), sut.lines->port());
}

TEST(RobotiqConformance, OfTheClient) {
  const Talk talk = robotiq();
  Prompter prompter(talk, talk.size() - 6);
  robotiq::Client sut({.host = "127.0.0.1", .port = prompter.port(), .force = 100});
  sut.move(robotiq::opening_of(120), robotiq::kFastest);  // it is told once it is active
  EXPECT_TRUE(soon(kPatience, [&] { return prompter.is_done() && sut.report().is_ready; })) << sut.report().trouble;
  EXPECT_EQ(sut.report().object, robotiq::Object::kAtRequest);
  EXPECT_NEAR(sut.report().opening, robotiq::opening_of(120), 1e-9);
  EXPECT_EQ(prompter.trouble(), "");
}

TEST(RobotiqConformance, OfTheSimulatedGripper) {
  Simulator sut(Generation::cb3());
  take(serve_gripper(sut.context, sut.gripper, "127.0.0.1", 0), sut.lines);
  sut.controller.power_on();
  sut.hold(robotiq(), sut.lines->port());
  EXPECT_NEAR(sut.plant.opening(), robotiq::opening_of(120), 1e-3);
}

}  // namespace
}  // namespace jostle::robot_bridge::ur_sim
