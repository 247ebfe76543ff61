#include "services/common/process/cores.hpp"

#include <gmock/gmock.h>
#include <sched.h>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;

const std::vector<int> kAllowed{0, 1, 2, 3, 6, 7, 8, 12};

std::string complaint(const std::string& text) {
  const auto cores_result = parse_cores(text, kAllowed);
  return cores_result ? "" : cores_result.error().message;
}

TEST(Cores, ListAndRangesInTheOrderGiven) {
  EXPECT_THAT(parse_cores("2,3,6-8", kAllowed).value(), ElementsAre(2, 3, 6, 7, 8));
  EXPECT_THAT(parse_cores("12,0", kAllowed).value(), ElementsAre(12, 0));
  EXPECT_THAT(parse_cores("7-7", kAllowed).value(), ElementsAre(7));
}

TEST(Cores, CoreThatMayNotBeUsedIsNamedWithThoseThatMay) {
  EXPECT_EQ(complaint("2,4"), "cores: got 4, wanted some of 0-3,6-8,12, which this process may use");
  EXPECT_THAT(complaint("1-5"), HasSubstr("got 4"));
  EXPECT_THAT(complaint("900"), HasSubstr("got 900"));
}

TEST(Cores, WhatIsNoListIsShown) {
  for (const std::string text : {"x", "1,,2", "3-1", "-1", "1-", "1 2", "99999999999", "1;2", ","}) {
    EXPECT_THAT(complaint(text), HasSubstr("got '" + text + "'")) << text;
  }
  EXPECT_THAT(complaint(""), HasSubstr("got none"));
  EXPECT_THAT(complaint("1,0-2"), HasSubstr("got 1 twice"));
}

TEST(Cores, OneForEachThreadOrAnError) {
  EXPECT_THAT(one_core_each({5, 3, 4}, 2).value(), ElementsAre(5, 3));
  EXPECT_EQ(one_core_each({3, 4}, 5).error().message, "cores: got 2 (3-4) for 5 threads, wanted one for each");
}

TEST(Cores, AllowedOnesFollowTheAffinity) {
  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  const std::vector<int> all = allowed_cores();
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(all.back(), &only);
  ASSERT_EQ(sched_setaffinity(0, sizeof only, &only), 0);

  EXPECT_THAT(allowed_cores(), ElementsAre(all.back()));
  EXPECT_EQ(usable_cores(), 1);

  sched_setaffinity(0, sizeof before, &before);
  EXPECT_EQ(allowed_cores(), all);
}

TEST(Cores, QuotaIsTheTightestOfAllGroupsAbove) {
  const tests::TempFolder folder;
  std::filesystem::create_directories(folder.path() / "a" / "b");
  EXPECT_FALSE(cpu_quota(folder.path(), "/a/b"));
  folder.write("a/b/cpu.max", "max 100000\n");
  EXPECT_FALSE(cpu_quota(folder.path(), "/a/b"));
  folder.write("a/cpu.max", "250000 100000\n");
  EXPECT_EQ(cpu_quota(folder.path(), "/a/b"), 2.5);
  folder.write("a/b/cpu.max", "400000 100000\n");
  EXPECT_EQ(cpu_quota(folder.path(), "/a/b"), 2.5);
  EXPECT_FALSE(cpu_quota(folder.path(), "/"));
}

}  // namespace
}  // namespace jostle::common
