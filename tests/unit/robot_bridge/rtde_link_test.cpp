// RTDE between our client and our simulated controller, over sockets.

#include <gmock/gmock.h>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <thread>

#include "robot_bridge/ur/rtde_client.hpp"
#include "robot_bridge/ur_sim/rtde_server.hpp"
#include "tests/support/exact_plant.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

using namespace std::chrono_literals;
using net::Clock;
using ::testing::HasSubstr;
using ur::RtdeClient;
namespace rtde = ur::rtde;

constexpr auto kPatience = 20s;

// A controller whose time goes on as fast as somebody waits for it.
class RtdeLink : public ::testing::Test {
 protected:
  RtdeLink() {
    auto server_result = RtdeServer::listen(context_, controller, "127.0.0.1", 0);
    if (!server_result) throw std::runtime_error(server_result.error().message);
    server_ = std::move(server_result).value();
    port = server_->port();
    thread_ = std::jthread([this](std::stop_token stop) {
      while (!stop.stop_requested()) {
        if (context_.stopped()) context_.restart();
        context_.run_for(1ms);
        if (!ticks) continue;
        if (!controller.tick()) break;
        server_->publish();
      }
      server_.reset();
    });
  }

  Result<RtdeClient> connect() { return RtdeClient::connect("127.0.0.1", port, 0.0, Clock::now() + kPatience); }

  // What a client that is not ours sends, and what comes back until `count` packets of a type came.
  std::vector<rtde::Packet> converse(net::TcpClient& tcp, const Bytes& bytes, std::size_t count) {
    std::vector<rtde::Packet> packets;
    rtde::PacketStream stream;
    EXPECT_TRUE(tcp.write(bytes, Clock::now() + kPatience));
    std::array<std::uint8_t, 4096> room;
    while (packets.size() < count) {
      auto packet = stream.next();
      EXPECT_TRUE(packet);
      if (!packet) break;
      if (*packet) {
        packets.push_back(std::move(**packet));
        continue;
      }
      auto more = tcp.read(room, Clock::now() + kPatience);
      if (!more) break;
      stream.append(*more);
    }
    return packets;
  }

  tests::ExactPlant plant;
  Controller controller{plant, Generation::cb3()};
  std::atomic<bool> ticks = true;
  std::uint16_t port = 0;

 private:
  boost::asio::io_context context_{1};
  std::unique_ptr<RtdeServer> server_;
  std::jthread thread_;  // last: it uses all of the above
};

TEST_F(RtdeLink, AgreesAndStreams) {
  auto client = connect();
  ASSERT_TRUE(client) << client.error().message;
  EXPECT_EQ(client->version().major, 3u);
  EXPECT_EQ(client->cycle(), 0.008);
  double last = 0.0;
  for (int i = 0; i < 20; ++i) {
    const auto state = client->next(Clock::now() + kPatience);
    ASSERT_TRUE(state) << state.error().message;
    EXPECT_GT(state->timestamp, last);
    last = state->timestamp;
    EXPECT_EQ(state->robot_mode, ur::RobotMode::kPowerOff);
    EXPECT_EQ(state->q, plant.positions());
  }
}

TEST_F(RtdeLink, ASecondWriterOfTheSameRegistersIsToldThatTheyAreInUse) {
  auto first = connect();
  ASSERT_TRUE(first);
  {
    const auto second = connect();
    ASSERT_FALSE(second);
    EXPECT_THAT(second.error().message, HasSubstr("input_int_register_24"));
    EXPECT_THAT(second.error().message, HasSubstr("use"));
  }
  // They are free again once the first has gone.
  { const auto gone = std::move(first); }
  const auto deadline = Clock::now() + kPatience;
  auto third = connect();
  while (!third && Clock::now() < deadline) third = connect();
  EXPECT_TRUE(third) << third.error().message;
}

TEST_F(RtdeLink, ASilentControllerIsADeadline) {
  auto client = connect();
  ASSERT_TRUE(client);
  ticks = false;
  for (;;) {
    const auto state = client->next(Clock::now() + 300ms);
    if (state) continue;  // what was on its way
    EXPECT_EQ(state.error().code, Code::kDeadline);
    break;
  }
  ticks = true;
  EXPECT_TRUE(client->next(Clock::now() + kPatience));
}

// However the network splits what a client says.
TEST_F(RtdeLink, TheServerUnderstandsRequestsCutAtEveryByte) {
  ticks = false;
  Bytes talk;
  for (const auto& packet :
       {rtde::protocol_request(2), rtde::version_request(), rtde::outputs_request(125, {"timestamp", "actual_q"}),
        rtde::inputs_request({"speed_slider_mask"}), rtde::start_request(), rtde::pause_request()}) {
    const Bytes bytes = rtde::encode(packet);
    talk.insert(talk.end(), bytes.begin(), bytes.end());
  }
  for (std::size_t cut = 0; cut <= talk.size(); cut += 3) {
    auto tcp = net::TcpClient::connect("127.0.0.1", port, Clock::now() + kPatience);
    ASSERT_TRUE(tcp) << tcp.error().message;
    ASSERT_TRUE(tcp->write(std::span(talk).first(cut), Clock::now() + kPatience));
    const auto packets = converse(*tcp, {talk.begin() + static_cast<std::ptrdiff_t>(cut), talk.end()}, 6);
    ASSERT_EQ(packets.size(), 6u) << cut;
    EXPECT_TRUE(*rtde::read_accepted(packets[0]));
    EXPECT_EQ(rtde::read_version(packets[1])->major, 3u);
    EXPECT_EQ(rtde::read_recipe_reply(packets[2])->id, 1);
    EXPECT_TRUE(*rtde::read_accepted(packets[5]));
  }
}

TEST_F(RtdeLink, TheServerNamesFieldsThatItDoesNotHave) {
  ticks = false;
  auto tcp = net::TcpClient::connect("127.0.0.1", port, Clock::now() + kPatience);
  ASSERT_TRUE(tcp);
  ASSERT_EQ(converse(*tcp, rtde::encode(rtde::protocol_request(2)), 1).size(), 1u);
  const auto packets = converse(*tcp, rtde::encode(rtde::outputs_request(125, {"timestamp", "no_such_thing"})), 1);
  ASSERT_EQ(packets.size(), 1u);
  const auto reply = rtde::read_recipe_reply(packets[0]);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->id, 0);
  EXPECT_THAT(reply->types, ::testing::ElementsAre("DOUBLE", "NOT_FOUND"));
  // And a stream without a recipe is refused.
  const auto started = converse(*tcp, rtde::encode(rtde::start_request()), 1);
  ASSERT_EQ(started.size(), 1u);
  EXPECT_FALSE(*rtde::read_accepted(started[0]));
}

TEST_F(RtdeLink, TheServerClosesOnWhatHasNoMeaning) {
  ticks = false;
  for (const Bytes& nonsense :
       {Bytes{0, 0, 'V'}, Bytes{0, 2, 'V'}, rtde::encode({.type = rtde::PacketType::kData, .payload = {7}}),
        rtde::encode({.type = rtde::PacketType::kProtocolVersion, .payload = {1}})}) {
    auto tcp = net::TcpClient::connect("127.0.0.1", port, Clock::now() + kPatience);
    ASSERT_TRUE(tcp);
    ASSERT_TRUE(tcp->write(nonsense, Clock::now() + kPatience));
    std::array<std::uint8_t, 256> room;
    Code code = Code::kInternal;
    for (;;) {
      const auto bytes = tcp->read(room, Clock::now() + kPatience);
      if (bytes) continue;  // its complaint
      code = bytes.error().code;
      break;
    }
    EXPECT_EQ(code, Code::kUnavailable);
  }
}

}  // namespace
}  // namespace jostle::robot_bridge::ur_sim
