// Runs and their motion out of bags: whole ones, and those that recorders leave that came
// late or lost something.

#include <gmock/gmock.h>

#include <cmath>

#include "services/bags/format/bag_writer.hpp"
#include "services/bags/recorded/recorded_motion.hpp"
#include "services/bags/recorded/recorded_run.hpp"
#include "services/wire/dds/cdr.hpp"
#include "services/world/link/messages.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::bags {
namespace {

using testing::HasSubstr;

constexpr Time kSecond = 1'000'000'000;

// A pusher and one object.
StateLayout layout() {
  return {.nq = 9, .nv = 8, .nu = 2, .joints = {"x", "y"}, .objects = {{.name = "can", .q = 2, .v = 2}}, .target = 0};
}

world::Seen seen_at(double x, double angle = 0.0) {
  return {
      .robot = {.q = {x, 0.0}, .v = {0.0, 0.0}},
      .objects = {
          {.name = "can", .position = {x + 1, 0, 0}, .orientation = {std::cos(angle / 2), 0, 0, std::sin(angle / 2)}}}};
}

class Recorded : public testing::Test {
 protected:
  Recorded() { writer = std::move(BagWriter::create(bag, {})).value(); }

  template <class T>
  void write(const std::string& topic, const std::string& type, Time time, const T& message) {
    write_bytes(topic, type, time, wire::to_cdr(message));
  }

  void write_bytes(const std::string& topic, const std::string& type, Time time, const std::vector<std::byte>& bytes) {
    if (!topics.contains(topic)) topics[topic] = writer->add_topic({.name = topic, .type = type}).value();
    ASSERT_TRUE(writer->write(topics[topic], {.log_time = time, .publish_time = time, .data = bytes}));
  }

  void begin(const std::string& goal, Time time) {
    jostle_msgs::msg::TaskRun run;
    run.goal().goal_id(goal);
    write("/task/run", "jostle_msgs/msg/TaskRun", time, run);
  }

  void observe(const std::string& goal, std::uint32_t number, Time time, double world, const world::Seen& seen) {
    auto message = world::to_message(seen, world);
    message.goal_id(goal);
    message.number(number);
    if (number > 0) message.duration(1.0);
    write("/task/observation", "jostle_msgs/msg/Observation", time, message);
  }

  void plan(const std::string& goal, std::uint32_t number, std::uint32_t observation, Time time, double world = 0.0) {
    jostle_msgs::msg::Plan message;
    message.header(world::make_header(world));
    message.goal_id(goal);
    message.number(number);
    message.observation(observation);
    write("/robots/b/task/plan", "jostle_msgs/msg/Plan", time, message);  // any namespace will do
  }

  void state(Time time, double world, double x, double angle = 0.0) {
    write("/objects/states", "jostle_msgs/msg/ObjectStates", time, world::to_message(seen_at(x, angle).objects, world));
    jostle_msgs::msg::RobotStatus status;
    status.header(world::make_header(world));
    status.q({x, 0.0});
    status.v({0.0, 0.0});
    write("/robot/status", "jostle_msgs/msg/RobotStatus", time, status);
  }

  void end(const std::string& goal, const std::string& reason, Time time) {
    jostle_msgs::msg::GoalResult result;
    result.goal_id(goal);
    result.reason(reason);
    result.ending(static_cast<std::uint8_t>(planners::Ending::kFailed));
    write("/task/result", "jostle_msgs/msg/GoalResult", time, result);
  }

  std::unique_ptr<BagReader> reader() {
    EXPECT_TRUE(writer->close());
    return std::move(BagReader::open(bag)).value();
  }

  tests::TempFolder folder;
  const std::filesystem::path bag = std::filesystem::path(folder.path()) / "bag";
  std::unique_ptr<BagWriter> writer;
  std::map<std::string, int> topics;
};

TEST_F(Recorded, RunsComeInTheOrderTheyWereTakenUp) {
  begin("second-name", kSecond), observe("second-name", 0, 2 * kSecond, 0, seen_at(0)),
      plan("second-name", 0, 0, 3 * kSecond);
  end("second-name", "target grasped", 4 * kSecond);
  begin("a-name", 5 * kSecond), observe("a-name", 0, 6 * kSecond, 0, seen_at(0));

  const auto runs_result = read_runs(*reader());

  ASSERT_TRUE(runs_result) << runs_result.error().message;
  ASSERT_EQ(runs_result->size(), 2u);
  const RecordedRun &first = runs_result->front(), &second = runs_result->back();
  EXPECT_EQ(first.run.goal().goal_id(), "second-name");
  EXPECT_EQ(first.begin, kSecond);
  EXPECT_EQ(first.end, 4 * kSecond);
  EXPECT_EQ(first.plans.size(), 1u);
  EXPECT_TRUE(first.concluded());
  EXPECT_FALSE(second.result);
  EXPECT_EQ(second.end, 6 * kSecond);
  EXPECT_FALSE(second.concluded());
  EXPECT_EQ(select_runs(*runs_result, "a-name")->size(), 1u);
  EXPECT_THAT(select_runs(*runs_result, "b-name").error().message, HasSubstr("second-name, a-name"));
}

// A GoalResult as it was before it had `ending`: CDR by hand, little endian.
std::vector<std::byte> old_result(const std::string& goal, bool success, const std::string& reason,
                                  const std::string& error = "") {
  std::vector<std::byte> bytes{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
  const auto text = [&](const std::string& value) {
    while (bytes.size() % 4 != 0) bytes.push_back({});
    const std::size_t size = value.size() + 1;
    for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::byte>(size >> shift));
    for (const char c : value) bytes.push_back(static_cast<std::byte>(c));
    bytes.push_back({});
  };
  text(goal);
  bytes.push_back(static_cast<std::byte>(success));
  text(reason);
  text(error);
  text("{}");
  return bytes;
}

TEST(ResultFromCdr, ReadsTheLayoutOfBeforeThereWereEndings) {
  using planners::Ending;
  const struct {
    bool success;
    const char *reason, *error;
    Ending ending;
  } cases[] = {{true, "target grasped", "", Ending::kSucceeded},
               {false, "dropped can", "", Ending::kFailed},
               {false, "timeout after 60 s", "", Ending::kTimedOut},
               {false, "cancelled", "robot: stopped in mid-action", Ending::kCancelled},
               {false, "refused", "coordinator: busy with goal g", Ending::kRefused},
               {false, "the system failed", "no worker heard for 10 s", Ending::kBroken}};
  for (const auto& [success, reason, error, ending] : cases) {
    SCOPED_TRACE(reason);
    std::vector<std::byte> bytes = old_result("a goal", success, reason, error);
    for (int padding = 0; padding < 4; ++padding) {  // RTPS fills up to four bytes, and recorders keep it
      const auto result = result_from_cdr(bytes);
      ASSERT_TRUE(result) << result.error().message;
      EXPECT_EQ(result->goal_id(), "a goal");
      EXPECT_EQ(result->success(), success);
      EXPECT_EQ(result->reason(), reason);
      EXPECT_EQ(result->error(), error);
      EXPECT_EQ(result->report(), "{}");
      EXPECT_EQ(result->ending(), 0);
      EXPECT_EQ(ending_of(*result), ending);
      bytes.push_back({});
    }
  }
}

TEST(ResultFromCdr, RefusesBytesThatAreCutOff) {
  const std::vector<std::byte> whole = old_result("a goal", true, "target grasped");
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(result_from_cdr(std::span(whole).first(size))) << size;
  }
}

TEST(EndingOf, BelievesTheFieldRatherThanTheSentence) {
  jostle_msgs::msg::GoalResult result;
  result.reason("timeout, says a sentence that nobody reads");
  for (std::uint8_t ending = 1; ending <= 6; ++ending) {
    result.ending(ending);
    EXPECT_EQ(static_cast<std::uint8_t>(ending_of(result)), ending);
  }
  result.ending(77);  // of a later version: the sentence again
  EXPECT_EQ(ending_of(result), planners::Ending::kTimedOut);
}

TEST_F(Recorded, RunsOfBeforeThereWereEndingsAreRead) {
  begin("g", kSecond), observe("g", 0, 2 * kSecond, 0, seen_at(0)), plan("g", 0, 0, 3 * kSecond);
  write_bytes("/task/result", "jostle_msgs/msg/GoalResult", 4 * kSecond, old_result("g", false, "timeout after 60 s"));
  begin("h", 5 * kSecond), observe("h", 0, 6 * kSecond, 0, seen_at(0)), plan("h", 0, 0, 7 * kSecond);
  write_bytes("/task/result", "jostle_msgs/msg/GoalResult", 8 * kSecond, old_result("h", false, "dropped can"));

  const auto runs_result = read_runs(*reader());

  ASSERT_TRUE(runs_result) << runs_result.error().message;
  ASSERT_EQ(runs_result->size(), 2u);
  EXPECT_FALSE(runs_result->front().concluded());
  EXPECT_TRUE(runs_result->back().concluded());
}

TEST_F(Recorded, WhatComesTwiceOrLateCountsOnce) {
  begin("g", kSecond), begin("g", kSecond);
  for (const std::uint32_t number : {1u, 0u, 1u, 2u}) observe("g", number, 2 * kSecond, number, seen_at(number));
  plan("g", 0, 0, 3 * kSecond), plan("g", 0, 0, 3 * kSecond);

  const auto runs_result = read_runs(*reader());

  ASSERT_TRUE(runs_result) << runs_result.error().message;
  ASSERT_EQ(runs_result->size(), 1u);
  ASSERT_EQ(runs_result->front().observations.size(), 3u);
  for (std::uint32_t i = 0; i < 3; ++i) EXPECT_EQ(runs_result->front().observations[i].number(), i);
  EXPECT_EQ(runs_result->front().plans.size(), 1u);
}

TEST_F(Recorded, AMissingObservationOrPlanIsNamed) {
  begin("g", kSecond);
  observe("g", 0, kSecond, 0, seen_at(0)), observe("g", 2, kSecond, 2, seen_at(0));
  EXPECT_THAT(read_runs(*reader()).error().message, HasSubstr("run g: observation 1 is missing"));
}

TEST_F(Recorded, WhyAnObservationIsMissingIsSaidAsTheBagKnowsIt) {
  begin("g", kSecond);
  observe("g", 0, kSecond, 0, seen_at(0)), observe("g", 2, kSecond, 2, seen_at(0));
  writer->set_note("lost", {{"/task/observation", "1"}});
  EXPECT_THAT(read_runs(*reader()).error().message, HasSubstr("its recorder lost 1 of /task/observation"));
}

TEST_F(Recorded, ARecoveredBagSaysThatWhatIsMissingWasDamaged) {
  begin("g", kSecond);
  observe("g", 0, kSecond, 0, seen_at(0)), observe("g", 2, kSecond, 2, seen_at(0));
  writer->set_note("lost", {{"/task/observation", "0"}});
  writer->set_note("recovered", {{"damage 1", "1 chunk lost"}});
  EXPECT_THAT(read_runs(*reader()).error().message, HasSubstr("the note `recovered`"));
}

TEST_F(Recorded, AMessageThatCannotBeReadCostsTheRunOnlyIfItIsNeeded) {
  begin("g", kSecond), observe("g", 0, kSecond, 0, seen_at(0)), observe("g", 1, kSecond, 1, seen_at(0));
  write_bytes("/task/result", "jostle_msgs/msg/GoalResult", 2 * kSecond, std::vector<std::byte>(3));

  const auto runs_result = read_runs(*reader());

  ASSERT_TRUE(runs_result) << runs_result.error().message;
  EXPECT_EQ(runs_result->front().observations.size(), 2u);
  ASSERT_EQ(runs_result->front().unreadable.size(), 1u);
  EXPECT_THAT(runs_result->front().unreadable.front(), HasSubstr("/task/result"));
}

TEST_F(Recorded, APlanOfAnObservationThatIsMissingIsNamed) {
  begin("g", kSecond), observe("g", 0, kSecond, 0, seen_at(0)), plan("g", 0, 1, kSecond);
  EXPECT_THAT(read_runs(*reader()).error().message, HasSubstr("run g: observation 1 is missing"));
}

TEST_F(Recorded, ABagWithoutARunSaysWhatIsInIt) {
  state(kSecond, 0, 0);
  const auto runs_result = read_runs(*reader());
  ASSERT_FALSE(runs_result);
  EXPECT_EQ(runs_result.error().code, Code::kNotFound);
  EXPECT_THAT(runs_result.error().message, HasSubstr("/objects/states, /robot/status"));
}

TEST_F(Recorded, BytesThatAreNoMessageAreNamed) {
  writer->add_topic({.name = "/task/run", .type = "jostle_msgs/msg/TaskRun"}).value();
  const std::array<std::byte, 6> bytes{};
  ASSERT_TRUE(writer->write(0, {.log_time = kSecond, .data = bytes}));
  EXPECT_THAT(read_runs(*reader()).error().message, HasSubstr("/task/run: 6 bytes"));
}

TEST_F(Recorded, MotionGoesStraightAndTurnsEvenlyBetweenSamples) {
  begin("g", kSecond), observe("g", 0, kSecond, 5.0, seen_at(0)), plan("g", 0, 0, kSecond, 5.0);
  state(kSecond, 5.0, 0.0), state(9 * kSecond, 5.0, 0.0);  // the world stands still while a plan is made
  state(10 * kSecond, 7.0, 0.2, 1.0);
  observe("g", 1, 10 * kSecond, 7.0, seen_at(0.2)), end("g", "target grasped", 10 * kSecond);
  const auto source = reader();
  const RecordedRun run = read_runs(*source)->front();

  const auto world_result = RecordedMotion::read(*source, run, layout(), RunClock::kWorld);
  const auto wall_result = RecordedMotion::read(*source, run, layout(), RunClock::kWall);

  ASSERT_TRUE(world_result) << world_result.error().message;
  EXPECT_DOUBLE_EQ(world_result->duration(), 2.0);
  const auto half = world_result->at(1.0);
  EXPECT_DOUBLE_EQ(half.state.q[0], 0.1);
  EXPECT_NEAR(2 * std::atan2(half.state.q[8], half.state.q[5]), 0.5, 1e-12);
  EXPECT_EQ(half.plan, 0);
  EXPECT_EQ(world_result->at(2.0).action, 1);
  EXPECT_EQ(world_result->at(-1.0).state, world_result->at(0.0).state);
  EXPECT_EQ(world_result->at(99.0).state, world_result->at(2.0).state);
  ASSERT_TRUE(wall_result);
  EXPECT_DOUBLE_EQ(wall_result->duration(), 9.0);
  EXPECT_DOUBLE_EQ(wall_result->at(8.0).state.q[0], 0.0);
}

TEST_F(Recorded, MotionOfABagWithoutStatesIsThatOfTheObservations) {
  begin("g", kSecond), observe("g", 0, kSecond, 0.0, seen_at(0)), observe("g", 1, 2 * kSecond, 1.0, seen_at(0.4));
  const auto source = reader();
  const RecordedRun run = read_runs(*source)->front();

  const auto motion_result = RecordedMotion::read(*source, run, layout(), RunClock::kWorld);

  ASSERT_TRUE(motion_result) << motion_result.error().message;
  EXPECT_DOUBLE_EQ(motion_result->at(0.5).state.q[0], 0.2);
}

TEST_F(Recorded, AStateThatDoesNotFitTheSceneIsNamed) {
  begin("g", kSecond), observe("g", 0, kSecond, 0.0, seen_at(0)), state(kSecond, 0, 0);
  const auto source = reader();
  const RecordedRun run = read_runs(*source)->front();
  StateLayout other = layout();
  other.objects[0].name = "bottle";
  EXPECT_THAT(RecordedMotion::read(*source, run, other, RunClock::kWorld).error().message,
              HasSubstr("no measurement of 'bottle'"));
}

}  // namespace
}  // namespace jostle::bags
