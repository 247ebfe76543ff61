// Spoilt messages of motion capture, to our client as a server would send them and to our server as clients would.

#include <fmt/format.h>
#include <poll.h>

#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>
#include <random>
#include <stdexcept>

#include "perception/natnet/client.hpp"
#include "perception/natnet/server.hpp"
#include "tests/fuzz/fuzz_main.hpp"
#include "tests/fuzz/wire/mutation.hpp"
#include "tests/support/soon.hpp"
#include "tests/support/test_domain.hpp"

namespace jostle::tests {
namespace {

using namespace perception::natnet;
using boost::asio::ip::udp;
using namespace std::chrono_literals;

constexpr auto kPatience = 60s;
constexpr Version kVersions[] = {{3, 0}, {3, 1}, {4, 0}, {4, 1}};

// One message of each kind that either side sends.
std::vector<Bytes> messages(Version version) {
  const Frame frame{.number = 1,
                    .bodies = {{.id = 1, .position = {1, 2, 3}}, {.id = 2, .tracked = false}},
                    .markers = {{.id = 1 << 16}},
                    .timestamp = 1.0};
  const ServerInfo info{
      .name = "fuzz", .natnet_version = {version.major, version.minor, 0, 0}, .clock_hz = Server::kClock, .group = {}};
  const std::string request = "Bitstream,3.1";
  std::vector<Bytes> all;
  for (const auto& [id, payload] : std::initializer_list<std::pair<MessageId, Bytes>>{
           {MessageId::kServerInfo, encode(info)},
           {MessageId::kModels, encode(std::vector<Model>{{1, "can"}, {2, "bowl"}}, version)},
           {MessageId::kFrame, encode(frame, version)},
           {MessageId::kEchoReply, Bytes(16, 0)},
           {MessageId::kResponse, Bytes(4, 0)},
           {MessageId::kConnect, Bytes(264, 0)},
           {MessageId::kRequest, Bytes(request.begin(), request.end())},
           {MessageId::kModelRequest, {}},
           {MessageId::kEcho, Bytes(8, 1)},
           {MessageId::kKeepAlive, {}},
           {MessageId::kDiscovery, {}},
           {MessageId::kUnrecognised, {}}}) {
    all.push_back(encode(Message{id, payload}));
  }
  return all;
}

class Fuzzer {
 public:
  Fuzzer(long inputs, std::uint64_t seed) : inputs_(inputs), random_(seed) {
    for (const Version version : kVersions) {
      for (Bytes& message : messages(version)) seeds_.push_back(std::move(message));
    }
  }

  void run() {
    read();
    fmt::print("{} messages read or refused\n", inputs_);
    bother_client();
    bother_server();
  }

 private:
  Bytes spoilt() { return mutated(seeds_[random_() % seeds_.size()], random_() % 8 == 0 ? 0 : 4, random_); }

  void read() {
    for (long i = 0; i < inputs_; ++i) {
      const Bytes datagram = spoilt();
      const auto message = decode(datagram);
      if (!message) continue;
      const Version version = kVersions[random_() % 4];
      const auto frame = decode_frame(message->payload, version);
      if (frame && frame->bodies.size() > message->payload.size()) throw std::runtime_error("bodies out of nothing");
      (void)decode_models(message->payload, version);
      (void)decode_server_info(message->payload);
      (void)requested_bitstream(message->payload);
    }
  }

  // A server that answers whatever it likes, and mends its ways.
  void bother_client() {
    boost::asio::io_context context;
    udp::socket socket(context, {boost::asio::ip::make_address(address_), kCommandPort});
    socket.non_blocking(true);
    std::atomic<int> seen{0};
    auto client = Client::start({.host = address_}, [&](const Seen&) { ++seen; });
    if (!client) throw std::runtime_error(client.error().message);
    udp::endpoint from;
    std::array<std::uint8_t, 2048> room;
    boost::system::error_code error;
    while (socket.receive_from(boost::asio::buffer(room), from, 0, error) == 0) poll(nullptr, 0, 5);
    for (long i = 0; i < inputs_ / 10; ++i) {
      socket.send_to(boost::asio::buffer(spoilt()), from, 0, error);
      if (i % 50 == 0) poll(nullptr, 0, 1);
    }
    socket.close();
    auto server = Server::listen({.address = address_}, {{1, "can"}});
    if (!server) throw std::runtime_error(server.error().message);
    seen = 0;
    wait_for("the client sees no frame any more", [&] {
      (*server)->publish({.bodies = {{.id = 1}}});
      return seen > 0;
    });
    fmt::print("the client: {} messages, {} dropped\n", inputs_ / 10, (*client)->counts().malformed);
  }

  // Clients that say whatever they like, and one that is none of them.
  void bother_server() {
    auto server = Server::listen({.address = address_}, {{1, "can"}});
    if (!server) throw std::runtime_error(server.error().message);
    boost::asio::io_context context;
    udp::socket socket(context, udp::v4());
    socket.non_blocking(true);
    boost::system::error_code error;
    const udp::endpoint to(boost::asio::ip::make_address(address_), kCommandPort);
    for (long i = 0; i < inputs_ / 10; ++i) {
      socket.send_to(boost::asio::buffer(spoilt()), to, 0, error);
      if (i % 50 == 0) poll(nullptr, 0, 1);
    }
    socket.close();
    std::atomic<int> seen{0};
    auto client = Client::start({.host = address_}, [&](const Seen&) { ++seen; });
    if (!client) throw std::runtime_error(client.error().message);
    wait_for("the server serves nobody any more", [&] {
      (*server)->publish({.bodies = {{.id = 1}}});
      return seen > 0;
    });
    fmt::print("the server: {} messages\n", inputs_ / 10);
  }

  static void wait_for(const char* failure, const std::function<bool()>& condition) {
    if (!soon(kPatience, condition)) throw std::runtime_error(failure);
  }

  const long inputs_;
  std::mt19937_64 random_;
  std::vector<Bytes> seeds_;
  const std::string address_ = fmt::format("127.0.8.{}", test_domain() + 1);
};

}  // namespace
}  // namespace jostle::tests

int main(int argc, char** argv) {
  long inputs = 1'000'000;
  return jostle::tests::fuzz_main(
      argc, argv,
      "Sends spoilt messages of motion capture (NatNet) to what reads them, to our client and to our server.",
      {{"--inputs", "To the readers; a tenth as many to each side's socket", &inputs}},
      [&](std::uint64_t seed) { jostle::tests::Fuzzer(inputs, seed).run(); });
}
