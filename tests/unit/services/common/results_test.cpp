#include "services/common/results/results.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "services/common/results/table.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

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
