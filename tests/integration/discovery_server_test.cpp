// jostle discovery-server where it cannot listen: it says so instead of being a server that
// nobody reaches.

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>

#include "tests/support/program_process.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

class DiscoveryServer : public ::testing::Test {
 protected:
  std::unique_ptr<ProgramProcess> start(const std::string& address, int port) {
    return std::make_unique<ProgramProcess>(
        "jostle_discovery_server",
        std::vector<std::string>{"--domain", std::to_string(test_domain()), "--listen", address, "--port",
                                 std::to_string(port)},
        folder);
  }

  const TempFolder folder;
};

// A UDP port of the loopback that somebody has.
class TakenPort {
 public:
  TakenPort() : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address_;
    auto* generic = reinterpret_cast<sockaddr*>(&address_);
    if (bind(socket_, generic, size) != 0 || getsockname(socket_, generic, &size) != 0)
      throw std::runtime_error("no free port");
  }
  ~TakenPort() { close(socket_); }
  TakenPort(const TakenPort&) = delete;
  TakenPort& operator=(const TakenPort&) = delete;

  int number() const { return ntohs(address_.sin_port); }

 private:
  int socket_;
  sockaddr_in address_{};
};

TEST_F(DiscoveryServer, SaysThatItsPortIsTaken) {
  const TakenPort port;
  const auto server = start("127.0.0.1", port.number());

  EXPECT_EQ(server->wait(30s), 3);
  EXPECT_THAT(server->err(), HasSubstr("127.0.0.1:" + std::to_string(port.number()) +
                                       ": Address already in use; wanted an address of this host"));
}

TEST_F(DiscoveryServer, SaysThatItsAddressIsAnotherHosts) {
  const auto server = start("192.0.2.1", 11811);  // of nobody: RFC 5737, for documentation

  EXPECT_EQ(server->wait(30s), 3);
  EXPECT_THAT(server->err(),
              HasSubstr("192.0.2.1:11811: Cannot assign requested address; wanted an address of this host"));
}

TEST_F(DiscoveryServer, ListensWhereItCan) {
  const auto free_port = [] { return TakenPort().number(); }();
  const auto server = start("127.0.0.1", free_port);

  ASSERT_TRUE(server->says("listens at 127.0.0.1:" + std::to_string(free_port), 30s)) << server->err();
  server->signal(SIGTERM);
  EXPECT_EQ(server->wait(30s), 0);
}

}  // namespace
}  // namespace jostle::tests
