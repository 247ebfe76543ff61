// An experiment from start to end: run, recorded from DDS, decided again, drawn.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "physics_pool/scenarios/chapter5.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class RecordedRuns : public RunFixture {
 protected:
  // Twelve short steps, each re-planned as no plan is good enough, in a world that is not
  // quite as believed.
  void record(const std::string& name) {
    const auto parameters = folder.write("restless.yaml",
                                         "planner: {rollouts: 2}\n"
                                         "objective: {success_cost: 1.0e-9}\n"
                                         "control: {many_iterations: 4, few_iterations_max: 1, initial_steps: 12, "
                                         "deviation_threshold: 0, timeout: 120}\n");
    finish({easy, "--uncertainty", "low", "--seed", "5", "--workers", "2", "--parameters", parameters, "--json",
            folder.path() / (name + ".json"), "--record", folder.path() / name});
    ASSERT_TRUE(std::filesystem::exists(folder.path() / name / "metadata.yaml")) << run->err();
  }

  // Exit code; standard output is in `out`.
  int program_ends(const std::string& name, const std::vector<std::string>& arguments) {
    const auto process = program(name, arguments);
    const int code = process->wait(kPatience).value_or(-1);
    out = process->out(), err = process->err();
    return code;
  }

  std::string bag(const std::string& name) const { return folder.path() / name; }

  std::string out, err;
};

// Chapter 5: several speeds are considered, in a world whose noise grows with the speed.
TEST_F(RecordedRuns, OfTaskAdaptiveControlDecideTheSameOnThreadsOnWorkersAndAgain) {
  const auto scene_result = physics_pool::generate_chapter5({.task = physics_pool::AdaptiveTask::kStrip, .seed = 11});
  ASSERT_TRUE(scene_result) << scene_result.error().message;
  const auto scene = folder.write("strip.yaml", physics_pool::to_yaml(*scene_result));
  std::vector<json> reports;
  for (const char* pool : {"threads", "dds"}) {
    const std::string file = folder.path() / (std::string(pool) + ".json");
    finish({scene,
            "--controller",
            "tampc",
            "--noise",
            "0.1",
            "--seed",
            "3",
            "--set",
            "adaptive.sequences=3",
            "--set",
            "adaptive.samples=4",
            "--set",
            "objective.success_cost=0",
            "--set",
            "adaptive.max_actions=3",
            "--workers",
            "2",
            "--pool",
            pool,
            "--json",
            file,
            "--record",
            bag(pool)});
    reports.push_back(json::parse(contents(file)));
  }
  EXPECT_EQ(reports[0]["controls"], reports[1]["controls"]);
  EXPECT_EQ(reports[0]["observed_states"], reports[1]["observed_states"]);
  EXPECT_EQ(reports[1]["controls"].size(), 2 * reports[1]["actions"].get<std::size_t>());  // each with its rest
  EXPECT_GT(reports[1]["rollouts"], 3 * (1 + 4 + 8));                                      // something was improved

  EXPECT_EQ(program_ends("jostle_replay", {bag("dds")}), 0) << out << err;
  EXPECT_THAT(out, HasSubstr("BIT-EQUAL"));
  EXPECT_EQ(program_ends("jostle_replay", {bag("dds"), "--set", "adaptive.noise=0"}), 1) << err;
  EXPECT_THAT(out, HasSubstr("adaptive.noise: recorded 0.1, replayed 0"));
}

// The next action is planned while the robot acts, from a predicted state; some of these plans are taken, and some not.
TEST_F(RecordedRuns, ThatPlannedWhileActingDecideTheSameOnThreadsOnWorkersAndAgain) {
  const auto scene_result = physics_pool::generate_chapter5({.task = physics_pool::AdaptiveTask::kStrip, .seed = 11});
  ASSERT_TRUE(scene_result) << scene_result.error().message;
  const auto scene = folder.write("strip.yaml", physics_pool::to_yaml(*scene_result));
  const auto parameters = folder.write("few.yaml",
                                       "control: {plan_while_acting: 0.01}\n"
                                       "adaptive: {sequences: 3, least_actions: 4, samples: 4, max_actions: 5}\n"
                                       "objective: {success_cost: 0}\n");
  std::vector<json> reports;
  for (const char* pool : {"threads", "dds"}) {
    const std::string file = folder.path() / (std::string(pool) + ".json");
    finish({scene, "--controller", "tampc", "--noise", "0.1", "--seed", "3", "--parameters", parameters, "--workers",
            "2", "--pool", pool, "--json", file, "--record", bag(pool)});
    reports.push_back(json::parse(contents(file)));
  }
  for (const char* same : {"controls", "observed_states", "rollouts", "plans_while_acting", "taken_while_acting"}) {
    EXPECT_EQ(reports[0][same], reports[1][same]) << same;
  }
  EXPECT_GE(reports[1]["taken_while_acting"], 1) << run->err();
  EXPECT_LT(reports[1]["taken_while_acting"], reports[1]["plans_while_acting"]);
  EXPECT_EQ(reports[1]["idle"]["seconds"].size(), reports[1]["actions"]);
  EXPECT_THAT(run->out(), HasSubstr("plans begun while acting"));

  EXPECT_EQ(program_ends("jostle_replay", {bag("dds")}), 0) << out << err;
  EXPECT_THAT(out, HasSubstr("BIT-EQUAL"));
  EXPECT_EQ(program_ends("jostle_replay", {bag("dds"), "--set", "control.plan_while_acting=0"}), 1) << err;
  EXPECT_THAT(out, HasSubstr("control.plan_while_acting: recorded 0.01, replayed 0"));
}

TEST_F(RecordedRuns, DecideTheSameAgainToTheLastBit) {
  record("run");
  const json report = json::parse(contents(folder.path() / "run.json"));
  ASSERT_GE(report["replans"], 10);
  const std::string comparison_file = folder.path() / "comparison.json";

  EXPECT_EQ(program_ends("jostle_replay", {bag("run"), "--json", comparison_file}), 0) << out << err;

  EXPECT_THAT(out, HasSubstr("BIT-EQUAL"));
  const json comparison = json::parse(contents(comparison_file))["runs"][0];
  EXPECT_EQ(comparison["plans"], report["replans"].get<int>() + 1);
  EXPECT_EQ(comparison["equal_plans"], comparison["plans"]);
  EXPECT_EQ(comparison["equal_actions"], comparison["actions"]);
  EXPECT_GE(comparison["actions"], report["actions"]);  // closing the hand is an action, too

  EXPECT_EQ(program_ends("jostle_replay", {bag("run"), "--set", "control.initial_steps=10"}), 1) << err;
  EXPECT_THAT(out, HasSubstr("DIFFERS at plan"));
  EXPECT_THAT(out, HasSubstr("why        control.initial_steps: recorded 12, replayed 10"));
}

bool has_fma() { return contents("/proc/cpuinfo").find(" fma ") != std::string::npos; }

// tests/data/bags has one of each kind, from before scenes had a second format and results an ending.
TEST_F(RecordedRuns, OfBeforeAreDecidedTheSameAgain) {
  for (const char* name : {"grasp", "push"}) {
    const std::string old_bag = std::string(JOSTLE_SOURCE_DIR) + "/tests/data/bags/" + name;
    const std::string comparison_file = folder.path() / "comparison.json";

    const int code = program_ends("jostle_replay", {old_bag, "--json", comparison_file});

    const json decided = json::parse(contents(comparison_file))["runs"][0];
    EXPECT_GE(decided["plans"], 6) << name;
    if (!has_fma()) continue;  // the last bits of these recordings are those of processors that have it
    EXPECT_EQ(code, 0) << out << err;
    EXPECT_EQ(decided["equal_plans"], decided["plans"]) << name;
    EXPECT_EQ(decided["equal_actions"], decided["actions"]) << name;
  }
}

TEST_F(RecordedRuns, AreWholeEvenIfTheRecorderCameLate) {
  start_acting(0.3);  // 17 s are left: long enough for a recorder to start, on however busy a machine
  EXPECT_EQ(program_ends("jostle_record", {"--output", bag("late"), "--until-result"}), 0) << err << run->err();
  ASSERT_TRUE(run->wait(kPatience)) << run->err();

  EXPECT_EQ(program_ends("jostle_replay", {bag("late")}), 0) << out << err;
  EXPECT_THAT(out, HasSubstr("BIT-EQUAL"));
}

TEST_F(RecordedRuns, AreDrawnAsSheetPicturesAndFilms) {
  record("run");
  const auto sheet = folder.path() / "run.png", pictures = folder.path() / "pictures";

  EXPECT_EQ(program_ends("jostle_render", {bag("run"), "-o", sheet, "--frames", "3", "--size", "160x120"}), 0) << err;
  EXPECT_EQ(program_ends("jostle_render", {bag("run"), "-o", pictures, "--frames", "4", "--size", "160x120"}), 0)
      << err;

  EXPECT_TRUE(std::filesystem::exists(sheet));
  EXPECT_TRUE(std::filesystem::exists(pictures / "frame-00004.png"));
  EXPECT_FALSE(std::filesystem::exists(pictures / "frame-00005.png"));
  EXPECT_EQ(program_ends("jostle_render", {bag("run"), "-o", folder.path() / "run.avi"}), 2);
  EXPECT_THAT(err, HasSubstr(".png, .mp4, .gif"));
  for (const std::string name : {"run.mp4", "run.gif"}) {
    const auto film = folder.path() / name;
    EXPECT_EQ(program_ends("jostle_render", {bag("run"), "-o", film, "--frames", "5", "--size", "160x120"}), 0) << err;
    const std::string head = contents(film).substr(0, 12);
    EXPECT_THAT(head, HasSubstr(name == "run.mp4" ? "ftyp" : "GIF89a"));
  }
}

TEST_F(RecordedRuns, WhatIsNoRunIsSaidClearly) {
  const auto text = folder.write("notes.txt", "no bag");
  EXPECT_EQ(program_ends("jostle_replay", {text}), 2);
  EXPECT_THAT(err, HasSubstr("notes.txt"));
  EXPECT_EQ(program_ends("jostle_replay", {bag("nowhere")}), 2);
  EXPECT_THAT(err, HasSubstr("nowhere"));
}

}  // namespace
}  // namespace jostle::tests
