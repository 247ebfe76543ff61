// JSON that somebody else wrote.

#include "idl/text/json.hpp"

#include <gmock/gmock.h>

namespace jostle {
namespace {

using testing::HasSubstr;

std::string nested(int depth) {
  const auto count = static_cast<std::size_t>(depth);
  return std::string(count, '[') + std::string(count, ']');
}

TEST(ParseJson, ReadsWhatIsThere) { EXPECT_EQ(parse_json(R"({"a": [1, 2]})").value()["a"][1], 2); }

TEST(ParseJson, SaysWhyThereIsNone) {
  EXPECT_THAT(parse_json("{1").error().message, HasSubstr("not JSON: "));
  EXPECT_EQ(parse_json("").error().code, Code::kInvalidArgument);
}

// Written or copied by recursion, such a value would end the stack, and the program with it.
TEST(ParseJson, RefusesWhatLiesTooDeepInItself) {
  EXPECT_TRUE(parse_json(nested(kMostJsonDepth)));
  EXPECT_THAT(parse_json(nested(kMostJsonDepth + 1)).error().message, HasSubstr("more than 64 deep"));
  EXPECT_FALSE(parse_json(nested(1'000'000)));
}

}  // namespace
}  // namespace jostle
