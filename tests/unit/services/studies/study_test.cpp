#include <gmock/gmock.h>

#include <cmath>

#include "idl/text/yaml_fields.hpp"
#include "services/studies/experiment/prediction_study.hpp"
#include "services/studies/experiment/push_study.hpp"
#include "services/studies/experiment/study.hpp"
#include "tests/support/studies.hpp"

namespace jostle::tests {
namespace {

using namespace studies;
using ::testing::HasSubstr;

Result<std::unique_ptr<Study>> prediction(const std::string& text) {
  using Loaded = std::unique_ptr<Study>;
  return yaml::parse<Loaded>(text, "study.yaml", [](const YAML::Node& root) -> Result<Loaded> {
    yaml::Fields fields(root, "", "study.yaml");
    auto study_result = read_prediction_study(fields, "study.yaml");
    fields.finish();
    return study_result;
  });
}

constexpr const char* kSmall = R"(
title: small
models: [kinematic, planar]
cases: open-loop
samples: 2
duration: 0.4
angles_deg: [0]
integrator: euler
)";

TEST(LoadStudies, EveryFileThatNamesAStudyLoadsAndSaysWhatItIs) {
  std::vector<std::string> names;
  for (const auto& [name, study] : load_studies()) {
    names.push_back(name);
    EXPECT_FALSE(study->about().purpose.empty()) << name;
    EXPECT_FALSE(study->about().takes.empty()) << name;
  }
  EXPECT_THAT(names,
              ::testing::IsSupersetOf({"fig-3.5", "fig-4.4", "fig-5.3", "fig-5.4", "fig-5.5", "fig-6.5", "fig-6.6",
                                       "fig-6.7", "fig-7.2", "fig-7.3", "fig-7.4", "fig-7.5", "table-6.1"}));
}

TEST(LoadStudy, UnknownNameAndMereParametersAreToldApart) {
  EXPECT_EQ(load_study("fig-0.0").error().code, Code::kNotFound);
  EXPECT_THAT(load_study("pushing").error().message, HasSubstr("study: missing"));
}

TEST(ParseSeeds, TakesARangeOrOne) {
  EXPECT_EQ(*parse_seeds("1-10"), (std::pair<std::uint64_t, std::uint64_t>(1, 10)));
  EXPECT_EQ(*parse_seeds("7"), (std::pair<std::uint64_t, std::uint64_t>(7, 7)));
  for (const char* text : {"", "-1", "10-1", "1-", "1-2x", "x", "7x", " 1"}) EXPECT_FALSE(parse_seeds(text)) << text;
}

TEST(PredictionStudy, LastIterationIsExactAndRowsAreWhatReadersExpect) {
  auto study_result = prediction(kSmall);
  ASSERT_TRUE(study_result) << study_result.error().message;
  const StudyEnd end = finished(**study_result);

  const auto& json = end.report.json;
  EXPECT_EQ(json["model"], "kinematic");
  ASSERT_EQ(json["rows"].size(), 5u);
  EXPECT_GT(json["rows"][0]["trans_mm"], 0.0);
  EXPECT_EQ(json["rows"][4]["iteration"], 4);
  EXPECT_EQ(json["rows"][4]["trans_mm"], 0.0);
  EXPECT_EQ(json["rows"][4]["rot_deg"], 0.0);
  EXPECT_EQ(json["models"].size(), 2u);
  EXPECT_EQ(end.broken, 0u);
}

TEST(PredictionStudy, NumbersDoNotDependOnJobs) {
  auto one = prediction(kSmall), two = prediction(kSmall);
  set_options(**one, {"--jobs", "1"});
  set_options(**two, {"--jobs", "2"});
  EXPECT_EQ(finished(**one).report.json, finished(**two).report.json);
}

TEST(PredictionStudy, FigureShowsTheExactIterationAndIsMadeOfTheReport) {
  auto study_result = prediction(kSmall);
  const StudyEnd end = finished(**study_result);
  const auto panels = (*study_result)->figure(end.report.json);
  ASSERT_EQ(panels.size(), 1u);
  EXPECT_TRUE(panels[0].counts_x);
  EXPECT_EQ(panels[0].zero, "exact");
  ASSERT_EQ(panels[0].bands.size(), 2u);
  EXPECT_EQ(panels[0].bands[0].x, (std::vector<double>{0, 1, 2, 3, 4}));
  EXPECT_EQ(panels[0].bands[0].middle[4], 0.0);
}

TEST(PredictionStudy, OnePredictionHasNoInterval) {
  auto study_result = prediction(kSmall);
  set_options(**study_result, {"--samples", "1"});
  const StudyEnd end = finished(**study_result);
  EXPECT_TRUE(end.report.json["rows"][0]["trans_mm_half_width"].is_null());
  EXPECT_THAT(end.report.table, ::testing::Not(HasSubstr("±")));
  EXPECT_TRUE(std::isnan((*study_result)->figure(end.report.json)[0].bands[0].low[0]));
}

TEST(PredictionStudy, RefusesWhatItDoesNotHave) {
  EXPECT_THAT(prediction("title: x\nmodels: [planar]\ncases: dice\n").error().message,
              HasSubstr("study.yaml:3: cases: got 'dice', wanted one of: open-loop, examples, random"));
  EXPECT_THAT(prediction("title: x\nmodels: []\n").error().message, HasSubstr("got 0 models"));
  auto study_result = prediction(kSmall);
  EXPECT_THROW(set_options(**study_result, {"--levels", "low"}), CLI::ParseError);
  set_options(**study_result, {"--models", "astrology"});
  EXPECT_THAT(refusal(**study_result), HasSubstr("got 'astrology'"));
}

TEST(TimingStudy, OneRunHasTimesAndNoIntervals) {
  auto study_result = load_study("fig-6.6");
  ASSERT_TRUE(study_result) << study_result.error().message;
  set_options(**study_result, {"--samples", "1"});
  const StudyEnd end = finished(**study_result);
  EXPECT_THAT(end.report.table, ::testing::Not(HasSubstr("±")));
  ASSERT_EQ(end.report.json["rows"].size(), 5u);
  for (const auto& row : end.report.json["rows"]) {
    EXPECT_GT(row["ms"], 0.0);
    EXPECT_TRUE(row["ms_half_width"].is_null());
  }
  EXPECT_EQ((*study_result)->figure(end.report.json)[0].bands[0].x, (std::vector<double>{1, 2, 3, 4}));
}

TEST(PredictionCases, AreTheSameEveryTimeAndFeasible) {
  const PredictionStudy study{.cases = PredictionStudy::Cases::kRandom,
                              .shape = physics_pool::Shape::kCylinder,
                              .sliders = {1, 4},
                              .actions = {8},
                              .samples = 20};
  const PredictionCases a = make_cases(study), b = make_cases(study);
  ASSERT_EQ(a.cases.size(), 40u);
  for (std::size_t i = 0; i < a.cases.size(); ++i) {
    EXPECT_EQ(a.cases[i].batch.x0, b.cases[i].batch.x0);
    EXPECT_EQ(a.cases[i].batch.nominal.values, b.cases[i].batch.nominal.values);
    EXPECT_EQ(a.cases[i].batch.nominal.steps(), 8);
    for (int t = 0; t < 8; ++t) {
      const auto u = a.cases[i].batch.nominal.step(t);
      EXPECT_LE(std::hypot(u[0], u[1]), study.speed + 1e-12);
    }
  }
}

}  // namespace
}  // namespace jostle::tests
