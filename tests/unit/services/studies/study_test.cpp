#include <gmock/gmock.h>

#include "idl/text/yaml_fields.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/studies/experiment/prediction_study.hpp"
#include "services/studies/experiment/push_study.hpp"
#include "services/studies/experiment/study.hpp"

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

StudyOptions quietly(int jobs = 2) {
  return {.jobs = jobs, .on_progress = [](const std::string&) {}};
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

TEST(ListStudies, EveryFileThatNamesAStudyLoads) {
  std::vector<std::string> names;
  for (const auto& [name, title] : list_studies()) names.push_back(name);
  EXPECT_THAT(names, ::testing::IsSupersetOf({"fig-3.5", "fig-6.5", "fig-6.6", "fig-6.7", "fig-7.2", "fig-7.3",
                                              "fig-7.4", "fig-7.5", "table-6.1"}));
}

TEST(LoadStudy, UnknownNameAndMereParametersAreToldApart) {
  EXPECT_EQ(load_study("fig-0.0").error().code, Code::kNotFound);
  EXPECT_THAT(load_study("pushing").error().message, HasSubstr("study: missing"));
}

TEST(PredictionStudy, LastIterationIsExactAndRowsAreWhatReadersExpect) {
  auto study_result = prediction(kSmall);
  ASSERT_TRUE(study_result) << study_result.error().message;
  auto report_result = (*study_result)->run(quietly());
  ASSERT_TRUE(report_result) << report_result.error().message;

  const auto& json = report_result->json;
  EXPECT_EQ(json["model"], "kinematic");
  ASSERT_EQ(json["rows"].size(), 5u);
  EXPECT_GT(json["rows"][0]["trans_mm"], 0.0);
  EXPECT_EQ(json["rows"][4]["iteration"], 4);
  EXPECT_EQ(json["rows"][4]["trans_mm"], 0.0);
  EXPECT_EQ(json["rows"][4]["rot_deg"], 0.0);
  EXPECT_EQ(json["models"].size(), 2u);
  EXPECT_FALSE(report_result->broken);
}

TEST(PredictionStudy, NumbersDoNotDependOnJobs) {
  auto one = prediction(kSmall), two = prediction(kSmall);
  EXPECT_EQ((*one)->run(quietly(1))->json, (*two)->run(quietly(2))->json);
}

TEST(PredictionStudy, RefusesWhatItDoesNotHave) {
  EXPECT_THAT(prediction("title: x\nmodels: [planar]\ncases: dice\n").error().message,
              HasSubstr("study.yaml:3: cases: got 'dice', wanted one of: open-loop, examples, random"));
  EXPECT_THAT(prediction("title: x\nmodels: []\n").error().message, HasSubstr("got 0 models"));
  auto study_result = prediction(kSmall);
  StudyOptions options = quietly();
  options.levels = {"low"};
  EXPECT_THAT((*study_result)->run(options).error().message, HasSubstr("no --levels"));
  options = quietly();
  options.models = {"astrology"};
  EXPECT_THAT((*study_result)->run(options).error().message, HasSubstr("got 'astrology'"));
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

TEST(MeanOf, IsTheMeanWithItsInterval) {
  const common::Mean mean = common::mean_of({1.0, 2.0, 3.0});
  EXPECT_DOUBLE_EQ(mean.value, 2.0);
  EXPECT_NEAR(mean.half_width, 1.96 / std::sqrt(3.0), 1e-12);
  EXPECT_EQ(common::mean_of({}).half_width, 0.0);
}

}  // namespace
}  // namespace jostle::tests
