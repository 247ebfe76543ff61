// Our topics as Cyclone DDS hears them, the middleware of many ROS 2 systems.

#include <gmock/gmock.h>

#include <algorithm>
#include <sstream>

#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::SizeIs;

// What the listener printed: the words of every line by their first.
std::map<std::string, std::vector<std::vector<std::string>>> facts(const std::string& text) {
  std::map<std::string, std::vector<std::vector<std::string>>> result;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    result[kind].emplace_back(std::istream_iterator<std::string>(words), std::istream_iterator<std::string>());
  }
  return result;
}

class Cyclone : public RunFixture {};

TEST_F(Cyclone, HearsJointsPosesAndTransformsOfASimulatedWorld) {
  const physics_pool::Scene scene = three_objects();
  const State start = physics_pool::initial_state(scene);
  const StateLayout layout = physics_pool::layout_of(scene);
  const auto sim = program("jostle_sim", {easy});

  // Five of the robot's frames move: x, y, rotation, two fingers; and every object.
  const auto listener = program(JOSTLE_CYCLONE_LISTENER, {"20", "world", std::to_string(5 + scene.objects.size())});

  ASSERT_EQ(listener->wait(kPatience), 0) << listener->err() << sim->err();
  auto heard = facts(listener->out());
  ASSERT_THAT(heard["joint"], SizeIs(layout.joints.size())) << listener->out();
  for (std::size_t i = 0; i < layout.joints.size(); ++i) {
    EXPECT_EQ(heard["joint"][i][0], layout.joints[i]);
    EXPECT_EQ(std::stod(heard["joint"][i][1]), start.q[i]);
  }
  const std::string count = std::to_string(layout.joints.size());
  EXPECT_THAT(heard["joints"], ElementsAre(ElementsAre(count, count, count)));
  EXPECT_THAT(heard["frame"], ElementsAre(ElementsAre("world")));
  ASSERT_THAT(heard["pose"], SizeIs(scene.objects.size()));
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const auto q = start.q.begin() + layout.objects[i].q;
    for (int k = 0; k < 7; ++k) EXPECT_EQ(std::stod(heard["pose"][i][static_cast<std::size_t>(k)]), q[k]);
    EXPECT_THAT(heard["transform"], Contains(IsSupersetOf({std::string("world"), scene.objects[i].name})));
  }
  const std::pair<const char*, const char*> links[] = {{"robot_base", "gripper_x"},
                                                       {"gripper_x", "gripper_y"},
                                                       {"gripper_y", "gripper"},
                                                       {"gripper", "finger_left"},
                                                       {"gripper", "finger_right"}};
  for (const auto& [parent, child] : links) {
    const auto transform = std::ranges::find_if(heard["transform"], [&](const auto& t) { return t[1] == child; });
    ASSERT_NE(transform, heard["transform"].end()) << child;
    EXPECT_EQ((*transform)[0], parent);
    // The first slides along x from where the hand is drawn at 0: 35 mm above the surface.
    if (child == std::string("gripper_x")) {
      EXPECT_DOUBLE_EQ(std::stod((*transform)[2]), start.q[0]);
      EXPECT_DOUBLE_EQ(std::stod((*transform)[4]), 0.035);
    }
  }
  EXPECT_THAT(heard["static"], ElementsAre(ElementsAre("world", "robot_base", "0", "0", "0")));
  EXPECT_THAT(heard["description"].at(0), ElementsAre("<robot", HasSubstr("planar_gripper")));
}

TEST_F(Cyclone, HearsMarkersOfSceneAndPlanOfAGoalThatWasTakenUpBefore) {
  const physics_pool::Scene scene = three_objects();
  ASSERT_NO_FATAL_FAILURE(start_acting(0.2));

  const auto listener = program(JOSTLE_CYCLONE_LISTENER, {"20", "task"});

  ASSERT_EQ(listener->wait(kPatience), 0) << listener->err() << run->err();
  auto heard = facts(listener->out());
  ASSERT_FALSE(heard["scene"].empty());
  EXPECT_EQ(heard["scene"][0][0], "3") << "what was drawn before is deleted first";
  for (const physics_pool::SceneObject& object : scene.objects) {
    const char* type = object.shape == physics_pool::Shape::kBox ? "1" : "3";
    EXPECT_THAT(heard["scene"], Contains(ElementsAre("0", type, "0", "objects", object.name)));
  }
  EXPECT_THAT(heard["scene"], Contains(ElementsAre("0", "1", "0", "surface", "world")));
  ASSERT_THAT(heard["plan"], SizeIs(2));
  for (const auto& line : heard["plan"]) {
    EXPECT_EQ(line[1], "4");
    EXPECT_GE(std::stoi(line[2]), 2) << "points: the present one, and where it leads";
    EXPECT_EQ(line[4], "world");
  }
}

// As rmw_cyclonedds does it, which is not as rmw_fastrtps does: integration.actions has the latter.
class CycloneAction : public Cyclone {
 protected:
  void SetUp() override {
    coordinator = program("jostle_coordinator", {"--pool", "threads"});
    world = program("jostle_sim", {easy});
  }

  std::map<std::string, std::vector<std::vector<std::string>>> ask(const std::string& parameters,
                                                                   const std::string& what) {
    const auto client = program(JOSTLE_CYCLONE_ACTION_CLIENT, {"60", "grasp", easy, parameters, what});
    EXPECT_EQ(client->wait(kPatience), 0) << client->out() << client->err() << coordinator->err();
    return facts(client->out());
  }

  std::unique_ptr<ProgramProcess> coordinator, world;
};

TEST_F(CycloneAction, IsSentHeardOfAndEndsWithItsResult) {
  auto heard = ask(plain, "perform");
  EXPECT_THAT(heard["accepted"], ElementsAre(ElementsAre("1", "1")));
  EXPECT_THAT(heard["feedback"], ElementsAre(ElementsAre("1")));
  EXPECT_THAT(heard["result"], ElementsAre(ElementsAre("4", "1", "1", "1"))) << coordinator->err();
  EXPECT_EQ(heard["status"].back(), std::vector<std::string>{"4"});
  EXPECT_THAT(heard["others"], ElementsAre(ElementsAre("0"), ElementsAre("1")));
}

TEST_F(CycloneAction, IsCancelled) {
  auto heard = ask(endless, "cancel");
  EXPECT_THAT(heard["cancel"], ElementsAre(ElementsAre("0", "1")));
  EXPECT_THAT(heard["result"], ElementsAre(ElementsAre("5", "0", "4", "1"))) << coordinator->err();
  EXPECT_EQ(heard["status"].back(), std::vector<std::string>{"5"});
}

}  // namespace
}  // namespace jostle::tests
