// The controllers of Chapter 4: the same decisions on any pool and in a replay. They, those of Chapter 5 and guided
// planning: the same plans, whatever happens to workers.

#include <gmock/gmock.h>

#include <deque>
#include <future>
#include <nlohmann/json.hpp>

#include "physics_pool/local/thread_pool.hpp"
#include "planners/adaptive/adaptive_planner.hpp"
#include "planners/guided/guided.hpp"
#include "planners/robustness/robust_sto.hpp"
#include "services/pool/client/remote_pool.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using nlohmann::json;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

class RobustRuns : public RunFixture, public ::testing::WithParamInterface<const char*> {
 protected:
  std::string in_folder(const std::string& name) const { return folder.path() / name; }

  // Two iterations of a few rollouts for each plan, as none is ever feasible, in a world that is not quite as believed.
  json decisions(const std::string& pool) {
    const auto parameters = folder.write("few.yaml",
                                         "planner: {rollouts: 2}\n"
                                         "objective: {success_cost: 1.0e-9}\n"
                                         "robust: {starts: 2, worlds: 1, horizon: 4, iterations: 2, mpc_iterations: 1, "
                                         "max_actions: 4}\n");
    const std::string report = in_folder(pool + ".json");
    finish({easy, "--controller", GetParam(), "--uncertainty", "low", "--seed", "5", "--pool", pool, "--workers", "2",
            "--parameters", parameters, "--json", report, "--record", in_folder(pool)});
    return json::parse(contents(report));
  }
};

TEST_P(RobustRuns, DecideTheSameOnThreadsOnWorkersAndAgain) {
  const json threads = decisions("threads"), workers = decisions("dds");
  EXPECT_EQ(threads["controls"], workers["controls"]) << run->err();
  EXPECT_EQ(threads["observed_states"], workers["observed_states"]);
  EXPECT_EQ(threads["rollouts"], workers["rollouts"]);
  ASSERT_GE(workers["actions"], 4) << run->err();
  if (std::string(GetParam()) == "ocl") {
    EXPECT_THAT(run->err(), ContainsRegex("\\[(open|closed) [0-9]-[0-9]\\]"));  // what is under way
  }

  const auto replay = program("jostle_replay", {in_folder("dds")});
  EXPECT_EQ(replay->wait(kPatience).value_or(-1), 0) << replay->out() << replay->err();
  EXPECT_THAT(replay->out(), HasSubstr("BIT-EQUAL"));
}

INSTANTIATE_TEST_SUITE_P(Controllers, RobustRuns, ::testing::Values("ol", "rol", "cp", "cc", "ocl"),
                         [](const auto& test) { return std::string(test.param); });

// What controllers plan with.
struct Planning {
  const char* name;
  /// Of the worker that dies, before it does.
  std::uint64_t rollouts;
  /// Whether the plan says how robust it is.
  bool weighs;
  std::unique_ptr<planners::Planner> (*make)(physics_pool::Pool& pool, const physics_pool::Scene& scene,
                                             const physics_pool::TaskGeometry& geometry);
};

// By costs (OL, CC), in the planning world (CP), in several (ROL, OCL).
template <int starts, int worlds>
std::unique_ptr<planners::Planner> robust(physics_pool::Pool& pool, const physics_pool::Scene& scene,
                                          const physics_pool::TaskGeometry& geometry) {
  return std::make_unique<planners::RobustSto>(pool, scene, geometry,
                                               planners::PbstoOptions{.rollouts = 6, .step_duration = 0.2},
                                               planners::RobustStoOptions{.starts = starts, .worlds = worlds});
}

// As `jostle run` grasps.
std::unique_ptr<planners::Planner> guided(physics_pool::Pool& pool, const physics_pool::Scene& scene,
                                          const physics_pool::TaskGeometry&) {
  return planners::GuidedPlanner::make(pool, scene, {}, {.candidates = 30, .judged = 4}).value();
}

// As tampc decides.
std::unique_ptr<planners::Planner> adaptive(physics_pool::Pool& pool, const physics_pool::Scene&,
                                            const physics_pool::TaskGeometry& geometry) {
  return std::make_unique<planners::AdaptivePlanner>(
      pool, geometry, planners::PbstoOptions{.rollouts = 6, .step_duration = 0.2},
      planners::AdaptiveOptions{.sequences = 4, .samples = 6, .iterations = 3, .rest = 0.1, .step_duration = 0.2});
}

class Plans : public ::testing::TestWithParam<Planning> {
 protected:
  planners::Plan plan_on(physics_pool::Pool& pool) const {
    planners::Problem problem{.world = pool.load(scene).value(), .x0 = physics_pool::initial_state(scene)};
    for (int t = 0; t < 3; ++t) problem.initial.append(std::vector{0.1, 0.0, 0.0, 0.0});
    problem.iterations = 5;
    problem.seed = 42;
    problem.objective.success_cost = 0.0;
    const physics_pool::TaskGeometry geometry(scene);
    auto result = GetParam().make(pool, scene, geometry)->plan(problem, in(kPatience));
    if (!result) throw std::runtime_error(result.error().message);
    return std::move(result).value();
  }

  const int domain = test_domain();
  const physics_pool::Scene scene = small_scene();
  std::deque<WorkerProcess> workers;
};

TEST_P(Plans, AreTheSameWhenAWorkerIsKilledInMidIterationAndReplaced) {
  physics_pool::ThreadPool threads(2);
  const planners::Plan wanted = plan_on(threads);
  const auto participant = wire::Participant::open({.domain = domain}).value();
  pool::RemotePool remote(participant);
  for (int i = 0; i < 2; ++i) workers.emplace_back(domain);
  ASSERT_TRUE(remote.wait_for_workers(2, in(kPatience)));

  auto plan = std::async(std::launch::async, [&] { return plan_on(remote); });
  const auto name = fmt::format("-{}", workers[0].pid());
  ASSERT_TRUE(eventually(in(kPatience), [&] {
    for (const physics_pool::WorkerStatus& status : remote.status().workers) {
      if (status.name.ends_with(name) && status.rollouts >= GetParam().rollouts) return true;
    }
    return false;
  }));
  workers[0].end(SIGKILL);
  workers.emplace_back(domain);
  const planners::Plan got = plan.get();

  EXPECT_EQ(got.controls, wanted.controls);
  EXPECT_EQ(got.states, wanted.states);
  EXPECT_EQ(got.cost, wanted.cost);
  EXPECT_EQ(got.rollouts, wanted.rollouts);
  EXPECT_EQ(got.choices, wanted.choices);
  EXPECT_EQ(got.robustness, wanted.robustness);
  EXPECT_EQ(got.robustness.has_value(), GetParam().weighs);
}

INSTANTIATE_TEST_SUITE_P(Planners, Plans,
                         ::testing::Values(Planning{"by_cost", 4, false, &robust<0, 0>},
                                           Planning{"in_one_world", 4, true, &robust<3, 0>},
                                           Planning{"in_several_worlds", 4, true, &robust<3, 2>},
                                           Planning{"guided", 2, false, &guided},
                                           Planning{"adaptive", 4, false, &adaptive}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace jostle::tests
