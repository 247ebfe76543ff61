#include "idl/text/nearest.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace jostle {
namespace {

TEST(Edits, CountLettersPutInLeftOutChangedAndSwapped) {
  EXPECT_EQ(edits("", ""), 0u);
  EXPECT_EQ(edits("run", ""), 3u);
  EXPECT_EQ(edits("friction", "frictoin"), 1u);
  EXPECT_EQ(edits("reply", "replay"), 1u);
  EXPECT_EQ(edits("abc", "cab"), 2u);
}

TEST(Nearest, IsTheWordThatTakesTheFewestEdits) {
  const std::vector<std::string> words{"record", "replay", "run"};
  EXPECT_EQ(nearest("reply", words), "replay");
  EXPECT_EQ(nearest("recrod", words), "record");
  EXPECT_EQ(nearest("xyz", words), "");
  EXPECT_EQ(nearest(std::string(100, 'r'), words), "");
  EXPECT_EQ(nearest("run", std::vector<std::string>{}), "");
}

}  // namespace
}  // namespace jostle
