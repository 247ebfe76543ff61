#include "services/wire/dds/names.hpp"

#include <gmock/gmock.h>

namespace jostle::wire {
namespace {

using ::testing::HasSubstr;

TEST(Namespace, IsWordsWithSlashesBetween) {
  EXPECT_EQ(parse_namespace("").value(), "");
  EXPECT_EQ(parse_namespace("left").value(), "left");
  EXPECT_EQ(parse_namespace("/left").value(), "left");
  EXPECT_EQ(parse_namespace("/lab_1/Arm2").value(), "lab_1/Arm2");
  EXPECT_EQ(parse_namespace("pooling").value(), "pooling");
}

TEST(Namespace, ComesBeforeTheNameThatRos2Shows) {
  EXPECT_EQ(in_namespace("", "rt/tf"), "rt/tf");
  EXPECT_EQ(in_namespace("left", "rt/objects/poses"), "rt/left/objects/poses");
  EXPECT_EQ(in_namespace("lab/left", "rt/tf"), "rt/lab/left/tf");
  EXPECT_EQ(in_namespace("left", "rq/grasp/_action/send_goalRequest"), "rq/left/grasp/_action/send_goalRequest");
  EXPECT_EQ(in_namespace("left", "rr/grasp/_action/send_goalReply"), "rr/left/grasp/_action/send_goalReply");
  EXPECT_EQ(in_namespace("left", "ros_discovery_info"), "ros_discovery_info");
}

class BadNamespace : public ::testing::TestWithParam<const char*> {};

TEST_P(BadNamespace, IsRefusedWithGotAndWanted) {
  const auto result = parse_namespace(GetParam());

  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kInvalidArgument);
  EXPECT_THAT(result.error().message, HasSubstr(std::string("namespace: got '") + GetParam() + "', wanted "));
}

INSTANTIATE_TEST_SUITE_P(, BadNamespace,
                         ::testing::Values("/", "left/", "//left", "lab//left", "1left", "lab/1", "le ft", "left-arm",
                                           "l\xc3\xa4"
                                           "b",
                                           "two__underscores", "a\nb", "~left", "{node}", "*", "pool", "/pool/x",
                                           "doctor",
                                           "a23456789012345678901234567890123456789012345678901234567890abcde"));

}  // namespace
}  // namespace jostle::wire
