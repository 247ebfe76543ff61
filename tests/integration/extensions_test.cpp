// What a lab adds to Jostle: a robot, a term of the objective, a controller. Each is one file, and none of ours
// changes; programs that are linked with them run them over DDS, in processes of their own.

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using testing::HasSubstr;

const std::string kArm = std::string(JOSTLE_SOURCE_DIR) + "/tests/support/robots/seven_axis_reach.yaml";

class Extensions : public RunFixture {
 protected:
  // Two steps of an arm of seven axes and two fingers, each of which costs 3·7.
  const std::string parameters = folder.write("toll.yaml", R"(
step_duration: 0.1
planner: {rollouts: 4, sigma: [0, 0, 0, 0, 0, 0, 0, 0], limit: [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.05]}
objective: {goal: 0, acceleration: 0, disturbance: 0, edge: 0, toll: 3, toll_price: 7}
)");
  const std::string numbers = folder.path() / "numbers.json";
};

TEST_F(Extensions, ATermAControllerAndARobotOfOneFileEachRunOverDds) {
  const int code =
      finish({kArm, "--controller", "two-steps", "--parameters", parameters, "--workers", "2", "--json", numbers});

  ASSERT_EQ(code, 0) << run->err() << log("coordinator.log");
  const auto result = nlohmann::json::parse(std::ifstream(numbers));
  EXPECT_EQ(result["controller"], "two-steps");
  EXPECT_EQ(result["reason"], "two steps taken");
  EXPECT_EQ(result["ending"], "succeeded");
  EXPECT_EQ(result["actions"], 2);
  EXPECT_EQ(result["cost"], 2 * 3 * 7);
  EXPECT_EQ(result["observed_states"].size(), 3u);
  EXPECT_EQ(result["provenance"]["seconds"].is_number(), true);
  EXPECT_THAT(result["parameters"].get<std::string>(), HasSubstr("toll_price: 7"));
}

TEST_F(Extensions, AreInTheHelpAndTheListsOfErrors) {
  EXPECT_EQ(finish({"--help"}), 0);
  EXPECT_THAT(run->out(), HasSubstr("two-steps: plans once and acts twice"));
  EXPECT_EQ(finish({kArm, "--controller", "three-steps"}), 2);
  EXPECT_THAT(run->err(), HasSubstr("--controller: got 'three-steps' for a task to reach with the robot"));
}

}  // namespace
}  // namespace jostle::tests
