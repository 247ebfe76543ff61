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

}  // namespace
}  // namespace jostle::world
