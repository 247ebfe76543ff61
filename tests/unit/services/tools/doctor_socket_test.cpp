#include "services/tools/doctor/socket.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include "services/common/process/domain.hpp"
#include "tests/support/test_domain.hpp"

namespace jostle::tools {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using tests::in;

constexpr auto kPatience = 60s;
const in_addr kLoopback{htonl(INADDR_LOOPBACK)};

TEST(DoctorEndpoint, HasAddressAndPortAsOneSaysThem) {
  const sockaddr_in sut = endpoint(kLoopback, 7400);
  EXPECT_EQ(to_string(sut.sin_addr), "127.0.0.1");
  EXPECT_EQ(ntohs(sut.sin_port), 7400);
  EXPECT_EQ(generic(sut)->sa_family, AF_INET);
  EXPECT_EQ(to_string(any_address()), "0.0.0.0");
  EXPECT_EQ(to_string({inet_addr(kGroup)}), kGroup);
}

TEST(DoctorRoute, ToThisHostLeavesFromTheLoopback) {
  const auto own = route_to(kLoopback);
  ASSERT_TRUE(own);
  EXPECT_EQ(to_string(*own), "127.0.0.1");
}

TEST(DoctorSocket, IsClosedOnceHoweverOftenItMoved) {
  int descriptor = -1;
  {
    Socket first(SOCK_DGRAM);
    descriptor = first.get();
    ASSERT_GE(descriptor, 0);
    Socket second(std::move(first));
    Socket third(SOCK_DGRAM);
    third = std::move(second);
    EXPECT_EQ(third.get(), descriptor);
  }
  EXPECT_EQ(close(descriptor), -1);
  EXPECT_EQ(errno, EBADF);
}

TEST(DoctorSocket, IsReadableOnceThereIsSomething) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  const Socket here = Socket::adopt(ends[0]);
  std::optional<Socket> there = Socket::adopt(ends[1]);

  EXPECT_FALSE(here.readable(in(10ms)));
  EXPECT_FALSE(here.readable(in(-1s)));
  ASSERT_EQ(send(there->get(), "x", 1, 0), 1);
  EXPECT_TRUE(here.readable(in(kPatience)));
  EXPECT_TRUE(here.readable(in(kPatience))) << "looking takes nothing away";
  char byte;
  ASSERT_EQ(recv(here.get(), &byte, 1, 0), 1);
  there.reset();
  EXPECT_TRUE(here.readable(in(kPatience))) << "the end is something to read, too";
}

TEST(DoctorSocket, StopRequestEndsTheWait) {
  const Socket sut(SOCK_DGRAM);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(sut.readable(in(1h), stop.get_token()));
}

TEST(DoctorEar, HearsTheDatagramItWaitsForAndNoOther) {
  const auto ear_result = Ear::open(0);
  ASSERT_TRUE(ear_result) << ear_result.error().message;
  ASSERT_GT(ear_result->port(), 0);
  for (const char* text : {"somebody else's", "", "knock ", "knock"}) {
    ASSERT_TRUE(send_datagram(text, kLoopback, ear_result->port()));
  }

  EXPECT_TRUE(ear_result->hears("knock", in(kPatience)));
  ASSERT_TRUE(send_datagram("knock knock", kLoopback, ear_result->port()));
  EXPECT_FALSE(ear_result->hears("knock", in(20ms)));
}

TEST(DoctorEar, HearsTheLargestDatagram) {
  const auto ear_result = Ear::open(0);
  ASSERT_TRUE(ear_result);
  const std::string largest(65'507, 'x');

  ASSERT_TRUE(send_datagram(largest, kLoopback, ear_result->port()));
  EXPECT_TRUE(ear_result->hears(largest, in(kPatience)));

  const auto ok = send_datagram(largest + "x", kLoopback, ear_result->port());
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kIo);
  EXPECT_EQ(ok.error().message, "sending: Message too long");
}

TEST(DoctorEar, HasItsPortForItself) {
  const auto first_result = Ear::open(0);
  ASSERT_TRUE(first_result);
  const auto second_result = Ear::open(first_result->port());
  ASSERT_FALSE(second_result);
  EXPECT_EQ(second_result.error().code, Code::kIo);
  EXPECT_EQ(second_result.error().message, "bind: Address already in use");
}

TEST(DoctorEar, TakesTheFirstPortOfADomainThatIsFree) {
  const int domain = tests::test_domain();
  const auto first_result = Ear::open_in_domain(domain), second_result = Ear::open_in_domain(domain);
  ASSERT_TRUE(first_result) << first_result.error().message;
  ASSERT_TRUE(second_result) << second_result.error().message;
  EXPECT_GE(first_result->port(), common::unicast_port(domain, 0));
  EXPECT_LT(second_result->port(), common::multicast_port(domain + 1));
  EXPECT_EQ(second_result->port() - first_result->port(),
            common::unicast_port(domain, 1) - common::unicast_port(domain, 0));
}

TEST(DoctorDatagramToNowhere, IsAnErrorThatNamesTheStep) {
  const auto ok = send_datagram("knock", kLoopback, 7400, in_addr{inet_addr("192.0.2.1")});  // TEST-NET-1: nobody's
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kIo);
  EXPECT_THAT(ok.error().message, HasSubstr("choosing the interface: "));
}

}  // namespace
}  // namespace jostle::tools
