#include "services/wire/dds/discovery.hpp"

#include <gmock/gmock.h>

namespace jostle::wire {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Host = Discovery::Host;

TEST(Discovery, IsByMulticast) {
  const auto sut = parse_discovery("multicast").value();

  EXPECT_EQ(sut.mode, Discovery::Mode::kMulticast);
  EXPECT_TRUE(sut.hosts.empty());
}

TEST(Discovery, IsByAListOfPeers) {
  const auto sut = parse_discovery("peers:10.0.0.2,10.0.0.3").value();

  EXPECT_EQ(sut.mode, Discovery::Mode::kPeers);
  EXPECT_THAT(sut.hosts, ElementsAre(Host{"10.0.0.2", 0}, Host{"10.0.0.3", 0}));
}

TEST(Discovery, IsThroughServersWithThePortOfRos2UnlessGiven) {
  const auto sut = parse_discovery("server:10.0.0.1,10.0.0.2:7777").value();

  EXPECT_EQ(sut.mode, Discovery::Mode::kServer);
  EXPECT_THAT(sut.hosts, ElementsAre(Host{"10.0.0.1", 11811}, Host{"10.0.0.2", 7777}));
}

TEST(Discovery, IsByMulticastAndPeersBeyondIt) {
  const auto sut = parse_discovery("multicast+peers:10.0.0.2").value();

  EXPECT_EQ(sut.mode, Discovery::Mode::kMulticast);
  EXPECT_THAT(sut.hosts, ElementsAre(Host{"10.0.0.2", 0}));
}

TEST(Discovery, MayStayOnThisHost) {
  EXPECT_EQ(parse_discovery("localhost").value().mode, Discovery::Mode::kLocalhost);
}

TEST(Discovery, LeavesPlacesOfServersEmpty) {
  EXPECT_THAT(parse_discovery("server:,10.0.0.1").value().hosts, ElementsAre(Host{}, Host{"10.0.0.1", 11811}));
}

TEST(Discovery, LooksNamesUp) {
  EXPECT_THAT(parse_discovery("peers:localhost").value().hosts, ElementsAre(Host{"127.0.0.1", 0}));
}

class BadDiscovery : public ::testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(BadDiscovery, IsRefusedWithWhatIsWrong) {
  const auto [text, why] = GetParam();

  const auto result = parse_discovery(text);

  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("discovery: "));
  EXPECT_THAT(result.error().message, HasSubstr(why));
}

INSTANTIATE_TEST_SUITE_P(, BadDiscovery,
                         ::testing::Values(std::pair("broadcast", "no such way"), std::pair("", "no such way"),
                                           std::pair("multicast:10.0.0.1", "no such way"),
                                           std::pair("peers:", "a host is empty"),
                                           std::pair("peers:10.0.0.1,,10.0.0.2", "a host is empty"),
                                           std::pair("peers:10.0.0.1:7400", "peers need none"),
                                           std::pair("server:10.0.0.1:0", "no port from 1 to 65535"),
                                           std::pair("server:10.0.0.1:70000", "no port from 1 to 65535"),
                                           std::pair("server:10.0.0.1:x", "no port from 1 to 65535"),
                                           std::pair("server::11811", "a host is empty"),
                                           std::pair("server:,", "a host is empty"),
                                           std::pair("multicast+peers:", "a host is empty"),
                                           std::pair("peers:10.0.0.256", "host '10.0.0.256'")));

}  // namespace
}  // namespace jostle::wire
