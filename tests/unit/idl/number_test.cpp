#include "idl/types/number.hpp"

#include <gtest/gtest.h>

#include <climits>
#include <cstdint>

namespace jostle {
namespace {

TEST(ParseWhole, TakesWhatIsANumberInRangeFromEndToEnd) {
  EXPECT_EQ(parse_whole("0", 0, 232), 0);
  EXPECT_EQ(parse_whole("232", 0, 232), 232);
  EXPECT_EQ(parse_whole("-7", INT_MIN, INT_MAX), -7);
  EXPECT_EQ((parse_whole<std::uint16_t>("65535", 1, UINT16_MAX)), 65535);
}

TEST(ParseWhole, TakesNothingElse) {
  for (const char* text : {"", " 1", "1 ", "+1", "1.0", "0x10", "one", "233", "-1", "99999999999999999999"}) {
    EXPECT_FALSE(parse_whole(text, 0, 232)) << text;
  }
  EXPECT_FALSE((parse_whole<std::uint16_t>("65536", 1, UINT16_MAX)));
}

TEST(ParseNumber, TakesFiniteDecimalNumbersOnly) {
  EXPECT_EQ(parse_number("050"), 50.0);
  EXPECT_EQ(parse_number("-1e-3"), -0.001);
  EXPECT_EQ(parse_number(".5"), 0.5);
  for (const char* text : {"", " 5", "5 ", "+5", "0x10", "1e999", "inf", "nan", "NAN", "-inf", "1_000", "1e", "e", "."})
    EXPECT_FALSE(parse_number(text)) << text;
}

TEST(WithoutPlus, LeavesEverythingElse) {
  EXPECT_EQ(without_plus("+5"), "5");
  for (const char* text : {"5", "-5", "+-5", "++5", "+", ""}) EXPECT_EQ(without_plus(text), text);
}

}  // namespace
}  // namespace jostle
