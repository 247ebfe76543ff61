// Studies that act in a world, run to their end: small scenes, few iterations.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>

#include "idl/text/yaml_fields.hpp"
#include "services/studies/experiment/grasping_study.hpp"
#include "services/studies/experiment/push_study.hpp"
#include "services/studies/experiment/study.hpp"
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

void expect_finite(const json& value, const std::string& where = "json") {
  if (value.is_number()) {
    EXPECT_TRUE(std::isfinite(value.get<double>())) << where;
  }
  EXPECT_FALSE(value.is_null()) << where;  // what is no number is dumped as null
  for (const auto& [key, element] : value.items()) {
    if (value.is_structured()) expect_finite(element, where + "." + key);
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

  StudyOptions options(int jobs = 1) {
    return {.jobs = jobs, .on_progress = [this](const std::string& line) { lines.push_back(line); }};
  }

  static StudyReport finished(Study& sut, const StudyOptions& options) {
    auto report_result = sut.run(options);
    if (!report_result) throw std::runtime_error(report_result.error().message);
    return std::move(report_result).value();
  }

  const TempFolder folder;
  std::vector<std::string> lines;  // of progress
};

class GraspingStudyRun : public StudyRun {
 protected:
  // Of one run: it takes longest.
  const StudyReport& report() {
    static const StudyReport first = finished(*sut, options());
    return first;
  }

  const Loaded sut = study(&read_grasping_study,
                           "planner: {rollouts: 2}\n"
                           "control: {many_iterations: 3, few_iterations: 1, few_iterations_max: 2, timeout: 600}\n",
                           R"(
title: tiny grasping
parameters: parameters.yaml
objects: 2
seeds: {first: 1, last: 2}
levels: [none, low]
controllers: [or, nr]
thesis:
  none: {or: 0.75}
)");
};

TEST_F(GraspingStudyRun, HasARowPerCellAndAnEntryPerRun) {
  EXPECT_FALSE(report().broken);
  const json& result = report().json;
  expect_finite(result);
  EXPECT_THAT(keys_of(result), UnorderedElementsAre("title", "objects", "rows", "runs"));
  EXPECT_EQ(result["title"], "tiny grasping");
  EXPECT_EQ(result["objects"], 2);
  ASSERT_EQ(result["rows"].size(), 4u);
  ASSERT_EQ(result["runs"].size(), 8u);
  std::size_t place = 0;
  for (const char* level : {"none", "low"}) {
    for (const char* controller : {"or", "nr"}) {
      const json& row = result["rows"][place / 2];
      EXPECT_THAT(keys_of(row), UnorderedElementsAre("level", "controller", "successes", "runs", "interval", "replans",
                                                     "execution_cost", "plan_seconds", "total_seconds"));
      EXPECT_EQ(row["level"], level);
      EXPECT_EQ(row["controller"], controller);
      EXPECT_EQ(row["runs"], 2);
      expect_share(row);
      int successes = 0;
      for (const int seed : {1, 2}) {
        const json& run = result["runs"][place++];
        EXPECT_THAT(keys_of(run), UnorderedElementsAre("seed", "level", "controller", "success", "ending", "reason",
                                                       "plan_hash", "plan_seconds", "total_seconds", "replans",
                                                       "actions", "rollouts", "execution_cost"));
        EXPECT_EQ(run["seed"], seed);
        EXPECT_EQ(run["level"], level);
        EXPECT_EQ(run["controller"], controller);
        EXPECT_FALSE(run["reason"].get<std::string>().empty());
        EXPECT_THAT(run["plan_hash"].get<std::string>(), ::testing::MatchesRegex("[0-9a-f]{32}"));
        EXPECT_GE(run["actions"], 1);
        EXPECT_GE(run["rollouts"], 1);
        EXPECT_LE(run["plan_seconds"], run["total_seconds"]);
        if (run["success"]) ++successes;
      }
      EXPECT_EQ(row["successes"], successes);
    }
  }
}

TEST_F(GraspingStudyRun, RepeatsButForTimesWhateverTheJobs) {
  const StudyReport& first = report();
  lines.clear();

  const StudyReport again = finished(*sut, options(2));

  EXPECT_EQ(without_times(again.json), without_times(first.json));
  EXPECT_EQ(lines.size(), 8u);
}

TEST_F(GraspingStudyRun, TableHasTheThesissNumbersBesideOurs) {
  EXPECT_THAT(report().table, HasSubstr("tiny grasping"));
  EXPECT_THAT(report().table, ::testing::ContainsRegex("none +or +[0-2]/2 .* 0[.]75 "));
  EXPECT_THAT(report().table, ::testing::ContainsRegex("low +nr +[0-2]/2 .* - "));
}

TEST_F(GraspingStudyRun, CommandLineChoosesSeedsLevelsAndControllers) {
  StudyOptions some = options();
  some.seeds = {2, 2};
  some.levels = {"low"};
  some.controllers = {"nr"};

  const StudyReport chosen = finished(*sut, some);

  ASSERT_EQ(chosen.json["runs"].size(), 1u);
  EXPECT_EQ(without_times(chosen.json["runs"][0]), without_times(report().json["runs"][7]));
  some.levels = {"absurd"};
  EXPECT_THAT(sut->run(some).error().message, HasSubstr("--levels: "));
  some.levels = {};
  some.controllers = {"psychic"};
  EXPECT_THAT(sut->run(some).error().message,
              HasSubstr("--controllers: got 'psychic' for a task to grasp, wanted or, nr"));
}

TEST_F(GraspingStudyRun, StopRequestEndsItWithCancelled) {
  std::stop_source stop;
  StudyOptions stopped = options();
  stopped.stop = stop.get_token();
  stopped.on_progress = [&](const std::string& line) {
    lines.push_back(line);
    stop.request_stop();
  };

  const auto report_result = sut->run(stopped);

  ASSERT_FALSE(report_result);
  EXPECT_EQ(report_result.error().code, Code::kCancelled);
  EXPECT_EQ(lines.size(), 1u);
}

class PushStudyRun : public StudyRun {
 protected:
  const Loaded sut = study(&read_push_study,
                           "planner: {rollouts: 2, sigma: [0.01, 0.01], limit: [0.1, 0.1]}\n"
                           "mpc: {horizon: 2, first_iterations: 1, iterations: 1, max_actions: 3}\n",
                           R"(
title: tiny push
parameters: parameters.yaml
chapter: 6
reality: low
seeds: {first: 1, last: 2}
predictors:
  - {predictor: "coarse,kinematic"}
  - {predictor: "fine", threads: 2}
remark: no more than a test
)");
};

TEST_F(PushStudyRun, HasARowPerPredictorAndAnEntryPerRun) {
  const StudyReport report = finished(*sut, options());

  EXPECT_FALSE(report.broken);
  EXPECT_EQ(lines.size(), 4u);
  const json& result = report.json;
  expect_finite(result);
  EXPECT_THAT(keys_of(result), UnorderedElementsAre("title", "rows", "runs"));
  EXPECT_EQ(result["title"], "tiny push");
  ASSERT_EQ(result["rows"].size(), 2u);
  ASSERT_EQ(result["runs"].size(), 4u);
  const std::pair<const char*, int> entries[] = {{"coarse,kinematic", 1}, {"fine", 2}};
  for (std::size_t entry = 0; entry < 2; ++entry) {
    const auto& [predictor, threads] = entries[entry];
    const json& row = result["rows"][entry];
    EXPECT_THAT(keys_of(row),
                UnorderedElementsAre("predictor", "threads", "successes", "runs", "interval", "actions",
                                     "planning_seconds", "planning_seconds_half_width", "seconds_per_plan",
                                     "seconds_per_plan_half_width", "completion_seconds"));
    EXPECT_EQ(row["predictor"], predictor);
    EXPECT_EQ(row["threads"], threads);
    EXPECT_EQ(row["runs"], 2);
    expect_share(row);
    double actions = 0;
    for (std::size_t seed = 0; seed < 2; ++seed) {
      const json& run = result["runs"][2 * seed + entry];  // scenes in the outer loop
      EXPECT_THAT(keys_of(run), UnorderedElementsAre("seed", "predictor", "threads", "success", "ending", "reason",
                                                     "actions", "rollouts", "planning_seconds"));
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
  ASSERT_EQ(report.panels.size(), 1u);
  ASSERT_EQ(report.panels[0].bands.size(), 2u);
  EXPECT_EQ(report.panels[0].bands[1].name, "fine x2");
}

TEST_F(PushStudyRun, RepeatsButForTimes) {
  const json first = finished(*sut, options()).json;
  EXPECT_EQ(without_times(finished(*sut, options()).json), without_times(first));
}

TEST_F(PushStudyRun, RefusesWhatItDoesNotHave) {
  StudyOptions bad = options();
  bad.levels = {"low"};
  EXPECT_THAT(sut->run(bad).error().message, HasSubstr("no --levels"));
}

}  // namespace
}  // namespace jostle::tests
