#include "services/common/results/results.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cmath>

#include "services/common/results/table.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

using ::testing::HasSubstr;

TEST(CheckOutput, SaysBeforeTheWorkWhatIsInTheWay) {
  const tests::TempFolder folder;
  EXPECT_THAT(check_output(folder.path()).error().message, HasSubstr("it is a folder"));
  EXPECT_THAT(check_output(folder.path() / "no" / "x.json").error().message, HasSubstr("there is no folder"));
  EXPECT_THAT(check_output("/proc/x.json").error().message, HasSubstr("/proc/x.json: cannot be written"));
}

TEST(CheckOutput, LeavesEverythingAsItIs) {
  const tests::TempFolder folder;
  EXPECT_TRUE(check_output(folder.path() / "x.json"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  folder.write("x.json", "before");
  EXPECT_TRUE(check_output(folder.path() / "x.json"));
  EXPECT_EQ(tests::contents(folder.path() / "x.json"), "before");
  EXPECT_TRUE(check_output("/dev/null"));
  EXPECT_TRUE(check_output("-"));
}

TEST(WriteResults, SurvivesTextThatIsNoUtf8) {
  const tests::TempFolder folder;
  ASSERT_TRUE(write_results(folder.path() / "x.json", {{"file", "\xff.yaml"}}));
  EXPECT_FALSE(nlohmann::json::parse(tests::contents(folder.path() / "x.json"), nullptr, false).is_discarded());
}

TEST(NumberOrNull, IsNullWhereThereIsNoNumber) {
  EXPECT_EQ(number_or_null(1.5), 1.5);
  EXPECT_TRUE(number_or_null(std::nan("")).is_null());
  EXPECT_TRUE(number_or_null(HUGE_VAL).is_null());
}

TEST(Table, AlignsColumnsByCharactersNotBytes) {
  EXPECT_EQ(table({{"a", "mean", "n"}, {"long", "1 ± 2", "7"}, {"x"}}),
            "a     mean   n\n"
            "long  1 ± 2  7\n"
            "x\n");
}

}  // namespace
}  // namespace jostle::common
