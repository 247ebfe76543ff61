// Client and server of NatNet over real sockets.

#include <gmock/gmock.h>

#include <mutex>

#include "perception/natnet/client.hpp"
#include "perception/natnet/server.hpp"
#include "tests/support/soon.hpp"
#include "tests/support/test_domain.hpp"

namespace jostle::perception::natnet {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using tests::soon;

constexpr auto kPatience = 60s;

// Keeps what a client sees.
class Eyes {
 public:
  std::function<void(const Seen&)> looking() {
    return [this](const Seen& seen) {
      const std::lock_guard lock(mutex_);
      newest_ = seen;
      ++count_;
    };
  }
  std::optional<Seen> newest() const {
    const std::lock_guard lock(mutex_);
    return newest_;
  }
  int count() const {
    const std::lock_guard lock(mutex_);
    return count_;
  }

 private:
  mutable std::mutex mutex_;
  std::optional<Seen> newest_;
  int count_ = 0;
};

class NatNetLink : public ::testing::Test {
 protected:
  std::unique_ptr<Server> serve(Version version, bool multicast = false) {
    // An address of the test's own on loopback: ports may be the usual ones.
    auto server =
        Server::listen({.address = address, .version = version, .multicast = multicast}, {{3, "can"}, {4, "bowl"}});
    EXPECT_TRUE(server) << server.error().message;
    return std::move(server).value();
  }

  void look_for_it(Client::Options options = {}) {
    options.host = address;
    auto result = Client::start(options, eyes.looking());
    ASSERT_TRUE(result) << result.error().message;
    client = std::move(result).value();
  }

  // Publishes until the client has seen this frame.
  bool shows(Server& server, double timestamp) {
    Frame frame{.timestamp = timestamp};
    frame.bodies = {{.id = 3, .position = {1, 2, 3}, .orientation = {0, 0, 1, 0}}, {.id = 4, .tracked = false}};
    return soon(kPatience, [&] {
      server.publish(frame);
      const auto seen = eyes.newest();
      return seen && seen->timestamp == timestamp && seen->bodies.size() == 2;
    });
  }

  const std::string address = "127.0.5." + std::to_string(tests::test_domain() + 1);
  Eyes eyes;
  std::unique_ptr<Client> client;
};

class NatNetVersions : public NatNetLink, public ::testing::WithParamInterface<Version> {};

TEST_P(NatNetVersions, BodiesComeByNameWithTheTimeOfTheirExposure) {
  const auto server = serve(GetParam());
  look_for_it();

  ASSERT_TRUE(shows(*server, 1.5)) << client->trouble();

  const Seen seen = *eyes.newest();
  EXPECT_EQ(seen.bodies[0].name, "can");
  EXPECT_EQ(seen.bodies[0].body.position, (std::array<float, 3>{1, 2, 3}));
  EXPECT_EQ(seen.bodies[0].body.orientation, (std::array<float, 4>{0, 0, 1, 0}));
  EXPECT_TRUE(seen.bodies[0].body.tracked);
  EXPECT_EQ(seen.bodies[1].name, "bowl");
  EXPECT_FALSE(seen.bodies[1].body.tracked);
  EXPECT_EQ(client->trouble(), "");
  EXPECT_EQ(client->counts().malformed, 0u);
  EXPECT_TRUE(soon(kPatience, [&] { return client->counts().round_trip > 0; }));
}

TEST_P(NatNetVersions, AreSpokenToWhoAsksForThem) {
  const auto server = serve({4, 1});
  look_for_it({.version = GetParam()});
  ASSERT_TRUE(shows(*server, 2.5)) << client->trouble();
  EXPECT_TRUE(shows(*server, 3.5)) << client->trouble();
}

INSTANTIATE_TEST_SUITE_P(, NatNetVersions,
                         ::testing::Values(Version{3, 0}, Version{3, 1}, Version{4, 0}, Version{4, 1}),
                         [](const auto& version) {
                           return "V" + std::to_string(version.param.major) + std::to_string(version.param.minor);
                         });

TEST_F(NatNetLink, ExposureIsOfThisHostsClock) {
  const auto server = serve({4, 1});
  look_for_it();
  ASSERT_TRUE(shows(*server, 1.0));
  ASSERT_TRUE(soon(kPatience, [&] { return client->counts().round_trip > 0; }));
  const auto before = std::chrono::system_clock::now();
  ASSERT_TRUE(shows(*server, 2.0));
  const auto after = std::chrono::system_clock::now();
  // The echo's error is at most half its round trip.
  const auto error = std::chrono::duration_cast<std::chrono::system_clock::duration>(
      std::chrono::duration<double>(client->counts().round_trip) + 1ms);
  EXPECT_GE(eyes.newest()->exposed, before - error);
  EXPECT_LE(eyes.newest()->exposed, after + error);
}

// However late a frame comes, it says when it was exposed.
TEST_F(NatNetLink, LateFramesComeLateWithTheTimeOfTheirExposure) {
  const auto server = serve({4, 1});
  look_for_it();
  ASSERT_TRUE(soon(kPatience, [&] {
    server->publish({.bodies = {{.id = 3}}});
    return eyes.count() > 0;
  }));
  using Clock = std::chrono::system_clock;
  Frame marked{.bodies = {{.id = 3, .position = {9, 9, 9}}}};
  const auto began = Clock::now();
  server->publish(marked, 500ms);
  ASSERT_TRUE(soon(kPatience,
                   [&] { return !eyes.newest()->bodies.empty() && eyes.newest()->bodies[0].body.position[0] == 9; }));
  EXPECT_GE(Clock::now() - began, 500ms);
  EXPECT_LT(eyes.newest()->exposed - began, 250ms);
}

TEST_F(NatNetLink, ByMulticastComesToWhoListens) {
  const auto server = serve({4, 1}, true);
  look_for_it({.interface = address});
  EXPECT_TRUE(shows(*server, 1.5)) << client->trouble();
}

TEST_F(NatNetLink, ServerThatIsGoneIsFoundAgain) {
  auto server = serve({4, 1});
  look_for_it();
  ASSERT_TRUE(shows(*server, 1.0));

  server.reset();
  EXPECT_TRUE(soon(kPatience, [&] { return client->trouble().find("nothing heard for 5 s") != std::string::npos; }));
  server = serve({3, 1});

  EXPECT_TRUE(shows(*server, 2.0)) << client->trouble();
  EXPECT_EQ(client->trouble(), "");
}

TEST_F(NatNetLink, NobodyThereAndNoFramesAreSaidApart) {
  look_for_it();
  EXPECT_THAT(client->trouble(), HasSubstr("no answer so far"));
  const auto server = serve({4, 1});
  EXPECT_TRUE(soon(kPatience, [&] { return client->trouble().find("no frames come") != std::string::npos; }))
      << client->trouble();
  EXPECT_TRUE(shows(*server, 1.0));
}

TEST_F(NatNetLink, ClientThatLeavesIsForgotten) {
  const auto server = serve({4, 1});
  look_for_it();
  ASSERT_TRUE(shows(*server, 1.0));
  EXPECT_EQ(server->clients(), 1u);
  client.reset();
  EXPECT_TRUE(soon(kPatience, [&] { return server->clients() == 0; }));
}

TEST_F(NatNetLink, PortThatIsTakenIsNamed) {
  const auto server = serve({4, 1});
  const auto second = Server::listen({.address = address}, {});
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message, HasSubstr(address + ":1510"));
}

}  // namespace
}  // namespace jostle::perception::natnet
