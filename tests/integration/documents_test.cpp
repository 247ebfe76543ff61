// Documents that say what the code says are made by the code.

#include <gmock/gmock.h>

#include "tests/support/program_process.hpp"

namespace jostle::tests {
namespace {

using ::testing::HasSubstr;
using std::chrono_literals::operator""s;

// docs/parameters.md holds `jostle parameters --markdown`.
TEST(Documents, OfParametersHoldTheTableOfTheCode) {
  const TempFolder folder;
  ProgramProcess program("jostle_parameters", {"--markdown"}, folder);
  ASSERT_EQ(program.wait(60s), 0) << program.err();

  const std::string document = contents(std::filesystem::path(JOSTLE_SOURCE_DIR) / "docs" / "parameters.md");

  EXPECT_THAT(document, HasSubstr(program.out())) << "put what `jostle parameters --markdown` prints there";
}

}  // namespace
}  // namespace jostle::tests
