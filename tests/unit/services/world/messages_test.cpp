// What a robot says of its hand, over the wire and back.

#include "services/world/link/messages.hpp"

#include <gmock/gmock.h>

namespace jostle::world {
namespace {

namespace hand = jostle_msgs::msg::RobotStatus_Constants;

TEST(HandMessage, ComesBackAsItWas) {
  for (const std::optional<bool> in_hand : {std::optional(true), std::optional(false), std::optional<bool>()}) {
    EXPECT_EQ(in_hand_from(in_hand_message(in_hand)), in_hand);
    const auto seen_result = from_message(to_message(Seen{.robot = {.object_in_hand = in_hand}}, 0.5));
    ASSERT_TRUE(seen_result);
    EXPECT_EQ(seen_result->robot.object_in_hand, in_hand);
  }
}

TEST(HandMessage, ThatCannotTellIsNotEmpty) {
  jostle_msgs::msg::RobotStatus status;
  status.in_hand(hand::CANNOT_TELL);
  EXPECT_EQ(from_message(status)->object_in_hand, std::nullopt);
  status.in_hand(hand::EMPTY);
  EXPECT_EQ(from_message(status)->object_in_hand, std::optional(false));
  status.in_hand(hand::HOLDING);
  EXPECT_EQ(from_message(status)->object_in_hand, std::optional(true));
  status.in_hand(77);
  EXPECT_EQ(from_message(status)->object_in_hand, std::nullopt);
}

// Statuses and observations that were recorded before: a boolean was there, and these numbers.
TEST(HandMessage, NumbersAreThoseOfOldBags) {
  EXPECT_EQ(hand::EMPTY, static_cast<int>(false));
  EXPECT_EQ(hand::HOLDING, static_cast<int>(true));
  EXPECT_EQ(hand::CANNOT_TELL, 2);
}

TEST(StatusError, CrossesWithItsCode) {
  jostle_msgs::msg::RobotStatus status;
  put_error(Error{Code::kUnavailable, "protective stop"}, status);
  ASSERT_TRUE(error_of(status));
  EXPECT_EQ(error_of(status)->code, Code::kUnavailable);
  EXPECT_EQ(error_of(status)->message, "protective stop");
  put_error({}, status);
  EXPECT_FALSE(error_of(status));
}

// A commander ends its task when its own time is over, or when it is told to; not when its robot says so.
TEST(StatusError, DeadlinesAndCancellationsOfARobotAreNotItsCommanders) {
  for (const Code code : {Code::kDeadline, Code::kCancelled}) {
    jostle_msgs::msg::RobotStatus status;
    put_error(Error{code, "late"}, status);
    EXPECT_EQ(error_of(status)->code, Code::kUnavailable);
  }
}

TEST(StatusError, WithACodeThatIsNoneIsInternal) {
  jostle_msgs::msg::RobotStatus status;
  status.error("what?");
  status.error_code(200);
  EXPECT_EQ(error_of(status)->code, Code::kInternal);
}

}  // namespace
}  // namespace jostle::world
