// What the generated code writes is what our own definitions say.

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <gmock/gmock.h>
#include <idl/msg/task.h>

#include <nlohmann/json.hpp>

#include "services/bags/format/definitions.hpp"
#include "tests/support/bags.hpp"

namespace jostle::tests {
namespace {

namespace msg = jostle_msgs::msg;

template <class T>
nlohmann::ordered_json decoded(const std::string& type, const T& message) {
  Bytes bytes(4096);
  eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  message.serialize(cdr);
  bytes.resize(cdr.getSerializedDataLength());
  return taken(taken(bags::Decoder::create(type, bags::definition_of(type).value())).decode(bytes));
}

TEST(WireAndDefinition, AgreeOnAPlan) {
  msg::Plan plan;
  plan.header().stamp().sec(5);
  plan.header().frame_id("world");
  plan.goal_id("g");
  plan.number(3);
  plan.q({0.5, -1.0});
  plan.nu(2);
  plan.clear_hand(true);
  plan.controls({1.0, 2.0, 3.0, 4.0});
  plan.cost(-7.25);
  plan.rollouts(1ull << 40);
  const auto json = decoded("jostle_msgs/msg/Plan", plan);
  EXPECT_EQ(json["header"]["stamp"]["sec"], 5);
  EXPECT_EQ(json["header"]["frame_id"], "world");
  EXPECT_EQ(json["number"], 3);
  EXPECT_EQ(json["q"], nlohmann::ordered_json({0.5, -1.0}));
  EXPECT_EQ(json["clear_hand"], true);
  EXPECT_EQ(json["controls"].size(), 4u);
  EXPECT_EQ(json["cost"], -7.25);
  EXPECT_EQ(json["rollouts"], 1ull << 40);
}

TEST(WireAndDefinition, AgreeOnWhatIsMadeOfParts) {
  msg::Observation observation;
  observation.goal_id("goal");
  observation.in_hand(2);
  observation.objects().resize(2);
  observation.objects()[1].name("can");
  observation.objects()[1].pose().orientation().w(1.0);
  observation.objects()[1].angular().z(-0.5);
  const auto json = decoded("jostle_msgs/msg/Observation", observation);
  EXPECT_EQ(json["in_hand"], 2);
  EXPECT_EQ(json["objects"][1]["name"], "can");
  EXPECT_EQ(json["objects"][1]["pose"]["orientation"]["w"], 1.0);
  EXPECT_EQ(json["objects"][1]["angular"]["z"], -0.5);
}

}  // namespace
}  // namespace jostle::tests
