// Our topics as Cyclone DDS hears them, the middleware of many ROS 2 systems.

#include <gmock/gmock.h>

#include <sstream>

#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using ::testing::ElementsAre;
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

  const auto listener = program(JOSTLE_CYCLONE_LISTENER, {"20"});

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
  ASSERT_THAT(heard["transform"], SizeIs(scene.objects.size()));
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const auto q = start.q.begin() + layout.objects[i].q;
    for (int k = 0; k < 7; ++k) EXPECT_EQ(std::stod(heard["pose"][i][static_cast<std::size_t>(k)]), q[k]);
    EXPECT_THAT(heard["transform"][i], ElementsAre("world", scene.objects[i].name));
  }
}

}  // namespace
}  // namespace jostle::tests
