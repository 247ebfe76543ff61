#include "planners/robustness/divergence.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "physics_pool/task/state_distance.hpp"
#include "planners/robustness/segments.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::Pointwise;

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kRounding = 1e-12;

// Objects whose positions follow a linear system, in place of physics: x[t+1] = A·x[t], a factor for each object.
class LinearSystem : public testing::Test {
 protected:
  Trajectory trajectory(const std::vector<double>& factors, std::vector<double> x) const {
    Trajectory states;
    for (int t = 0; t <= kSteps; ++t) {
      State& state = states.emplace_back(physics_pool::initial_state(scene));
      for (std::size_t i = 0; i < x.size(); ++i) {
        state.q[static_cast<std::size_t>(geometry.layout.objects[i].q)] += x[i];
        x[i] *= factors[i];
      }
    }
    return states;
  }

  // The planned one begins at 0, where every linear system rests.
  Deviations deviating(const std::vector<double>& factors, const std::vector<std::vector<double>>& from,
                       const std::vector<int>& objects = {0, 1, 2}) const {
    std::vector<Trajectory> samples;
    for (const auto& start : from) samples.push_back(trajectory(factors, start));
    return deviations(geometry, trajectory(factors, {0, 0, 0}), samples, objects);
  }

  static constexpr int kSteps = 4;
  const physics_pool::Scene scene = three_objects();
  const physics_pool::TaskGeometry geometry{scene};
  const std::vector<std::vector<double>> starts{{0.001, 0.002, -0.003}, {-0.004, 0.0, 0.001}, {0.002, 0.002, 0.002}};
};

TEST_F(LinearSystem, ThatContractsOrExpandsHasTheExactMetrics) {
  for (const double factor : {0.5, 0.9, 1.0, 1.25, 2.0}) {
    const Deviations sut = deviating({factor, factor, factor}, starts);
    for (const Metric metric : {Metric::kExpected, Metric::kMaximal}) {
      for (int p = 0; p < kSteps; ++p) {
        for (int q = p + 1; q <= kSteps; ++q) {
          EXPECT_NEAR(path_metric(metric, sut, p, q), std::pow(factor, q - p), 1e-9) << p << " to " << q;
        }
      }
      EXPECT_NEAR(divergence_rate(path_metric(metric, sut, 1, 2), 0.2), std::log(factor) / 0.2, 1e-8);
    }
  }
}

// One start along each axis: the mean is over lengths, the maximum that of the axis that expands.
TEST_F(LinearSystem, ThatContractsOneWayAndExpandsAnotherIsToldApartByTheTwoMetrics) {
  const Deviations sut = deviating({0.5, 0.5, 1.5}, {{0.003, 0, 0}, {0, 0.003, 0}, {0, 0, 0.001}});
  EXPECT_NEAR(path_metric(Metric::kExpected, sut, 0, 1), (0.0015 + 0.0015 + 0.0015) / 0.007, 1e-9);
  EXPECT_NEAR(path_metric(Metric::kMaximal, sut, 0, 1), 1.5, 1e-9);
  EXPECT_LT(path_metric(Metric::kExpected, sut, 0, 1), 1);
}

TEST_F(LinearSystem, IsJudgedByTheChosenObjectsAlone) {
  EXPECT_NEAR(path_metric(Metric::kMaximal, deviating({0.5, 3.0, 1.0}, starts, {0}), 0, 2), 0.25, 1e-9);
  EXPECT_NEAR(path_metric(Metric::kExpected, deviating({0.5, 3.0, 1.0}, starts, {1}), 0, 2), 9.0, 1e-9);
  EXPECT_NEAR(path_metric(Metric::kExpected, deviating({0.5, 3.0, 1.0}, starts, {2}), 0, 2), 1.0, 1e-9);
}

// Eq. 4.26 and 4.27: whatever the steps are.
TEST(StepMetrics, MultiplyToTheirSegmentWhereTheyAreExpectedOnes) {
  const Deviations sut{{0.3, 0.1, 0.4, 0.2, 0.9}, {0.2, 0.5, 0.1, 0.3, 0.4}, {0.6, 0.2, 0.2, 0.8, 0.1}};
  const std::vector<double> expected = step_metrics(Metric::kExpected, sut);
  const std::vector<double> maximal = step_metrics(Metric::kMaximal, sut);
  ASSERT_EQ(expected.size(), 4u);
  bool is_loose = false;
  for (int p = 0; p < 4; ++p) {
    for (int q = p + 1; q <= 4; ++q) {
      EXPECT_NEAR(segment_metric(expected, p, q), path_metric(Metric::kExpected, sut, p, q), kRounding);
      EXPECT_GE(segment_metric(maximal, p, q), path_metric(Metric::kMaximal, sut, p, q) - kRounding);
      is_loose |= segment_metric(maximal, p, q) > 1.1 * path_metric(Metric::kMaximal, sut, p, q);
    }
  }
  EXPECT_TRUE(is_loose);
}

TEST(RealMetric, IsThatOfTheWorstWorldOverTheWholePath) {
  const std::vector<Deviations> worlds{{{1.0, 2.0, 0.5}}, {{1.0, 0.5, 0.8}}};
  EXPECT_DOUBLE_EQ(path_metric(Metric::kExpected, worlds, 0, 2), 0.8);
  std::vector<std::vector<double>> steps;
  for (const Deviations& world : worlds) steps.push_back(step_metrics(Metric::kExpected, world));
  EXPECT_NEAR(segment_metric(steps, 0, 2), 0.8, kRounding);  // and not 2·1.6, each step's worst
}

TEST(PathMetric, IsOneForWhatNeverDeviatesAndInfiniteForWhatBegins) {
  for (const Metric metric : {Metric::kExpected, Metric::kMaximal}) {
    EXPECT_EQ(path_metric(metric, Deviations{{0.0, 0.0}}, 0, 1), 1.0);
    EXPECT_EQ(path_metric(metric, Deviations{{0.0, 0.1}}, 0, 1), kInfinite);
  }
}

TEST_F(LinearSystem, TrajectoryThatEndsEarlyDivergesFromThereOn) {
  Trajectory broken = trajectory({0.5, 0.5, 0.5}, {0.01, 0, 0});
  broken.resize(2);
  const Deviations sut =
      deviations(geometry, trajectory({1, 1, 1}, {0, 0, 0}), std::vector<Trajectory>{broken}, std::vector<int>{0});
  EXPECT_NEAR(path_metric(Metric::kExpected, sut, 0, 1), 0.5, 1e-9);
  EXPECT_EQ(path_metric(Metric::kExpected, sut, 1, 2), kInfinite);
  EXPECT_EQ(segment_metric(step_metrics(Metric::kMaximal, sut), 0, 4), kInfinite);
}

// The jackknife of a mean is its textbook standard error: here all starts are of length 1, so E-hat is a mean.
TEST(Estimate, SpreadIsTheStandardErrorOfAMean) {
  const std::vector<double> ends{0.5, 1.5, 0.7, 0.9, 1.4};
  Deviations world;
  for (const double end : ends) world.push_back({1.0, end});
  const double mean = std::accumulate(ends.begin(), ends.end(), 0.0) / 5;
  double square = 0.0;
  for (const double end : ends) square += (end - mean) * (end - mean);
  const Estimate sut = estimate(Metric::kExpected, std::vector<Deviations>{world}, 0, 1);
  EXPECT_NEAR(sut.value, mean, kRounding);
  EXPECT_NEAR(sut.spread, std::sqrt(square / 4 / 5), kRounding);
}

TEST(Estimate, OfOneTrajectoryHasAnyError) {
  EXPECT_EQ(estimate(Metric::kExpected, std::vector<Deviations>{{{1.0, 0.5}}}, 0, 1).spread, kInfinite);
}

TEST(Estimate, OfTrajectoriesThatAllDoTheSameIsSure) {
  EXPECT_NEAR(estimate(Metric::kMaximal, std::vector<Deviations>{{{1.0, 0.5}, {2.0, 1.0}}}, 0, 1).spread, 0.0,
              kRounding);
}

class StateDistance : public testing::Test {
 protected:
  double moved(const std::function<void(State&)>& change, const std::vector<int>& objects) const {
    State x = physics_pool::initial_state(scene);
    change(x);
    return physics_pool::objects_distance(geometry, x.q, physics_pool::initial_state(scene).q, objects);
  }
  void turn(State& x, std::size_t object, const std::array<double, 4>& q) const {
    std::ranges::copy(q, x.q.begin() + geometry.layout.objects[object].q + 3);
  }

  const physics_pool::Scene scene = three_objects();  // a box, a cylinder, a box that is turned
  const physics_pool::TaskGeometry geometry{scene};
};

TEST_F(StateDistance, IsZeroBetweenAStateAndItsNegatedQuaternion) {
  EXPECT_NEAR(moved([&](State& x) { turn(x, 0, {-1, 0, 0, 0}); }, {0}), 0.0, kRounding);
}

TEST_F(StateDistance, CountsTurnsOfBoxesByTheirFootprintAndNoSpinOfCylinders) {
  const double radius = std::hypot(0.04, 0.04) / 2;
  EXPECT_NEAR(moved([&](State& x) { turn(x, 0, turned_about_z(0.3)); }, {0}), 0.3 * radius, 1e-9);
  EXPECT_NEAR(moved([&](State& x) { turn(x, 1, turned_about_z(2.0)); }, {1}), 0.0, kRounding);
  EXPECT_NEAR(moved([&](State& x) { turn(x, 1, {std::cos(0.1), std::sin(0.1), 0, 0}); }, {1}), 0.2 * 0.0375, 1e-9);
}

TEST_F(StateDistance, HasNothingOfObjectsThatWereNotChosenNorOfVelocities) {
  EXPECT_NEAR(moved([&](State& x) { turn(x, 0, turned_about_z(0.3)); }, {1, 2}), 0.0, 1e-8);
  EXPECT_NEAR(moved([](State& x) { x.v.assign(x.v.size(), 1.0); }, {0, 1, 2}), 0.0, 1e-8);
}

TEST_F(StateDistance, OfWholeStatesHasTheJoints) {
  State x = physics_pool::initial_state(scene);
  x.q[0] += 0.03;  // m
  x.q[2] += 0.4;   // rad
  EXPECT_NEAR(physics_pool::state_distance(geometry, x.q, physics_pool::initial_state(scene).q), 0.05, 1e-9);
}

std::vector<std::vector<int>> borders(const std::vector<Segment>& segments) {
  std::vector<std::vector<int>> result;
  for (const Segment& segment : segments) result.push_back({segment.from, segment.to, segment.is_robust ? 1 : 0});
  return result;
}

std::vector<Segment> segments_of(std::vector<double> steps, double most = 1.0) {
  return find_segments(std::vector<std::vector<double>>{std::move(steps)}, most, {});
}

// Fig. 4.2: (3-4) is not robust, (4-5) is, and makes (3-5) so.
TEST(RobustnessGraph, OfFig42Gives01And13And35) {
  const std::vector<Segment> sut = segments_of({0.5, 3.0, 3.0, 1.5, 0.4});
  EXPECT_THAT(borders(sut), ElementsAre(ElementsAre(0, 1, 1), ElementsAre(1, 3, 0), ElementsAre(3, 5, 1)));
  EXPECT_NEAR(sut[1].metric, 9.0, kRounding);
  EXPECT_NEAR(sut[2].metric, 0.6, kRounding);
}

TEST(RobustnessGraph, OfARobustPlanIsOneSegment) {
  EXPECT_THAT(borders(segments_of({0.9, 1.1, 0.9, 1.0})), ElementsAre(ElementsAre(0, 4, 1)));
}

TEST(RobustnessGraph, OfAPlanThatDivergesThroughoutIsOneSegmentToo) {
  EXPECT_THAT(borders(segments_of({1.5, 2.0, kInfinite})), ElementsAre(ElementsAre(0, 3, 0)));
}

TEST(RobustnessGraph, CountsWhatIsAlmostOneAsRobustIfTold) {
  EXPECT_THAT(borders(segments_of({1.001, 1.001})), ElementsAre(ElementsAre(0, 2, 0)));
  EXPECT_THAT(borders(segments_of({1.001, 1.001}, 1.01)), ElementsAre(ElementsAre(0, 2, 1)));
}

TEST(RobustnessGraph, TakesTheWorstWorldOfEachSegment) {
  const std::vector<std::vector<double>> steps{{2.0, 0.4}, {0.5, 1.5}};  // products 0.8 and 0.75
  const std::vector<Segment> sut = find_segments(steps, 1.0, {});
  EXPECT_THAT(borders(sut), ElementsAre(ElementsAre(0, 2, 1)));
  EXPECT_NEAR(sut[0].metric, 0.8, kRounding);
}

TEST(RobustnessGraph, OfNothingIsNothing) {
  EXPECT_TRUE(find_segments({}, 1.0, {}).empty());
  EXPECT_TRUE(segments_of({}).empty());
}

// Every path by brute force: the graph's costs none more.
TEST(RobustnessGraph, FindsNoDearerPathThanAnyOther) {
  const GraphCosts costs;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    std::vector<double> steps;
    unsigned random = seed;
    for (int t = 0; t < 7; ++t) {
      random = random * 1664525u + 1013904223u;
      steps.push_back(0.5 + static_cast<double>(random >> 16) / 65536.0);
    }
    const auto cost = [&](int i, int j) {
      return segment_metric(steps, i, j) <= 1.0 ? costs.robust / (j - i) : costs.not_robust * (j - i);
    };
    double least = kInfinite;
    for (unsigned mask = 0; mask < 64; ++mask) {  // which inner borders a path passes
      double sum = 0.0;
      int from = 0;
      for (int to = 1; to <= 7; ++to) {
        if (to < 7 && !(mask >> (to - 1) & 1u)) continue;
        sum += cost(from, to);
        from = to;
      }
      least = std::min(least, sum);
    }
    double found = 0.0;
    for (const Segment& segment : segments_of(steps)) found += cost(segment.from, segment.to);
    EXPECT_NEAR(found, least, 1e-9) << "seed " << seed;
  }
}

}  // namespace
}  // namespace jostle::planners
