// Parts of a run that die or stall, and what the rest makes of it.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Wanted are 2 s; a machine with other work gets half as much again.
constexpr auto kReport = 3s;

struct Death {
  const char* program;
  bool acting;  // else planning
  const char* blamed;
};

class Deaths : public RunFixture {
 protected:
  // Signals a child and gives the run's exit code; measures how long it took.
  int code_after(pid_t victim, int signal, std::chrono::milliseconds patience) {
    run->children();  // whoever must be gone at the end
    const auto start = Clock::now();
    kill(victim, signal);
    const auto code = run->wait(patience);
    took = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - start);
    return code.value_or(-1);
  }

  std::chrono::milliseconds took{};
};

class PartOfARun : public Deaths, public ::testing::WithParamInterface<Death> {};

TEST_P(PartOfARun, EndsTheRunWithItsNameWhenItIsGone) {
  ASSERT_NO_FATAL_FAILURE(GetParam().acting ? start_acting() : start_planning());
  const pid_t victim = run->child(GetParam().program);
  ASSERT_GT(victim, 0);

  EXPECT_EQ(code_after(victim, SIGKILL, 20s), 3);

  fmt::print("reported after {} ms: {}\n", took.count(), run->err().substr(run->err().find("jostle run:")));
  EXPECT_LT(took, kReport);
  // The coordinator may be the first to miss the world: it knows it as robot.
  EXPECT_THAT(run->err(), HasSubstr("jostle run: "));
  EXPECT_THAT(run->err(), AnyOf(HasSubstr(GetParam().blamed),
                                HasSubstr(std::string(GetParam().program) == "jostle_sim" ? "robot: nothing heard"
                                                                                          : GetParam().blamed)));
  EXPECT_THAT(run->left_over(), IsEmpty());
  EXPECT_THAT(run_folders(), IsEmpty());
}

constexpr const char* kSim = "jostle_sim";
constexpr const char* kCoordinator = "jostle_coordinator";

INSTANTIATE_TEST_SUITE_P(, PartOfARun,
                         ::testing::Values(Death{kSim, false, "the simulated world ended: killed by signal 9"},
                                           Death{kSim, true, "the simulated world ended: killed by signal 9"},
                                           Death{kCoordinator, false, "the coordinator ended: killed by signal 9"},
                                           Death{kCoordinator, true, "the coordinator ended: killed by signal 9"}),
                         [](const auto& death) {
                           return fmt::format("{}KilledWhile{}", death.param.program + std::string("jostle_").size(),
                                              death.param.acting ? "Acting" : "Planning");
                         });

// Silent is not dead: a busy machine may be the reason.
TEST_F(Deaths, WorldThatIsSilentWhileNothingWaitsForItIsMissedAndThatIsAll) {
  ASSERT_NO_FATAL_FAILURE(start_planning());
  const pid_t world = run->child(kSim);
  kill(world, SIGSTOP);
  EXPECT_TRUE(run->says("the simulated world runs but was not heard for", kPatience)) << run->err();
  kill(world, SIGCONT);
  EXPECT_TRUE(run->says("the simulated world is heard again", kPatience)) << run->err();
  EXPECT_FALSE(run->code()) << run->err();
}

TEST_F(Deaths, WorldThatIsWaitedForEndsTheRunWhenItsSilenceLasts) {
  ASSERT_NO_FATAL_FAILURE(start_acting());
  EXPECT_EQ(code_after(run->child(kSim), SIGSTOP, kPatience), 3);
  EXPECT_THAT(run->err(), HasSubstr("robot: nothing heard on rt/robot/status for 5.0 s"));
  EXPECT_THAT(run->err(), HasSubstr("doctor"));
}

TEST_F(Deaths, CoordinatorEndsTheRunWhenItsSilenceLasts) {
  ASSERT_NO_FATAL_FAILURE(start_planning());
  EXPECT_EQ(code_after(run->child(kCoordinator), SIGSTOP, kPatience), 3);
  EXPECT_THAT(run->err(), HasSubstr("the coordinator runs but was not heard for 10 s"));
  EXPECT_THAT(run->err(), HasSubstr("doctor"));
  EXPECT_THAT(run_folders(), IsEmpty());
}

class WorkerOfARun : public Deaths, public ::testing::WithParamInterface<int> {};

TEST_P(WorkerOfARun, IsNotMissedWhenItIsGone) {
  // One plan with work enough that the victim's part of it is missed, and no other.
  const std::string thorough = folder.write("thorough.yaml",
                                            "objective: {success_cost: 1.0e-9}\n"
                                            "control: {many_iterations: 6, few_iterations: 0}\n");
  start({easy, "--workers", "2", "--parameters", thorough});
  ASSERT_TRUE(searches()) << run->err();
  const pid_t victim = run->child("jostle_worker");
  ASSERT_GT(victim, 0);

  EXPECT_EQ(code_after(victim, GetParam(), kPatience), 0) << run->err();

  EXPECT_THAT(run->out(), HasSubstr("SUCCESS"));
  EXPECT_THAT(run->left_over(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(, WorkerOfARun, ::testing::Values(SIGKILL, SIGSTOP),
                         [](const auto& death) { return death.param == SIGKILL ? "Killed" : "Stalled"; });

TEST_F(Deaths, RunThatIsKilledTakesItsChildrenAlong) {
  ASSERT_NO_FATAL_FAILURE(start_planning());
  ASSERT_EQ(run->children().size(), 4u);  // world, coordinator, two workers

  const auto start = Clock::now();
  run->signal(SIGKILL);

  EXPECT_TRUE(soon(kReport, [&] { return run->left_over().empty(); })) << ::testing::PrintToString(run->left_over());
  fmt::print("children gone after {:.2f} s\n", std::chrono::duration<double>(Clock::now() - start).count());
}

TEST_F(Deaths, InterruptedRunCleansUpWhilePlanning) {
  ASSERT_NO_FATAL_FAILURE(start_planning());
  ASSERT_EQ(run_folders().size(), 1u);

  EXPECT_EQ(code_after(run->pid(), SIGINT, 20s), 130) << run->err();

  fmt::print("ended after {} ms\n", took.count());
  EXPECT_LT(took, kReport);
  EXPECT_THAT(run->left_over(), IsEmpty());
  EXPECT_THAT(run_folders(), IsEmpty());
}

// What a run has come to is worth having, however it ends.
class UnfinishedRun : public Deaths {
 protected:
  void expect_numbers(const std::string& ending) {
    const auto report = nlohmann::json::parse(contents(json), nullptr, false);
    ASSERT_FALSE(report.is_discarded()) << run->err();
    EXPECT_EQ(report["ending"], ending);
    EXPECT_FALSE(report["success"]);
    EXPECT_GE(report["actions"], 1);
    EXPECT_EQ(report["observed_states"].size(), report["observed_times"].size());
    EXPECT_TRUE(report["plan_hash"].is_string());
    EXPECT_THAT(contents(picture).substr(1, 3), "PNG");
    EXPECT_THAT(contents(bag / "metadata.yaml"), HasSubstr("message_count"));
  }

  std::vector<std::string> outputs() const {
    return {"--json", json,           "--picture", picture, "--record",  bag, "--rate",
            "0.5",    "--parameters", plain,       easy,    "--workers", "1"};
  }

  const std::filesystem::path json = folder.path() / "run.json", picture = folder.path() / "run.png",
                              bag = folder.path() / "bag";
};

TEST_F(UnfinishedRun, LeavesItsNumbersWhenItIsInterrupted) {
  start(outputs());
  ASSERT_TRUE(soon(kPatience, [&] { return executed(1) || run->code(); })) << run->err();

  EXPECT_EQ(code_after(run->pid(), SIGINT, 20s), 130) << run->err();

  expect_numbers("cancelled");
  EXPECT_THAT(run->out(), HasSubstr("CANCELLED"));
}

TEST_F(UnfinishedRun, LeavesItsNumbersWhenItsWorldDies) {
  start(outputs());
  ASSERT_TRUE(soon(kPatience, [&] { return executed(1) || run->code(); })) << run->err();

  EXPECT_EQ(code_after(run->child(kSim), SIGKILL, 20s), 3) << run->err();

  expect_numbers("broken");
  EXPECT_THAT(run->out(), HasSubstr("BROKEN"));
}

TEST_F(Deaths, InterruptedRunCleansUpWhileActing) {
  ASSERT_NO_FATAL_FAILURE(start_acting());

  EXPECT_EQ(code_after(run->pid(), SIGINT, 20s), 130) << run->err();

  fmt::print("ended after {} ms\n", took.count());
  EXPECT_LT(took, kReport);
  EXPECT_THAT(run->left_over(), IsEmpty());
  EXPECT_THAT(run_folders(), IsEmpty());
}

TEST_F(Deaths, SecondRunOnADomainIsToldSoAndTheFirstGoesOn) {
  ASSERT_NO_FATAL_FAILURE(start_acting());

  const auto second = program("jostle_run", {easy, "--parameters", plain, "--headless", "--workers", "1"});

  EXPECT_EQ(second->wait(kPatience), 3);
  EXPECT_THAT(second->err(), HasSubstr("ROS_DOMAIN_ID"));
  EXPECT_EQ(run->wait(kPatience), 0) << run->err();
}

// Another run's coordinator may be heard before our own has started.
TEST_F(Deaths, RunThatHearsOfAnothersTaskSaysThatTheDomainIsTaken) {
  const auto participant = wire::Participant::open({.domain = domain}).value();
  wire::Writer<jostle_msgs::msg::Feedback> other(participant, wire::topics::kTaskFeedback);
  jostle_msgs::msg::Feedback feedback;
  feedback.goal_id("another run's");

  start({easy, "--parameters", plain, "--workers", "1", "--plan-only"});

  EXPECT_TRUE(soon(kPatience, [&] { return !other.write(feedback) || run->code(); }));
  EXPECT_EQ(run->code(), 3);
  EXPECT_THAT(run->err(), HasSubstr("ROS_DOMAIN_ID"));
  EXPECT_THAT(run->left_over(), IsEmpty());
}

}  // namespace
}  // namespace jostle::tests
