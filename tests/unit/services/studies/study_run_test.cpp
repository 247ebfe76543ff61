// Studies that act in a world, run to their end: small scenes, few iterations.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <sstream>

#include "idl/text/yaml_fields.hpp"
#include "services/studies/experiment/adaptive_study.hpp"
#include "services/studies/experiment/grasping_study.hpp"
#include "services/studies/experiment/push_study.hpp"
#include "services/studies/experiment/robust_study.hpp"
#include "services/studies/experiment/study.hpp"
#include "tests/support/studies.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

using namespace studies;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

using Loaded = std::unique_ptr<Study>;

std::vector<std::string> keys_of(const json& object) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : object.items()) keys.push_back(key);
  return keys;
}

// What a clock measured is another number every time.
json without_times(json value) {
  if (value.is_array()) {
    for (json& element : value) element = without_times(element);
  }
  if (!value.is_object()) return value;
  for (const std::string& key : keys_of(value)) {
    if (key.find("seconds") != std::string::npos) {
      EXPECT_GE(value[key].get<double>(), 0.0) << key;
      value.erase(key);
    } else {
      value[key] = without_times(value[key]);
    }
  }
  return value;
}

// Null is said where there is no number: of the keys given, nowhere else.
void expect_numbers(const json& value, const std::string& may_be_null, const std::string& where = "json") {
  if (value.is_number()) {
    EXPECT_TRUE(std::isfinite(value.get<double>())) << where;
  }
  EXPECT_TRUE(!value.is_null() || where.ends_with(may_be_null)) << where;
  for (const auto& [key, element] : value.items()) {
    if (value.is_structured()) expect_numbers(element, may_be_null, where + "." + key);
  }
}

// A terminal has room for it.
void expect_narrow(const std::string& table) {
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) {
    const auto length = std::ranges::count_if(line, [](unsigned char c) { return (c & 0xC0) != 0x80; });
    EXPECT_LE(length, 100) << line;
  }
}

void expect_share(const json& row) {
  const double share = row["successes"].get<double>() / row["runs"].get<double>();
  ASSERT_EQ(row["interval"].size(), 2u);
  EXPECT_LE(row["interval"][0], share);
  EXPECT_GE(row["interval"][1], share);
  EXPECT_GE(row["interval"][0], 0.0);
  EXPECT_LE(row["interval"][1], 1.0);
}

class StudyRun : public ::testing::Test {
 protected:
  using Reader = Result<Loaded> (*)(yaml::Fields& fields, const std::string& origin);

  Loaded study(Reader read, const std::string& parameters, const std::string& text) const {
    folder.write("parameters.yaml", parameters);
    const std::string file = folder.write("study.yaml", text);
    auto study_result = yaml::parse<Loaded>(text, file, [&](const YAML::Node& root) -> Result<Loaded> {
      yaml::Fields fields(root, "", file);
      auto loaded_result = read(fields, file);
      fields.finish();
      return loaded_result;
    });
    if (!study_result) throw std::runtime_error(study_result.error().message);
    return std::move(study_result).value();
  }

  const TempFolder folder;
};

constexpr const char* kGrasping = R"(
title: tiny grasping
parameters: parameters.yaml
objects: 2
seeds: {first: 1, last: 2}
levels: [none, low]
controllers: [or, nr]
thesis:
  none: {or: 0.75}
)";

class GraspingStudyRun : public StudyRun {
 protected:
  // Of one run: it takes longest.
  const StudyReport& report() {
    static const StudyReport first = finished(*sut).report;
    return first;
  }

  const Loaded sut = study(&read_grasping_study,
                           "planner: {rollouts: 2}\n"
                           "control: {many_iterations: 3, few_iterations: 1, few_iterations_max: 2, timeout: 600}\n",
                           kGrasping);
};

TEST_F(GraspingStudyRun, HasARowPerCellAndAnEntryPerRun) {
  const json& result = report().json;
  expect_numbers(result["runs"], "nothing");
  EXPECT_THAT(keys_of(result), UnorderedElementsAre("title", "objects", "rows", "runs"));
  EXPECT_EQ(result["title"], "tiny grasping");
  EXPECT_EQ(result["objects"], 2);
  ASSERT_EQ(result["rows"].size(), 4u);
  ASSERT_EQ(result["runs"].size(), 8u);
  std::size_t place = 0;
  for (const char* level : {"none", "low"}) {
    for (const char* controller : {"or", "nr"}) {
      const json& row = result["rows"][place];
      EXPECT_THAT(keys_of(row),
                  UnorderedElementsAre("level", "controller", "successes", "runs", "target_alone", "timed_out",
                                       "broken", "interval", "replans", "replans_half_width", "execution_cost",
                                       "execution_cost_half_width", "plan_seconds", "plan_seconds_half_width",
                                       "execution_seconds", "execution_seconds_half_width", "total_seconds",
                                       "total_seconds_half_width"));
      EXPECT_EQ(row["level"], level);
      EXPECT_EQ(row["controller"], controller);
      EXPECT_EQ(row["runs"], 2);
      EXPECT_EQ(row["timed_out"], 0);
      EXPECT_EQ(row["broken"], 0);
      expect_share(row);
      int successes = 0, alone = 0;
      for (const int seed : {1, 2}) {
        const json& run = result["runs"][place + 4 * (static_cast<std::size_t>(seed) - 1)];
        EXPECT_THAT(keys_of(run),
                    UnorderedElementsAre("seed", "level", "controller", "success", "ending", "reason", "plan_hash",
                                         "plan_seconds", "planning_seconds", "total_seconds", "replans", "actions",
                                         "rollouts", "execution_cost", "execution_seconds", "others_in_hand"));
        EXPECT_GE(run["execution_seconds"].get<double>() + 1e-9, run["actions"].get<double>());  // a second each
        EXPECT_EQ(run["seed"], seed);
        EXPECT_EQ(run["level"], level);
        EXPECT_EQ(run["controller"], controller);
        EXPECT_FALSE(run["reason"].get<std::string>().empty());
        EXPECT_THAT(run["plan_hash"].get<std::string>(), ::testing::MatchesRegex("[0-9a-f]{32}"));
        EXPECT_GE(run["actions"], 1);
        EXPECT_GE(run["rollouts"], 1);
        EXPECT_LE(run["plan_seconds"], run["planning_seconds"]);
        EXPECT_LE(run["planning_seconds"], run["total_seconds"]);
        if (run["success"]) ++successes;
        if (run["success"] && run["others_in_hand"] == 0) ++alone;
      }
      ++place;
      EXPECT_EQ(row["successes"], successes);
      EXPECT_EQ(row["target_alone"], alone);
      EXPECT_EQ(row["execution_cost"].is_null(), successes == 0);
      EXPECT_EQ(row["execution_cost_half_width"].is_null(), successes < 2);
    }
  }
}

TEST_F(GraspingStudyRun, RepeatsButForTimesWhateverTheJobs) {
  const StudyReport& first = report();
  set_options(*sut, {"--jobs", "2"});
  EXPECT_EQ(without_times(finished(*sut).report.json), without_times(first.json));
}

TEST_F(GraspingStudyRun, TableHasTheThesissNumbersBesideOurs) {
  EXPECT_THAT(report().table, HasSubstr("tiny grasping"));
  EXPECT_THAT(report().table, ::testing::ContainsRegex("none +or +[0-2]/2 .* 0[.]75 "));
  EXPECT_THAT(report().table, ::testing::ContainsRegex("low +nr +[0-2]/2 .* - "));
  expect_narrow(report().table);
}

TEST_F(GraspingStudyRun, CommandLineChoosesSeedsLevelsAndControllers) {
  const json all = report().json;
  set_options(*sut, {"--seeds", "2", "--levels", "low", "--controllers", "nr"});

  const json chosen = finished(*sut).report.json;

  ASSERT_EQ(chosen["runs"].size(), 1u);
  EXPECT_EQ(without_times(chosen["runs"][0]), without_times(all["runs"][7]));
  set_options(*sut, {"--levels", "absurd"});
  EXPECT_THAT(refusal(*sut), HasSubstr("--levels: "));
  set_options(*sut, {"--levels", "low", "--controllers", "psychic"});
  EXPECT_THAT(
      refusal(*sut),
      HasSubstr("--controllers: got 'psychic' for a task to grasp with the robot 'planar_gripper', wanted or, nr"));
  set_options(*sut, {"--controllers", "nr", "--seeds", "2-1"});
  EXPECT_THAT(refusal(*sut), HasSubstr("--seeds: got '2-1'"));
}

// Time is over before the first plan is.
class TimedOutGraspingRun : public StudyRun {
 protected:
  const Loaded sut = study(&read_grasping_study,
                           "objective: {success_cost: 1.0e-9}\n"  // never content
                           "control: {many_iterations: 1000000, timeout: 1}\n",
                           kGrasping);
};

TEST_F(TimedOutGraspingRun, IsToldApartAndCountsWithWhatItSpent) {
  set_options(*sut, {"--seeds", "1", "--levels", "none", "--controllers", "or"});

  const StudyReport report = finished(*sut).report;

  const json& run = report.json["runs"][0];
  EXPECT_EQ(run["ending"], "timed out");
  EXPECT_GT(run["rollouts"], 0);
  EXPECT_GT(run["planning_seconds"], 0.1);
  for (const char* key : {"plan_hash", "plan_seconds", "execution_cost"}) EXPECT_TRUE(run[key].is_null()) << key;
  const json& row = report.json["rows"][0];
  EXPECT_EQ(row["runs"], 1);
  EXPECT_EQ(row["timed_out"], 1);
  EXPECT_EQ(run["execution_seconds"], 0.0);  // nothing came of the first plan
  for (const char* key : {"replans", "execution_cost", "plan_seconds", "total_seconds", "total_seconds_half_width"})
    EXPECT_TRUE(row[key].is_null()) << key;
  EXPECT_THAT(report.table, ::testing::ContainsRegex("none +or +- +- +- +- +-\n"));
  EXPECT_THAT(report.table, ::testing::Not(HasSubstr("±")));
}

constexpr const char* kPush = R"(
title: tiny push
parameters: parameters.yaml
chapter: 6
reality: low
seeds: {first: 1, last: 2}
predictors:
  - {predictor: "coarse,kinematic"}
  - {predictor: "fine", threads: 2}
remark: no more than a test
)";

class PushStudyRun : public StudyRun {
 protected:
  const Loaded sut = study(&read_push_study,
                           "planner: {rollouts: 2, sigma: [0.01, 0.01], limit: [0.1, 0.1]}\n"
                           "mpc: {horizon: 2, first_iterations: 1, iterations: 1, max_actions: 3}\n",
                           kPush);
};

TEST_F(PushStudyRun, HasARowPerPredictorAndAnEntryPerRun) {
  const StudyReport report = finished(*sut).report;

  const json& result = report.json;
  expect_numbers(result, "nothing");
  EXPECT_THAT(keys_of(result), UnorderedElementsAre("title", "rows", "runs"));
  EXPECT_EQ(result["title"], "tiny push");
  ASSERT_EQ(result["rows"].size(), 2u);
  ASSERT_EQ(result["runs"].size(), 4u);
  const std::pair<const char*, int> entries[] = {{"coarse,kinematic", 1}, {"fine", 2}};
  for (std::size_t entry = 0; entry < 2; ++entry) {
    const auto& [predictor, threads] = entries[entry];
    const json& row = result["rows"][entry];
    EXPECT_THAT(keys_of(row),
                UnorderedElementsAre("predictor", "threads", "successes", "runs", "timed_out", "broken", "interval",
                                     "actions", "actions_half_width", "planning_seconds", "planning_seconds_half_width",
                                     "seconds_per_plan", "seconds_per_plan_half_width", "completion_seconds",
                                     "completion_seconds_half_width"));
    EXPECT_EQ(row["predictor"], predictor);
    EXPECT_EQ(row["threads"], threads);
    EXPECT_EQ(row["runs"], 2);
    expect_share(row);
    double actions = 0;
    for (std::size_t seed = 0; seed < 2; ++seed) {
      const json& run = result["runs"][2 * seed + entry];  // scenes in the outer loop
      EXPECT_THAT(keys_of(run), UnorderedElementsAre("seed", "predictor", "threads", "success", "ending", "reason",
                                                     "actions", "replans", "rollouts", "planning_seconds"));
      EXPECT_EQ(run["seed"], seed + 1);
      EXPECT_EQ(run["predictor"], predictor);
      EXPECT_FALSE(run["reason"].get<std::string>().empty());
      EXPECT_GE(run["actions"], 1);
      EXPECT_LE(run["actions"], 3);
      EXPECT_GE(run["rollouts"], 1);
      actions += run["actions"].get<double>();
    }
    EXPECT_DOUBLE_EQ(row["actions"], actions / 2);
    EXPECT_GE(row["completion_seconds"], row["planning_seconds"]);
  }
  EXPECT_THAT(report.table, HasSubstr("no more than a test"));
  expect_narrow(report.table);
}

TEST_F(PushStudyRun, FigureHasANamePerPredictorAndItsInterval) {
  const json report = finished(*sut).report.json;
  const auto panels = sut->figure(report);
  ASSERT_EQ(panels.size(), 1u);
  EXPECT_THAT(panels[0].names, ::testing::ElementsAre("coarse,kinematic x1", "fine x2"));
  ASSERT_EQ(panels[0].bands.size(), 2u);
  EXPECT_EQ(panels[0].bands[1].name, "fine x2");
  EXPECT_EQ(panels[0].bands[1].x, std::vector<double>{1.0});
  EXPECT_DOUBLE_EQ(panels[0].bands[1].middle[0], report["rows"][1]["completion_seconds"]);
  EXPECT_LE(panels[0].bands[1].low[0], panels[0].bands[1].middle[0]);
}

TEST_F(PushStudyRun, RepeatsButForTimes) {
  const json first = finished(*sut).report.json;
  EXPECT_EQ(without_times(finished(*sut).report.json), without_times(first));
}

TEST_F(PushStudyRun, OneRunHasNoInterval) {
  set_options(*sut, {"--seeds", "1"});
  const StudyReport report = finished(*sut).report;
  EXPECT_THAT(report.table, ::testing::Not(HasSubstr("±")));
  expect_numbers(report.json, "_half_width");
  EXPECT_TRUE(report.json["rows"][0]["planning_seconds_half_width"].is_null());
}

TEST_F(PushStudyRun, RefusesWhatItDoesNotHave) {
  EXPECT_THROW(set_options(*sut, {"--levels", "low"}), CLI::ParseError);
  EXPECT_THROW(set_options(*sut, {"--jobs", "2"}), CLI::ParseError);  // times are measured
}

class AdaptiveStudyRun : public StudyRun {
 protected:
  const Loaded sut = study(&read_adaptive_study,
                           "planner: {rollouts: 2, sigma: [0.02, 0.02, 0.1, 0], limit: [0.5, 0.5, 1, 0.05]}\n"
                           "adaptive: {sequences: 2, most_actions: 2, samples: 2, iterations: 0, max_actions: 2}\n",
                           R"(
title: tiny and adaptive
parameters: parameters.yaml
tasks: [wide, strip]
methods: [tampc, slow-mpc]
levels: [0, 0.1]
seeds: {first: 1, last: 2}
thesis: {wide: {tampc: much}}
)");
};

TEST_F(AdaptiveStudyRun, PairsMethodsOnScenesAndTellsOfEveryChoice) {
  const StudyReport report = finished(*sut).report;
  const json& result = report.json;
  ASSERT_EQ(result["rows"].size(), 8u);
  ASSERT_EQ(result["runs"].size(), 16u);
  for (const json& row : result["rows"]) {
    EXPECT_EQ(row["runs"], 2);
    expect_share(row);
    const bool is_thesis = row["task"] == "wide" && row["method"] == "tampc";
    EXPECT_EQ(row["thesis"], is_thesis ? "much" : "-");
    EXPECT_GE(row["total_seconds"].get<double>(),
              row["planning_seconds"].get<double>() +
                  result["seconds_per_action"].get<double>() * row["actions"].get<double>() - 1e-9);
  }
  for (const json& run : result["runs"]) {
    ASSERT_EQ(run["way"].size(), run["actions"].get<std::size_t>());
    const bool considers = run["method"] == "tampc";
    EXPECT_EQ(run["way"][0]["considered"].size(), considers ? 2u : 1u);
    // Equal scenes: the same straight way, in one action and in two.
    if (considers)
      EXPECT_NEAR(run["way"][0]["considered"][0]["speed"], 2 * run["way"][0]["considered"][1]["speed"].get<double>(),
                  1e-12);
  }
  expect_narrow(report.table);
  EXPECT_EQ(sut->figure(result).size(), 4u);
}

TEST_F(AdaptiveStudyRun, NumbersDoNotDependOnJobs) {
  set_options(*sut, {"--tasks", "strip", "--jobs", "1"});
  const json one = finished(*sut).report.json;
  set_options(*sut, {"--tasks", "strip", "--jobs", "3"});
  EXPECT_EQ(without_times(finished(*sut).report.json), without_times(one));
}

TEST_F(AdaptiveStudyRun, TakesOtherTasksMethodsLevelsAndParameters) {
  set_options(*sut, {"--seeds", "1", "--tasks", "changing", "--methods", "uampc", "--levels", "0.05", "--set",
                     "adaptive.max_actions=1"});
  const json result = finished(*sut).report.json;
  ASSERT_EQ(result["runs"].size(), 1u);
  EXPECT_EQ(result["runs"][0]["task"], "changing");
  EXPECT_EQ(result["runs"][0]["method"], "uampc");
  EXPECT_EQ(result["runs"][0]["actions"], 1);
  EXPECT_THROW(set_options(*sut, {"--tasks", "narrow"}), CLI::ParseError);
}

TEST_F(AdaptiveStudyRun, PlannersMayBelieveInAnotherNoiseThanTheWorlds) {
  set_options(*sut, {"--seeds", "1", "--tasks", "strip", "--levels", "0.1", "--methods", "tampc,tampc:0.1,tampc:0"});
  const json runs = finished(*sut).report.json["runs"];
  ASSERT_EQ(runs.size(), 3u);
  EXPECT_EQ(runs[0]["way"], runs[1]["way"]);
  EXPECT_EQ(runs[2]["method"], "tampc:0");
  const auto spreads = [](const json& choice) { return choice["spread"].get<double>() > 0.0; };
  EXPECT_TRUE(std::ranges::any_of(runs[0]["way"][0]["considered"], spreads));
  for (const json& choice : runs[2]["way"][0]["considered"]) EXPECT_EQ(choice["spread"], 0.0);
  for (const char* method : {"tampc:2", "tampc:", "tampc:0.1x", "nobody", "nobody:0.1"}) {
    set_options(*sut, {"--methods", method});
    EXPECT_THAT(sut->prepare().error().message, HasSubstr("--methods: got '")) << method;
  }
}

class RobustStudyRun : public StudyRun {
 protected:
  const Loaded sut =
      study(&read_robust_study,
            "step_duration: 0.5\n"
            "planner: {rollouts: 2, freeze: true, guidance: 60}\n"
            "robust: {starts: 2, worlds: 1, horizon: 4, iterations: 1, mpc_iterations: 1, max_actions: 2}\n",
            R"(
title: tiny and robust
parameters: parameters.yaml
methods: [ol, rol, ocl]
seeds: {first: 1, last: 2}
world: {least_mass: 0.4, most_mass: 0.9, least_friction: 0.1, most_friction: 0.5, size: 0.01, start_position: 0.01,
        start_rotation: 0.01}
thesis: {ol: least}
)");
};

TEST_F(RobustStudyRun, PairsMethodsInWorldsThatNoneKnows) {
  const StudyReport report = finished(*sut).report;
  const json& result = report.json;
  ASSERT_EQ(result["rows"].size(), 3u);
  ASSERT_EQ(result["runs"].size(), 6u);
  ASSERT_EQ(result["pairs"].size(), 2u);
  for (const json& row : result["rows"]) {
    EXPECT_EQ(row["runs"], 2);
    expect_share(row);
    EXPECT_EQ(row["expected"].is_null(), row["method"] == "ol");
    if (row["method"] != "ocl") EXPECT_EQ(row["open_loop_share"], 1.0);
  }
  for (const json& run : result["runs"]) {
    EXPECT_GT(run["actions"], 0);
    EXPECT_GE(run["execution_seconds"].get<double>(), 0.5 * run["actions"].get<double>() - 1e-9);
  }
  EXPECT_EQ(result["pairs"][0]["method"], "ocl");
  expect_narrow(report.table);
  EXPECT_EQ(sut->figure(result).size(), 4u);
}

TEST_F(RobustStudyRun, DecidesTheSameForAnyNumberOfJobs) {
  const auto decided = [&](const char* jobs) {
    set_options(*sut, {"--methods", "ocl,cc", "--seeds", "1", "--jobs", jobs});
    json runs = finished(*sut).report.json["runs"];
    return without_times(std::move(runs));
  };
  const json one = decided("1");
  EXPECT_EQ(decided("2"), one);
  EXPECT_EQ(one[0]["method"], "ocl");
}

class TimedOutPushRun : public StudyRun {
 protected:
  const Loaded sut = study(&read_push_study,
                           "planner: {rollouts: 2, sigma: [0.01, 0.01], limit: [0.1, 0.1]}\n"
                           "objective: {success_cost: 1.0e-9}\n"
                           "mpc: {horizon: 4, first_iterations: 1000000}\ncontrol: {timeout: 1}\n",
                           kPush);
};

TEST_F(TimedOutPushRun, IsToldApartAndCountsWithWhatItSpent) {
  const StudyReport report = finished(*sut).report;

  for (const json& run : report.json["runs"]) {
    EXPECT_EQ(run["ending"], "timed out");
    EXPECT_GT(run["rollouts"], 0);
    EXPECT_GT(run["planning_seconds"], 0.1);
  }
  for (const json& row : report.json["rows"]) {
    EXPECT_EQ(row["timed_out"], 2);
    EXPECT_GT(row["planning_seconds"], 0.1);
    for (const char* key : {"seconds_per_plan", "completion_seconds"}) EXPECT_TRUE(row[key].is_null()) << key;
  }
  EXPECT_TRUE(sut->figure(report.json).empty());
}

// A study without physics, to try what becomes of any.
class Counting final : public Study {
 public:
  explicit Counting(std::size_t cases) : Study({.title = "counting"}), cases_(cases) {}

  void add_options(CLI::App&) override {}
  Result<std::vector<std::string>> prepare() override {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < cases_; ++i) names.push_back(fmt::format("case {}", i));
    return names;
  }
  json settings() const override { return json::object(); }
  Result<json> run_case(std::size_t index, std::stop_token stop) override {
    run.push_back(index);
    if (before) before(index);
    if (stop.stop_requested()) return Error{Code::kCancelled, "batch: cancelled by its caller"};
    if (index == broken) return Error{Code::kUnavailable, "no worker"};
    return json{{"square", index * index}};
  }
  std::string news_of(const json&) const override { return "squared"; }
  StudyReport report(const std::vector<json>& records) const override {
    return {.table = "table\n", .json = {{"records", records}}};
  }

  std::function<void(std::size_t)> before;
  std::size_t broken = SIZE_MAX;
  std::vector<std::size_t> run;

 private:
  std::size_t cases_;
};

class AnyStudy : public ::testing::Test {
 protected:
  std::unique_ptr<common::Journal> journal() const {
    auto journal_result = common::Journal::open(folder.path() / "x.journal", {{"study", "counting"}});
    if (!journal_result) throw std::runtime_error(journal_result.error().message);
    return std::move(journal_result).value();
  }

  const TempFolder folder;
  std::stop_source stop;
  Counting sut{5};
};

TEST_F(AnyStudy, ReportsAllCasesInTheirOrder) {
  std::vector<std::string> news;
  const StudyEnd end = finished(sut, {.on_case = [&](const std::string& text) { news.push_back(text); }});
  EXPECT_TRUE(end.complete());
  EXPECT_EQ(end.report.json["records"][4]["square"], 16);
  EXPECT_FALSE(end.report.json.contains("partial"));
  EXPECT_EQ(news.size(), 5u);
  EXPECT_EQ(news[2], "case 2: squared");
}

TEST_F(AnyStudy, ReportsWhatIsFinishedWhenItIsStopped) {
  sut.before = [&](std::size_t index) {
    if (index == 3) stop.request_stop();
  };
  std::vector<std::string> troubles;
  const StudyEnd end = finished(
      sut, {.stop = stop.get_token(), .on_trouble = [&](const std::string& text) { troubles.push_back(text); }});
  EXPECT_FALSE(end.complete());
  EXPECT_EQ(end.done, 3u);
  EXPECT_EQ(end.broken, 0u);  // the one under way did not fail
  EXPECT_THAT(troubles, ::testing::IsEmpty());
  EXPECT_EQ(end.report.json["partial"], (json{{"done", 3}, {"of", 5}}));
  EXPECT_TRUE(end.report.json["records"][3].is_null());
}

TEST_F(AnyStudy, GoesOnWhereItStopped) {
  sut.before = [&](std::size_t index) {
    if (index == 3) stop.request_stop();
  };
  {
    const auto kept = journal();
    (void)finished(sut, {.stop = stop.get_token(), .journal = kept.get()});
  }
  Counting again(5);
  const auto kept = journal();
  std::size_t found = 0;
  const StudyEnd end =
      finished(again, {.journal = kept.get(), .on_begin = [&](std::size_t, std::size_t known) { found = known; }});
  EXPECT_EQ(found, 3u);
  EXPECT_EQ(end.found, 3u);
  EXPECT_THAT(again.run, ::testing::ElementsAre(3, 4));
  EXPECT_TRUE(end.complete());
  EXPECT_EQ(end.report.json, finished(sut).report.json);
}

TEST_F(AnyStudy, TriesAgainWhatBroke) {
  sut.broken = 1;
  {
    const auto kept = journal();
    std::vector<std::string> troubles;
    const StudyEnd end = finished(
        sut, {.journal = kept.get(), .on_trouble = [&](const std::string& text) { troubles.push_back(text); }});
    EXPECT_EQ(end.broken, 1u);
    EXPECT_TRUE(end.complete());
    EXPECT_THAT(troubles, ::testing::ElementsAre("case 1: no worker"));
  }
  Counting again(5);
  const auto kept = journal();
  EXPECT_EQ(finished(again, {.journal = kept.get()}).broken, 0u);
  EXPECT_THAT(again.run, ::testing::ElementsAre(1));
}

}  // namespace
}  // namespace jostle::tests
