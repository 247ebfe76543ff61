#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>

#include "physics_pool/api/rollout.hpp"

namespace jostle::physics_pool {
namespace {

using testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kTimeStep = 0.002;

StateLayout layout() {
  StateLayout result;
  result.nq = 12;
  result.nv = 11;
  result.nu = 4;
  return result;
}

RolloutBatch good() {
  RolloutBatch batch;
  batch.x0 = {.q = std::vector<double>(12, 0.1), .v = std::vector<double>(11, 0.0)};
  batch.nominal = {.nu = 4, .values = std::vector<double>(8, 0.01)};
  batch.u_before = {0, 0, 0, 0};
  batch.law = {.sigma = {0.1, 0.1, 0.1, 0.1}, .limit = {1, 1, 1, 1}};
  return batch;
}

TEST(ValidateBatch, AcceptsAGoodOne) {
  EXPECT_TRUE(validate(good()));
  const auto ok = validate(good(), layout(), kTimeStep);
  EXPECT_TRUE(ok) << ok.error().message;
}

struct Case {
  const char* name;
  std::function<void(RolloutBatch&)> spoil;
  const char* field;
  const char* got;
  const char* wanted;
};

// Names of INSTANTIATE need printing.
void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

class BadBatch : public testing::TestWithParam<Case> {};

TEST_P(BadBatch, IsRefusedNamingFieldGotAndWanted) {
  RolloutBatch batch = good();
  GetParam().spoil(batch);
  const auto ok = validate(batch, layout(), kTimeStep);
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kInvalidArgument);
  EXPECT_THAT(ok.error().message, testing::StartsWith(std::string(GetParam().field) + ": got"));
  EXPECT_THAT(ok.error().message, HasSubstr(GetParam().got));
  EXPECT_THAT(ok.error().message, HasSubstr("wanted"));
  EXPECT_THAT(ok.error().message, HasSubstr(GetParam().wanted));
}

using B = RolloutBatch;
const std::vector<Case> kCases{
    {"NoControlAxes", [](B& b) { b.nominal.nu = 0; }, "nominal.nu", "0", "1 to 64"},
    {"NegativeControlAxes", [](B& b) { b.nominal.nu = -4; }, "nominal.nu", "-4", "1 to 64"},
    {"ManyControlAxes", [](B& b) { b.nominal.nu = 65; }, "nominal.nu", "65", "1 to 64"},
    {"OtherControlAxes",
     [](B& b) {
       b.nominal = {.nu = 2, .values = {0, 0}};
       b.u_before = {0, 0};
       b.law = {.sigma = {0, 0}, .limit = {1, 1}};
     },
     "nominal.nu", "2", "4"},
    {"NoControls", [](B& b) { b.nominal.values.clear(); }, "nominal.values", "0 values", "at least one"},
    {"HalfAStep", [](B& b) { b.nominal.values.resize(6); }, "nominal.values", "6 values", "multiple of nu = 4"},
    {"AbsurdHorizon", [](B& b) { b.nominal.values.resize(4 * (kMaxSteps + 1)); }, "nominal.values", "10001 steps",
     "10000"},
    {"NaNControl", [](B& b) { b.nominal.values[5] = kNaN; }, "nominal.values[5]", "nan", "finite"},
    {"InfiniteControl", [](B& b) { b.nominal.values[0] = kInfinity; }, "nominal.values[0]", "inf", "finite"},
    {"NoSamples", [](B& b) { b.samples = 0; }, "samples", "0", "1 to"},
    {"ManySamples", [](B& b) { b.samples = kMaxSamples + 1; }, "samples", "1000001", "1000000"},
    {"SamplesThatWrap",
     [](B& b) {
       b.first_sample = UINT32_MAX;
       b.samples = 2;
     },
     "first_sample", "4294967295", "no wrap"},
    {"ZeroDuration", [](B& b) { b.step_duration = 0; }, "step_duration", "0 s", "more than 0"},
    {"NegativeDuration", [](B& b) { b.step_duration = -1; }, "step_duration", "-1 s", "more than 0"},
    {"NaNDuration", [](B& b) { b.step_duration = kNaN; }, "step_duration", "nan s", "more than 0"},
    {"LongDuration", [](B& b) { b.step_duration = 61; }, "step_duration", "61 s", "60 s"},
    {"OddDuration", [](B& b) { b.step_duration = 0.1234567; }, "step_duration", "0.1234567 s",
     "multiple of the time step, 0.002 s"},
    {"TinyDuration", [](B& b) { b.step_duration = 1e-9; }, "step_duration", "1e-09 s", "multiple"},
    {"HugeState", [](B& b) { b.x0.q.resize(kMaxStateSize + 1); }, "x0", "100001", "100000"},
    {"ShortQ", [](B& b) { b.x0.q.resize(11); }, "x0.q", "11 values", "12"},
    {"LongV", [](B& b) { b.x0.v.resize(12); }, "x0.v", "12 values", "11"},
    {"NaNQ", [](B& b) { b.x0.q[3] = kNaN; }, "x0.q[3]", "nan", "finite"},
    {"InfiniteV", [](B& b) { b.x0.v[10] = -kInfinity; }, "x0.v[10]", "-inf", "finite"},
    {"ShortUBefore", [](B& b) { b.u_before.pop_back(); }, "u_before", "3 values", "4"},
    {"NaNUBefore", [](B& b) { b.u_before[1] = kNaN; }, "u_before[1]", "nan", "finite"},
    {"ShortSigma", [](B& b) { b.law.sigma.pop_back(); }, "law.sigma", "3 values", "4"},
    {"NegativeSigma", [](B& b) { b.law.sigma[2] = -0.1; }, "law.sigma[2]", "-0.1", ">= 0"},
    {"NaNSigma", [](B& b) { b.law.sigma[0] = kNaN; }, "law.sigma[0]", "nan", ">= 0"},
    {"LongLimit", [](B& b) { b.law.limit.push_back(1); }, "law.limit", "5 values", "4"},
    {"ZeroLimit", [](B& b) { b.law.limit[3] = 0; }, "law.limit[3]", "0", "> 0"},
    {"NaNLimit", [](B& b) { b.law.limit[3] = kNaN; }, "law.limit[3]", "nan", "> 0"},
    {"NaNIncumbent", [](B& b) { b.incumbent = kNaN; }, "incumbent", "NaN", "a cost"},
    {"NegativeMinSteps", [](B& b) { b.min_steps = -1; }, "min_steps", "-1", ">= 0"},
    {"NegativeWait", [](B& b) { b.wait = std::chrono::nanoseconds(-1); }, "wait", "-1", "0 to 10 s"},
    {"LongWait", [](B& b) { b.wait = std::chrono::seconds(11); }, "wait", "11000000000", "0 to 10 s"},
    {"NegativeGoal", [](B& b) { b.objective["goal"].weight = -1; }, "objective.goal", "-1", ">= 0"},
    {"NaNAngle", [](B& b) { b.objective.value("goal", "angle") = kNaN; }, "objective.goal_angle", "nan", ">= 0"},
    {"NegativeAcceleration", [](B& b) { b.objective["acceleration"].weight = -1; }, "objective.acceleration", "-1",
     ">= 0"},
    {"NegativeDisturbance", [](B& b) { b.objective["disturbance"].weight = -1; }, "objective.disturbance", "-1",
     ">= 0"},
    {"NegativeRotation", [](B& b) { b.objective.value("disturbance", "rotation") = -1; },
     "objective.disturbance_rotation", "-1", ">= 0"},
    {"InfiniteEdge", [](B& b) { b.objective["edge"].weight = kInfinity; }, "objective.edge", "inf", ">= 0"},
    {"NegativeEdgeRate", [](B& b) { b.objective.value("edge", "rate") = -1; }, "objective.edge_rate", "-1", ">= 0"},
    {"NaNExponent", [](B& b) { b.objective.value("edge", "exponent_max") = kNaN; }, "objective.edge_exponent_max",
     "nan", ">= 0"},
    {"NegativeMargin", [](B& b) { b.objective.value("edge", "margin") = -1; }, "objective.edge_margin", "-1", ">= 0"},
    {"NegativeTopple", [](B& b) { b.objective["topple"].weight = -1; }, "objective.topple", "-1", ">= 0"},
    {"NegativeToppleAngle", [](B& b) { b.objective.value("topple", "angle") = -1; }, "objective.topple_angle", "-1",
     ">= 0"},
    {"NegativeDrop", [](B& b) { b.objective["drop"].weight = -1; }, "objective.drop", "-1", ">= 0"},
    {"NegativeDropHeight", [](B& b) { b.objective.value("drop", "height") = -1; }, "objective.drop_height", "-1",
     ">= 0"},
    {"SigmaOfTooFewSteps", [](B& b) { b.law.sigma.resize(b.nominal.values.size() - 1); }, "law.sigma", "values", "4"},
    {"NegativePersistence", [](B& b) { b.law.persistence = -0.1; }, "law.persistence", "-0.1", "at least 0"},
    {"PersistenceOfOne", [](B& b) { b.law.persistence = 1; }, "law.persistence", "1", "less than 1"},
    {"NaNPersistence", [](B& b) { b.law.persistence = kNaN; }, "law.persistence", "nan", "less than 1"},
    {"DrawsOfTooFewSamples",
     [](B& b) {
       b.law.draws = {1};
       b.samples = 2;
     },
     "law.draws", "1 values", "2 samples"},
    {"NegativeTimeStep", [](B& b) { b.fidelity.time_step = -0.1; }, "fidelity.time_step", "-0.1", "at most 0.02"},
    {"NaNTimeStep", [](B& b) { b.fidelity.time_step = kNaN; }, "fidelity.time_step", "nan", "at most 0.02"},
    {"LongTimeStep", [](B& b) { b.fidelity.time_step = 0.05; }, "fidelity.time_step", "0.05", "at most 0.02"},
    {"OddTimeStep",
     [](B& b) {
       b.fidelity.time_step = 0.003;
       b.step_duration = 0.5;
     },
     "step_duration", "0.5 s", "0.003 s"},
    {"NoScales", [](B& b) { b.law.scales.clear(); }, "law.scales", "0 values", "1 to"},
    {"NaNScale",
     [](B& b) {
       b.law.scales = {1, kNaN};
     },
     "law.scales[1]", "nan", ">= 0"},
    {"InfiniteSigma", [](B& b) { b.law.sigma[0] = HUGE_VAL; }, "law.sigma[0]", "inf", ">= 0"},
    {"NegativeObstruction", [](B& b) { b.objective["obstruction"].weight = -1; }, "objective.obstruction", "-1",
     ">= 0"},
    {"NegativeObstacleTarget", [](B& b) { b.objective.value("obstacle", "target") = -1; }, "objective.obstacle_target",
     "-1", ">= 0"},
    {"NaNObstaclePusher", [](B& b) { b.objective.value("obstacle", "pusher") = kNaN; }, "objective.obstacle_pusher",
     "nan", ">= 0"},
    {"NoObstacleCap", [](B& b) { b.objective.value("obstacle", "nearest") = 0; }, "objective.obstacle_nearest", "0 m",
     ">= 0.001"},
    {"NaNObstacleCap", [](B& b) { b.objective.value("obstacle", "nearest") = kNaN; }, "objective.obstacle_nearest",
     "nan", ">= 0.001"},
    {"NegativeCollision", [](B& b) { b.objective["collision"].weight = -1; }, "objective.collision", "-1", ">= 0"},
    {"NegativeIntrusion", [](B& b) { b.objective["intrusion"].weight = -1; }, "objective.intrusion", "-1", ">= 0"},
    {"NaNSuccess", [](B& b) { b.objective.success_cost = kNaN; }, "objective.success_cost", "nan", ">= 0"},
};

INSTANTIATE_TEST_SUITE_P(EveryField, BadBatch, testing::ValuesIn(kCases),
                         [](const auto& param) { return std::string(param.param.name); });

TEST(ValidateBatch, AcceptsTheLimitsThemselves) {
  RolloutBatch batch = good();
  batch.samples = kMaxSamples;
  batch.step_duration = kMaxStepDuration;
  batch.first_sample = UINT32_MAX - kMaxSamples;
  batch.wait = kMaxWait;
  batch.incumbent = -1e9;
  batch.fidelity.time_step = 1e-9;  // the world's own is longer
  const auto ok = validate(batch, layout(), kTimeStep);
  EXPECT_TRUE(ok) << ok.error().message;
}

TEST(ValidateBatch, AcceptsDurationsThatAreMultiplesUpToRounding) {
  for (const int steps : {1, 7, 50, 333, 30000}) {
    RolloutBatch batch = good();
    batch.step_duration = steps * kTimeStep;
    EXPECT_TRUE(validate(batch, layout(), kTimeStep)) << steps;
  }
}

std::vector<RolloutOutcome> outcomes(std::initializer_list<std::pair<End, double>> list) {
  std::vector<RolloutOutcome> result;
  for (const auto& [end, cost] : list) {
    result.push_back({.sample = static_cast<std::uint32_t>(result.size()), .end = end, .cost = cost});
  }
  return result;
}

TEST(SelectWinner, TakesTheCheapestBelowTheIncumbent) {
  const auto list = outcomes({{End::kCompleted, 3}, {End::kCompleted, 1}, {End::kCompleted, 2}});
  EXPECT_EQ(select_winner(list, kInfinity), 1);
  EXPECT_EQ(select_winner(list, 1.5), 1);
}

TEST(SelectWinner, TakesTheLowestIndexOfATie) {
  EXPECT_EQ(select_winner(outcomes({{End::kCompleted, 2}, {End::kCompleted, 1}, {End::kCompleted, 1}}), kInfinity), 1);
}

TEST(SelectWinner, TakesNobodyWhenTheIncumbentIsAsGood) {
  const auto list = outcomes({{End::kCompleted, 3}, {End::kCompleted, 1}});
  EXPECT_EQ(select_winner(list, 1.0), -1);
  EXPECT_EQ(select_winner(list, 0.5), -1);
}

TEST(SelectWinner, TakesTheFirstSuccessWhateverItCosts) {
  const auto list =
      outcomes({{End::kCompleted, 1}, {End::kLost, kInfinity}, {End::kSucceeded, 9}, {End::kSucceeded, 2}});
  EXPECT_EQ(select_winner(list, kInfinity), 2);
  EXPECT_EQ(select_winner(list, 0.5), 2);
}

TEST(SelectWinner, TakesNobodyWhoDidNotFinish) {
  EXPECT_EQ(select_winner(outcomes({{End::kLost, 1}, {End::kDiverged, 1}, {End::kSkipped, 1}}), kInfinity), -1);
  EXPECT_EQ(select_winner({}, kInfinity), -1);
}

TEST(SelectWinner, TakesNobodyWhoseCostIsInfinite) {
  EXPECT_EQ(select_winner(outcomes({{End::kCompleted, kInfinity}}), kInfinity), -1);
}

}  // namespace
}  // namespace jostle::physics_pool
