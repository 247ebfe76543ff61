#include "services/wire/security/role.hpp"

#include <gtest/gtest.h>

namespace jostle::wire {
namespace {

TEST(Role, OfARobotCoversEveryOtherAndTheOthersThemselves) {
  for (const Role needed : kRoles) {
    EXPECT_TRUE(covers(Role::kRobot, needed));
    EXPECT_TRUE(covers(needed, needed));
    if (needed == Role::kRobot) continue;
    EXPECT_FALSE(covers(needed, Role::kRobot));
  }
  EXPECT_FALSE(covers(Role::kWorker, Role::kObserver));
}

}  // namespace
}  // namespace jostle::wire
