// The estimator against worlds whose truth is known: each test draws what sensors would say of it.

#include "perception/estimator/estimator.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "perception/estimator/source_clock.hpp"

namespace jostle::perception {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using testing::Each;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr double kFrame = 0.01;  // s

std::array<double, 36> diagonal(double translation, double rotation) {
  std::array<double, 36> covariance{};
  for (std::size_t i = 0; i < 6; ++i) covariance[7 * i] = std::pow(i < 3 ? translation : rotation, 2);
  return covariance;
}

Quaterniond turned(double yaw) { return Quaterniond(Eigen::AngleAxisd(yaw, Vector3d::UnitZ())); }

// A pose with its noise, and what a sensor that knows it says.
class Sensor {
 public:
  Sensor(double noise, std::uint64_t seed) : noise_(noise), random_(seed) {}

  Explanation explain(const Vector3d& p, const Quaterniond& R) {
    const Vector3d at = p + draw(noise_), turn = draw(4 * noise_);
    const Quaterniond q = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * R;
    return {.X_WB = {.position = {at.x(), at.y(), at.z()}, .orientation = {q.w(), q.x(), q.y(), q.z()}},
            .covariance = diagonal(noise_, 4 * noise_)};
  }
  Sighting see(const std::string& name, const Vector3d& p, const Quaterniond& R = Quaterniond::Identity()) {
    return {name, {explain(p, R)}};
  }
  bool chance(double share) { return std::bernoulli_distribution(share)(random_); }
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  // Somewhere, turned somehow.
  Sighting dream(const std::string& name) {
    const Quaterniond R(Eigen::AngleAxisd(between(-3, 3), Vector3d(between(-1, 1), between(-1, 1), 1).normalized()));
    return see(name, {between(-0.4, 0.4), between(-0.4, 0.4), between(0, 0.3)}, R);
  }

 private:
  Vector3d draw(double sigma) {
    std::normal_distribution<double> normal(0, sigma);
    return {normal(random_), normal(random_), normal(random_)};
  }

  double noise_;
  std::mt19937_64 random_;
};

Vector3d position(const Estimate& estimate) { return Vector3d(estimate.reading.position.data()); }

double sigma_x(const Estimate& estimate) { return std::sqrt(estimate.covariance[0]); }

class EstimatorNoise : public testing::TestWithParam<double> {};

TEST_P(EstimatorNoise, RestIsRecognisedAndAveraged) {
  const double noise = GetParam();
  Sensor sensor(noise, 1);
  Estimator sut;
  const Vector3d truth(0.1, -0.2, 0.05);
  double squares = 0, inside = 0;
  int n = 0, resting = 0;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("can", truth, turned(0.4))}));
    if (i < 200) continue;
    const Estimate estimate = sut.at(i * kFrame).at(0);
    squares += (position(estimate) - truth).squaredNorm() / 3, ++n;
    inside += std::abs(position(estimate).x() - truth.x()) < 2 * sigma_x(estimate);
    resting += estimate.rests;
    if (estimate.rests) {
      EXPECT_THAT(estimate.reading.linear, Each(0.0));
    }
  }
  EXPECT_GT(resting, 0.99 * n);
  EXPECT_LT(std::sqrt(squares / n), noise / 4);
  EXPECT_GT(inside / n, 0.8);  // in the mean 0.95; errors of frames that follow one another are alike
}

TEST_P(EstimatorNoise, MotionIsFollowedWithItsVelocityAndItsEnd) {
  const double noise = GetParam(), speed = 0.1;  // m/s, from 1 s to 3 s
  Sensor sensor(noise, 2);
  Estimator sut;
  const auto truth = [&](double t) { return Vector3d(speed * std::clamp(t - 1, 0.0, 2.0), 0, 0.05); };
  double squares = 0, velocity = 0;
  int n = 0;
  for (int i = 0; i < 500; ++i) {
    const double t = i * kFrame;
    ASSERT_TRUE(sut.take(t, {sensor.see("can", truth(t))}));
    if (t < 1.5 || t > 3) continue;
    const Estimate estimate = sut.at(t).at(0);
    squares += (position(estimate) - truth(t)).squaredNorm() / 3, velocity += estimate.reading.linear[0], ++n;
  }
  EXPECT_LT(std::sqrt(squares / n), noise);
  EXPECT_NEAR(velocity / n, speed, 0.35 * speed);  // the noisier, the more cautious
  const Estimate after = sut.at(5.0).at(0);
  EXPECT_TRUE(after.rests);
  EXPECT_LT((position(after) - truth(5)).norm(), noise / 2);
}

TEST_P(EstimatorNoise, ThirtyPercentOutliersAreNotBelieved) {
  const double noise = GetParam();
  Sensor sensor(noise, 3);
  Estimator sut;
  const Vector3d truth(0.1, -0.2, 0.05);
  double worst = 0;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(sut.take(i * kFrame, {sensor.chance(0.3) ? sensor.dream("can") : sensor.see("can", truth)}));
    if (i < 50) continue;
    worst = std::max(worst, (position(sut.at(i * kFrame).at(0)) - truth).norm());
  }
  EXPECT_LT(worst, 2 * noise);
  EXPECT_GT(sut.counts().outliers, 200u);
}

INSTANTIATE_TEST_SUITE_P(, EstimatorNoise, testing::Values(0.005, 0.010, 0.015), [](const auto& noise) {
  return "Of" + std::to_string(static_cast<int>(std::lround(1e3 * noise.param))) + "mm";
});

TEST(Estimator, RotationIsFollowedPastHalfATurn) {
  Sensor sensor(0.002, 4);
  Estimator sut;
  for (int i = 0; i <= 800; ++i)
    ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("can", {0, 0, 0.05}, turned(i * kFrame))}));  // 1 rad/s, 8 rad
  const Estimate estimate = sut.at(8.0).at(0);
  const auto& q = estimate.reading.orientation;
  EXPECT_NEAR(Quaterniond(q[0], q[1], q[2], q[3]).angularDistance(turned(8.0)), 0.0, 0.02);
  EXPECT_NEAR(estimate.reading.angular[2], 1.0, 0.3);
  EXPECT_FALSE(estimate.rests);
}

TEST(Estimator, WhatIsHiddenStaysLessAndLessSurelyAndIsSaidToBeUnseen) {
  Sensor sensor(0.005, 5);
  Estimator sut;
  const Vector3d truth(0.1, 0, 0.05);
  for (int i = 0; i <= 100; ++i)
    ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("can", truth), sensor.see("bowl", {0.3, 0, 0.05})}));
  const Estimate before = sut.at(1.0).at(1);
  ASSERT_EQ(before.reading.name, "can");
  EXPECT_TRUE(before.seen);
  for (int i = 101; i <= 500; ++i) ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("bowl", {0.3, 0, 0.05})}));
  double sigma = sigma_x(before);
  for (const double time : {1.5, 2.0, 3.0, 5.0}) {
    const Estimate hidden = sut.at(time).at(1);
    EXPECT_FALSE(hidden.seen);
    EXPECT_DOUBLE_EQ(hidden.last_seen, 1.0);
    EXPECT_LT((position(hidden) - truth).norm(), 0.005);
    EXPECT_GT(sigma_x(hidden), 1.1 * sigma);
    sigma = sigma_x(hidden);
    EXPECT_TRUE(sut.at(time).at(0).seen);
  }
  // Found again elsewhere, where somebody may have pushed it meanwhile: believed at once.
  ASSERT_TRUE(sut.take(5.0, {sensor.see("can", {0.15, 0.05, 0.05})}));
  EXPECT_LT((position(sut.at(5.0).at(1)) - Vector3d(0.15, 0.05, 0.05)).norm(), 0.02);
}

TEST(Estimator, SwappedMarkersAreSwappedBack) {
  Sensor sensor(0.005, 6);
  Estimator sut;
  const Vector3d a(0.1, 0, 0.05), b(-0.1, 0.1, 0.05);
  for (int i = 0; i < 400; ++i) {
    const bool swapped = i > 100 && i < 300;
    ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("a", swapped ? b : a), sensor.see("b", swapped ? a : b)}));
    if (i < 50) continue;
    const auto estimates = sut.at(i * kFrame);
    EXPECT_LT((position(estimates.at(0)) - a).norm(), 0.005);
    EXPECT_LT((position(estimates.at(1)) - b).norm(), 0.005);
    EXPECT_TRUE(estimates[0].seen && estimates[1].seen);
  }
  EXPECT_EQ(sut.counts().swapped, 2 * 199u);
}

// One object's markers on another one, which is seen itself, too.
TEST(Estimator, AGhostOnAnotherObjectIsNotBelievedHoweverLong) {
  Sensor sensor(0.005, 7);
  Estimator sut;
  const Vector3d a(0.1, 0, 0.05), b(-0.1, 0.1, 0.05);
  for (int i = 0; i < 300; ++i)
    ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("a", i > 100 ? b : a), sensor.see("b", b)}));
  EXPECT_LT((position(sut.at(3.0).at(0)) - a).norm(), 0.005);
  EXPECT_FALSE(sut.at(3.0).at(0).seen);
}

// Between two images of a slow camera anything may have moved to where anything else is; that is no reason to doubt
// what is seen where it was.
TEST(Estimator, SlowFramesOfObjectsSideBySideAreBelieved) {
  Sensor sensor(0.001, 21);
  Estimator sut;
  const auto name = [](int i) { return "box" + std::to_string(i); };
  const auto place = [](int i) { return Vector3d(0.1 * (i % 3), 0.1 * (i / 3), 0.02); };
  for (int frame = 0; frame < 30; ++frame) {
    std::vector<Sighting> seen;
    for (int i = 0; i < 9; ++i) seen.push_back(sensor.see(name(i), place(i)));
    ASSERT_TRUE(sut.take(frame * 0.7, seen));
  }
  EXPECT_EQ(sut.counts().taken, 30u * 9u);
  EXPECT_EQ(sut.counts().outliers, 0u);
  EXPECT_EQ(sut.counts().swapped, 0u);
  const auto estimates = sut.at(29 * 0.7);
  ASSERT_THAT(estimates, SizeIs(9));
  for (int i = 0; i < 9; ++i) EXPECT_LT((position(estimates[static_cast<std::size_t>(i)]) - place(i)).norm(), 0.002);
}

TEST(Estimator, WhatWasCarriedAwayIsBelievedOnceSightingsAgree) {
  Sensor sensor(0.005, 8);
  Estimator sut;
  const Vector3d here(0.1, 0, 0.05), there(-0.2, 0.2, 0.05);
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("can", here)}));
  for (int i = 100; i < 104; ++i) ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("can", there)}));
  EXPECT_LT((position(sut.at(1.03).at(0)) - here).norm(), 0.02);
  ASSERT_TRUE(sut.take(1.04, {sensor.see("can", there)}));
  EXPECT_LT((position(sut.at(1.04).at(0)) - there).norm(), 0.02);
  EXPECT_EQ(sut.counts().moved, 1u);
}

TEST(Estimator, TheFirstSightingMayBeAnOutlier) {
  Sensor sensor(0.005, 9);
  Estimator sut;
  ASSERT_TRUE(sut.take(0.0, {sensor.dream("can")}));
  EXPECT_THAT(sut.at(0.0), IsEmpty());
  ASSERT_TRUE(sut.take(0.01, {sensor.see("can", {0.5, 0, 0.05})}));
  EXPECT_THAT(sut.at(0.01), IsEmpty());
  ASSERT_TRUE(sut.take(0.02, {sensor.see("can", {0.5, 0, 0.05})}));
  ASSERT_THAT(sut.at(0.02), SizeIs(1));
  EXPECT_NEAR(sut.at(0.02)[0].reading.position[0], 0.5, 0.02);
}

// Whatever the order in which frames of two sensors arrive, the estimate is that of the order in which they were seen.
TEST(Estimator, LateMeasurementsArePutInTheirPlace) {
  Sensor sensor(0.005, 10);
  struct Frame {
    double seen, arrives;
    Sighting sighting;
  };
  std::vector<Frame> frames;
  for (int i = 0; i < 300; ++i) {
    const double t = i * kFrame;
    const Vector3d truth(0.1 * std::sin(2 * t), 0, 0.05);
    frames.push_back({t, t + (i < 3 ? 0 : sensor.between(0, 0.1)), sensor.see("can", truth)});
  }
  Estimator in_order, sut;
  for (const Frame& frame : frames) ASSERT_TRUE(in_order.take(frame.seen, {frame.sighting}));
  std::ranges::stable_sort(frames, {}, &Frame::arrives);
  for (const Frame& frame : frames) ASSERT_TRUE(sut.take(frame.seen, {frame.sighting}));
  const Estimate a = in_order.at(3.0).at(0), b = sut.at(3.0).at(0);
  EXPECT_EQ(sut.counts().late, 0u);
  EXPECT_LT((position(a) - position(b)).norm(), 1e-4);
  EXPECT_NEAR(a.reading.linear[0], b.reading.linear[0], 5e-3);
}

TEST(Estimator, WhatIsTooLateIsCountedAndLeftOut) {
  Sensor sensor(0.005, 11);
  Estimator sut;
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(sut.take(i * kFrame, {sensor.see("can", {0, 0, 0.05})}));
  const Estimate before = sut.at(2.0).at(0);
  ASSERT_TRUE(sut.take(0.5, {sensor.see("can", {0, 0, 0.05})}));
  EXPECT_EQ(sut.counts().late, 1u);
  EXPECT_EQ(sut.at(2.0).at(0).reading.position, before.reading.position);
}

TEST(SourceClock, ClocksThatAreTwoSecondsApartAreCompared) {
  Sensor sensor(0.005, 17);
  SourceClock sut;
  for (int i = 0; i < 3000; ++i) {
    const double time = i * kFrame, arrival = time + sensor.between(0.001, 0.1);
    const double error = sut.to_host(time - 2.0, arrival) - time;
    EXPECT_GE(error, 0.0);
    if (i > 100) {
      EXPECT_LT(error, 0.01);
    }
  }
}

TEST(SourceClock, ClocksThatAgreeAreBelieved) {
  SourceClock sut;
  EXPECT_EQ(sut.to_host(5.0, 5.08), 5.0);
  EXPECT_EQ(sut.to_host(5.1, 5.09), 5.1);
}

TEST(SourceClock, AClockThatIsSetIsFollowedOnceTheOldMessagesAreForgotten) {
  SourceClock sut;
  for (int i = 0; i < 100; ++i) EXPECT_NEAR(sut.to_host(i * 0.1, i * 0.1 + 3.0), i * 0.1 + 3.0, 1e-9);
  double error = 0;
  for (int i = 100; i < 300; ++i) error = sut.to_host(i * 0.1, i * 0.1 + 5.0) - (i * 0.1 + 5.0);
  EXPECT_NEAR(error, 0.0, 1e-9);
}

// A tag looks nearly the same when it is tilted the other way. That it is the wrong one shows in the long run only.
TEST(Estimator, OfTwoMinimaTheOneThatLastsIsBelieved) {
  Sensor sensor(0.003, 12);
  Estimator sut;
  const Vector3d p(0, 0, 0.05);
  const Quaterniond truth(Eigen::AngleAxisd(0.4, Vector3d::UnitX())),
      flipped(Eigen::AngleAxisd(-0.4, Vector3d::UnitX()));
  for (int i = 0; i < 200; ++i) {
    Explanation right = sensor.explain(p, truth), wrong = sensor.explain(p, flipped);
    // At first, and later every third time, the wrong one explains the corners better; in the mean it does not.
    const bool is_flipped = i < 3 || i % 3 == 0;
    (is_flipped ? right : wrong).surprise = is_flipped ? 1.0 : 2.0;
    Sighting sighting{"tag", {right, wrong}};
    if (is_flipped) std::swap(sighting.explanations[0], sighting.explanations[1]);
    ASSERT_TRUE(sut.take(i * kFrame, {sighting}));
    if (i < 60) continue;
    const auto q = sut.at(i * kFrame).at(0).reading.orientation;
    EXPECT_LT(Quaterniond(q[0], q[1], q[2], q[3]).angularDistance(truth), 0.02);
  }
}

TEST(Estimator, TheSurerOfTwoSensorsCountsMore) {
  Sensor sure(0.001, 13), unsure(0.02, 14);
  Estimator sut;
  double squares = 0;
  for (int i = 0; i < 300; ++i) {
    const Vector3d truth(0.1 * std::sin(3 * i * kFrame), 0, 0.05);
    ASSERT_TRUE(sut.take(i * kFrame, {sure.see("can", truth)}));
    ASSERT_TRUE(sut.take(i * kFrame, {unsure.see("can", truth)}));
    if (i > 50) squares += std::pow(position(sut.at(i * kFrame).at(0)).x() - truth.x(), 2) / 249;
  }
  EXPECT_LT(std::sqrt(squares), 0.0012);
}

// As of a camera, whose pixels lie under the edges of a tag at rest in the same way each time.
TEST(Estimator, WhatIsTheSameEachTimeStaysDoubtful) {
  Sensor sensor(0.003, 17);
  Estimator averaged, doubtful;
  for (int i = 0; i < 100; ++i) {
    Sighting sighting = sensor.see("can", {0.1, 0, 0.05});
    ASSERT_TRUE(averaged.take(i * kFrame, {sighting}));
    sighting.steady = 0.5;
    ASSERT_TRUE(doubtful.take(i * kFrame, {sighting}));
  }
  const Estimate sure = averaged.at(99 * kFrame).at(0), sut = doubtful.at(99 * kFrame).at(0);
  EXPECT_EQ(sut.reading.position, sure.reading.position);
  EXPECT_NEAR(sut.covariance[0] - sure.covariance[0], 0.5 * 0.003 * 0.003, 1e-12);
}

TEST(Estimator, AWorldThatStandsStillMayBeMeasuredForEver) {
  Sensor sensor(0.005, 15);
  Estimator sut;
  for (int i = 0; i < 3000; ++i) ASSERT_TRUE(sut.take(1.0, {sensor.see("can", {0.1, 0, 0.05})}));
  EXPECT_NEAR(sut.at(1.0).at(0).reading.position[0], 0.1, 5e-4);
  // And goes on by a step in which it was moved.
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(sut.take(1.1, {sensor.see("can", {0.12, 0, 0.05})}));
  EXPECT_NEAR(sut.at(1.1).at(0).reading.position[0], 0.12, 0.01);
}

TEST(Estimator, WhatIsNoMeasurementIsRefusedAndTheRestTaken) {
  Sensor sensor(0.005, 16);
  const auto complaint = [&](const std::function<void(Explanation&)>& spoil) {
    Estimator sut;
    Sighting bad = sensor.see("bad", {0, 0, 0});
    spoil(bad.explanations[0]);
    for (int i = 0; i < 2; ++i) {
      const auto result = sut.take(0.0, {bad, sensor.see("good", {0, 0, 0})});
      if (result) return std::string("nothing");
      if (i == 0) continue;
      EXPECT_THAT(sut.at(0.0), SizeIs(1));
      return result.error().message;
    }
    return std::string();
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(complaint([](Explanation&) {}), "nothing");
  EXPECT_THAT(complaint([](Explanation& e) { e.X_WB.position[1] = kNan; }), HasSubstr("'bad': position"));
  EXPECT_THAT(complaint([](Explanation& e) { e.X_WB.orientation = {0, 0, 0, 0}; }), HasSubstr("'bad': orientation"));
  EXPECT_THAT(complaint([](Explanation& e) { e.covariance[14] = -1; }), HasSubstr("'bad': covariance"));
  EXPECT_THAT(complaint([](Explanation& e) { e.covariance[3] = kNan; }), HasSubstr("'bad': covariance"));
  Estimator sut;
  EXPECT_FALSE(sut.take(0.0, {{"empty", {}}}));
  EXPECT_FALSE(sut.take(kNan, {sensor.see("can", {0, 0, 0})}));
}

}  // namespace
}  // namespace jostle::perception
