// jostle run from start to grasp: what it leaves behind, and that a plan does
// not depend on who computed it.

#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

class Run : public RunFixture {
 protected:
  std::string result_file() const { return folder.path() / "result.json"; }

  json result() const { return json::parse(contents(result_file()), nullptr, false); }

  // Parameters of an honest search of several iterations; that no plan is good
  // enough for success makes it run them all.
  std::string never_content(const std::string& planner) const {
    return folder.write("never.yaml", "objective: {success_cost: 1.0e-9}\ncontrol: {many_iterations: 6}\n" + planner);
  }
};

TEST_F(Run, GraspsTheTargetOfAnEasySceneAndTellsAll) {
  ASSERT_EQ(finish({easy, "--workers", "2", "--seed", "7", "--json", result_file()}), 0) << run->err();

  const json report = result();
  for (const char* key : {"success", "ending", "reason", "scene_hash", "seed", "controller", "uncertainty", "pool",
                          "workers", "plan_hash", "cost", "iterations", "replans", "actions", "plan_seconds",
                          "total_seconds", "rollouts", "dropped_objects"}) {
    EXPECT_TRUE(report.contains(key)) << key;
  }
  EXPECT_EQ(report["success"], true);
  EXPECT_EQ(report["ending"], "succeeded");
  EXPECT_EQ(report["seed"], 7);
  EXPECT_EQ(report["controller"], "or");
  EXPECT_EQ(report["uncertainty"], "none");
  EXPECT_EQ(report["pool"], "dds");
  EXPECT_EQ(report["workers"], 2);
  EXPECT_EQ(report["dropped_objects"], json::array());
  EXPECT_GE(report["actions"], 1);
  EXPECT_GE(report["rollouts"], 1);
  EXPECT_GE(report["total_seconds"], report["plan_seconds"]);
  EXPECT_THAT(run->out(), HasSubstr("SUCCESS"));
  EXPECT_TRUE(run_folders().empty());
}

// A reader of the numbers needs to know which is which, when each state was and what was done in between.
TEST_F(Run, SaysWhatItsNumbersAreAndWhen) {
  ASSERT_EQ(finish({easy, "--pool", "threads", "--set", "step_duration=0.5", "--json", result_file()}), 0)
      << run->err();

  const json report = result();
  const std::size_t seen = report["observed_states"].size();
  EXPECT_EQ(report["observed_times"].size(), seen);
  EXPECT_EQ(report["observed_velocities"].size(), seen);
  EXPECT_EQ(report["controls"].size(), seen - 1);
  EXPECT_EQ(report["plan_states"].size(), report["plan_controls"].size() + 1);
  for (std::size_t i = 0; i < seen; ++i) EXPECT_NEAR(report["observed_times"][i].get<double>(), 0.5 * double(i), 1e-6);
  const json& layout = report["layout"];
  EXPECT_EQ(layout["q"].size(), report["observed_states"][0].size());
  EXPECT_EQ(layout["v"].size(), report["observed_velocities"][0].size());
  EXPECT_EQ(layout["u"].size(), report["controls"][0].size());
  for (const char* part : {"q", "v", "u"}) {
    EXPECT_EQ(layout[part].size(), layout[std::string(part) + "_units"].size());
  }
  EXPECT_EQ(report["changed_parameters"], json({{"step_duration", {{"value", 0.5}, {"default", 1.0}}}}));
  const std::string text = contents(result_file());
  EXPECT_LT(std::ranges::count(text, '\n'), 200) << "a state per line";
}

// The ordinary failure: no plan in time. It is an answer, not an accident.
TEST_F(Run, ThatFindsNoPlanInTimeSaysSo) {
  const std::string picture = folder.path() / "x.png";
  ASSERT_EQ(finish({easy, "--workers", "1", "--parameters", endless, "--timeout", "1", "--json", result_file(),
                    "--picture", picture}),
            1)
      << run->err();

  EXPECT_THAT(run->out(), HasSubstr("FAILURE: timeout after 1 s"));
  EXPECT_THAT(run->out(), HasSubstr("control.timeout 1, by default 900"));
  const json report = result();
  EXPECT_EQ(report["success"], false);
  EXPECT_EQ(report["ending"], "timed out");
  EXPECT_TRUE(report["cost"].is_null());
  EXPECT_TRUE(report["plan_hash"].is_null());
  EXPECT_TRUE(std::filesystem::exists(picture));
  EXPECT_TRUE(run_folders().empty());
}

// What a file leaves out keeps what it is without the file.
TEST_F(Run, ParameterFilesChangeOnlyWhatTheyName) {
  const std::string file = folder.write("same.yaml", "control: {timeout: 200}\n");
  const auto hash_with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {easy, "--plan-only", "--pool", "threads", "--json", result_file()});
    EXPECT_EQ(finish(more), 0) << run->err();
    return result()["plan_hash"];
  };
  EXPECT_EQ(hash_with({"--parameters", file}), hash_with({}));
}

TEST_F(Run, PinnedWorkersFindTheSamePlan) {
  const auto plan_with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {easy, "--plan-only", "--parameters", plain, "--json", result_file()});
    EXPECT_EQ(finish(more), 0) << run->err();
    return result()["plan_hash"];
  };
  EXPECT_EQ(plan_with({"--workers", "auto", "--pin"}), plan_with({"--workers", "1"}));
}

// Every process of it: coordinator, simulated world, two workers.
TEST_F(Run, PushesTheTargetToItsGoalAndTellsAll) {
  const auto scene = folder.write("push.yaml", physics_pool::to_yaml(push_ahead()));
  const std::string picture = folder.path() / "push.png";

  ASSERT_EQ(finish({scene, "--workers", "2", "--seed", "7", "--json", result_file(), "--picture", picture}), 0)
      << run->err();

  const json report = result();
  EXPECT_EQ(report["success"], true);
  EXPECT_EQ(report["reason"], "target in the goal region");
  EXPECT_EQ(report["controller"], "mpc");
  EXPECT_EQ(report["replans"], report["actions"].get<int>() - 1);
  EXPECT_GE(report["planning_seconds"], report["plan_seconds"]);
  EXPECT_GE(report["total_seconds"], report["planning_seconds"]);
  EXPECT_EQ(report["observed_states"].size(), report["actions"].get<std::size_t>() + 1);
  EXPECT_THAT(run->out(), HasSubstr("SUCCESS"));
  EXPECT_TRUE(std::filesystem::exists(picture));
}

TEST_F(Run, PushesAlikeWithThreadsAndWorkers) {
  const auto scene = folder.write("push.yaml", physics_pool::to_yaml(push_around()));
  const auto parameters = folder.write("never.yaml",
                                       "planner: {rollouts: 8, sigma: [0.01, 0.01], limit: [0.1, 0.1]}\n"
                                       "objective: {success_cost: 1.0e-9}\nmpc: {first_iterations: 3}\n");
  std::set<double> costs;
  for (const char* predictor : {"fine", "parareal:1,planar", "coarse,kinematic"}) {
    std::optional<json> first;
    for (const char* pool : {"threads", "dds"}) {
      SCOPED_TRACE(fmt::format("{} {}", predictor, pool));
      ASSERT_EQ(finish({scene, "--plan-only", "--predictor", predictor, "--pool", pool, "--parameters", parameters,
                        "--json", result_file()}),
                1)
          << run->err();  // no plan is good enough

      const json report = result();
      if (!first) first = report;
      EXPECT_EQ(report["predictor"], predictor);
      EXPECT_EQ(report["iterations"], 3);
      EXPECT_EQ(report["plan_hash"], (*first)["plan_hash"]);
      EXPECT_EQ(report["cost"], (*first)["cost"]);
      EXPECT_EQ(report["rollouts"], (*first)["rollouts"]);
    }
    costs.insert((*first)["cost"].get<double>());
  }
  EXPECT_EQ(costs.size(), 3u) << "every predictor should expect another cost";
}

TEST_F(Run, NamesTheSceneByTheHashThatCheckPrints) {
  const auto check = program("jostle_scene", {"check", easy});
  ASSERT_EQ(check->wait(kPatience), 0);

  ASSERT_EQ(finish({easy, "--parameters", plain, "--plan-only", "--pool", "threads", "--json", result_file()}), 0)
      << run->err();

  EXPECT_EQ("ok " + result()["scene_hash"].get<std::string>() + "\n", check->out());
}

TEST_F(Run, PlanOnlyMovesNothing) {
  ASSERT_EQ(finish({easy, "--parameters", plain, "--plan-only", "--workers", "1", "--json", result_file()}), 0)
      << run->err();

  EXPECT_EQ(result()["actions"], 0);
  EXPECT_EQ(result()["replans"], 0);
  EXPECT_THAT(run->err(), Not(HasSubstr("acting")));
}

TEST_F(Run, NaiveReplanningWithThreadsUnderUncertainty) {
  ASSERT_EQ(finish({easy, "--parameters", plain, "--controller", "nr", "--pool", "threads", "--uncertainty", "low",
                    "--json", result_file()}),
            0)
      << run->err();

  EXPECT_EQ(result()["controller"], "nr");
  EXPECT_EQ(result()["pool"], "threads");
  EXPECT_EQ(result()["uncertainty"], "low");
  EXPECT_EQ(result()["success"], true);
}

TEST_F(Run, WithoutWorkersOfItsOwnItTakesThoseOnTheDomain) {
  const WorkerProcess worker(domain);

  EXPECT_EQ(finish({easy, "--parameters", plain, "--plan-only", "--workers", "0"}), 0) << run->err();
}

// With full physics, and with every lever that makes it cheaper.
class RunWith : public Run, public ::testing::WithParamInterface<const char*> {};

TEST_P(RunWith, PlanIsTheSameForEveryPoolAndWhenAWorkerDies) {
  struct Case {
    const char *pool, *workers;
    bool kill_one;
  };
  const std::vector<std::string> task{easy,     "--plan-only", "--parameters", never_content(GetParam()),
                                      "--json", result_file()};
  std::optional<json> first;
  for (const Case& c : {Case{"threads", "1", false}, Case{"threads", "2", false}, Case{"dds", "1", false},
                        Case{"dds", "2", false}, Case{"dds", "2", true}}) {
    SCOPED_TRACE(fmt::format("{} {}{}", c.pool, c.workers, c.kill_one ? ", one killed" : ""));
    std::vector<std::string> arguments = task;
    arguments.insert(arguments.end(), {"--pool", c.pool, "--workers", c.workers});
    start(arguments);
    if (c.kill_one) {
      ASSERT_TRUE(searches()) << run->err();
      const pid_t victim = run->child("jostle_worker");
      ASSERT_GT(victim, 0);
      kill(victim, SIGKILL);
    }

    ASSERT_EQ(run->wait(kPatience), 1) << run->err();  // no plan is good enough

    const json report = result();
    if (!first) first = report;
    EXPECT_EQ(report["iterations"], 6);
    EXPECT_EQ(report["plan_hash"], (*first)["plan_hash"]);
    EXPECT_EQ(report["cost"], (*first)["cost"]);
    EXPECT_EQ(report["rollouts"], (*first)["rollouts"]);
    if (c.kill_one) {
      EXPECT_THAT(run->err(), HasSubstr("killed by signal 9"));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Physics, RunWith,
                         ::testing::Values("planner: {rollouts: 8}\n",
                                           "planner: {rollouts: 8, freeze: true, screening: 8, stop_hopeless: true}\n"),
                         [](const auto& planner) { return planner.index == 0 ? "full" : "cheap"; });

TEST_F(Run, WorkerStartedByHandJoinsAPlanThatRuns) {
  start_planning({"--set", "planner.guidance_judged=6"});  // work for more than the two that are there
  const auto participant = wire::Participant::open({.domain = domain}).value();
  wire::Inbox<jostle_msgs::msg::Feedback> feedback(participant, wire::topics::kTaskFeedback, 64);

  const WorkerProcess late(domain);
  const auto started = Clock::now();
  const std::string name_end = fmt::format("-{}", late.pid());
  const bool works = soon(10s, [&] {
    for (const auto& news : feedback.take_all()) {
      for (const auto& worker : news.workers()) {
        if (worker.name().ends_with(name_end) && worker.alive() && worker.rollouts() > 0) return true;
      }
    }
    return false;
  });
  const std::chrono::duration<double> took = Clock::now() - started;

  ASSERT_TRUE(works) << run->err();
  fmt::print("first rollouts of the new worker reported after {:.2f} s\n", took.count());
  EXPECT_LT(took, 3s);  // about one when the machine is not loaded
  EXPECT_FALSE(run->code()) << run->err();
}

}  // namespace
}  // namespace jostle::tests
