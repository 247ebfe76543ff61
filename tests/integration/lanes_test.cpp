// One plan, however many lanes simulate it.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using nlohmann::json;

class Lanes : public RunFixture {
 protected:
  // A plan's hash, its cost and what it took, made by `processes` workers of `threads` lanes each.
  json planned_by(int processes, int threads) {
    std::vector<std::unique_ptr<ProgramProcess>> workers;
    for (int i = 0; i < processes; ++i) {
      workers.push_back(program("jostle_worker", {"--threads", std::to_string(threads)}));
    }
    for (const auto& worker : workers) EXPECT_TRUE(worker->says("rollouts at a time", kPatience)) << worker->err();
    const std::string file = folder.path() / "plan.json";
    EXPECT_EQ(finish({easy, "--plan-only", "--workers", "0", "--parameters", wide, "--json", file}), 1) << run->err();
    json report = json::parse(contents(file), nullptr, false);
    used = report["used_workers"].size();
    return {report["plan_hash"], report["cost"], report["rollouts"]};
  }

  // A sample for each of 1,024 lanes at once: 128 candidates, each the best of eight that are screened. No plan is
  // good enough, so every iteration is made.
  const std::string wide = folder.write("wide.yaml",
                                        "planner: {guidance: 0, rollouts: 128}\n"
                                        "objective: {success_cost: 1.0e-9}\n"
                                        "control: {many_iterations: 1, initial_steps: 2}\n");
  std::size_t used = 0;
};

TEST_F(Lanes, FromOneToAThousandPlanTheSameToTheLastBit) {
  const json by_one = planned_by(1, 1);
  ASSERT_GT(by_one[2].get<int>(), 1024);

  EXPECT_EQ(planned_by(1, 64), by_one);
  EXPECT_EQ(planned_by(16, 64), by_one);
  EXPECT_GT(used, 8u) << "of 16 processes";
}

}  // namespace
}  // namespace jostle::tests
