#include "services/common/process/domain_claim.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

namespace jostle::common {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

// Roles of this process's own: tests run side by side.
const std::string kRole = "test " + std::to_string(getpid());

TEST(DomainClaim, SecondOfARoleIsRefusedWithTheRemedy) {
  const auto sut = DomainClaim::take(kRole, 7, 0ms);
  ASSERT_TRUE(sut) << sut.error().message;

  const auto second = DomainClaim::take(kRole, 7, 0ms);

  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Code::kUnavailable);
  EXPECT_THAT(second.error().message, HasSubstr("domain 7: got another " + kRole));
  EXPECT_THAT(second.error().message, HasSubstr("ROS_DOMAIN_ID"));
}

TEST(DomainClaim, OtherDomainsAndRolesAreFree) {
  const auto sut = DomainClaim::take(kRole, 7, 0ms);

  EXPECT_TRUE(DomainClaim::take(kRole, 77, 0ms));
  EXPECT_TRUE(DomainClaim::take(kRole + "0", 7, 0ms));
}

TEST(DomainClaim, EndsWithItsHolder) {
  { const auto earlier = DomainClaim::take(kRole, 7, 0ms); }

  EXPECT_TRUE(DomainClaim::take(kRole, 7, 0ms));
}

TEST(DomainClaim, OfAKilledProcessIsFreeAgain) {
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto held = DomainClaim::take(kRole, 8, 0ms);
    if (write(ready[1], held ? "y" : "n", 1) != 1) _exit(1);
    pause();
  }
  char held = 0;
  ASSERT_EQ(read(ready[0], &held, 1), 1);
  EXPECT_EQ(held, 'y');
  EXPECT_FALSE(DomainClaim::take(kRole, 8, 0ms));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);

  EXPECT_TRUE(DomainClaim::take(kRole, 8, 0ms));
  close(ready[0]);
  close(ready[1]);
}

TEST(DomainClaim, WaitsForAPredecessorThatIsEnding) {
  auto earlier_result = DomainClaim::take(kRole, 9, 0ms);
  std::optional<DomainClaim> earlier(std::move(earlier_result).value());
  const std::jthread ending([&] { earlier.reset(); });

  EXPECT_TRUE(DomainClaim::take(kRole, 9, 60s));
}

TEST(OwnDomain, IsNobodyElsesAndBelowThePortsThatLinuxHandsOut) {
  const auto one = claim_some_domain(), other = claim_some_domain();
  ASSERT_TRUE(one && other);

  EXPECT_NE(one->domain, other->domain);
  for (const int domain : {one->domain, other->domain}) {
    EXPECT_GE(domain, 1);
    EXPECT_LT(7400 + 250 * domain, 32768);
  }
}

}  // namespace
}  // namespace jostle::common
