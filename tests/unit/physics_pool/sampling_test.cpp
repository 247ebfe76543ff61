#include "physics_pool/sampling/counter_rng.hpp"

#include <gtest/gtest.h>

#include <Random123/philox.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "physics_pool/api/rollout.hpp"

namespace jostle::physics_pool {
namespace {

struct Moments {
  double mean = 0.0, variance = 0.0, skewness = 0.0, kurtosis = 0.0;
};

Moments moments(const std::vector<double>& values) {
  Moments m;
  const double n = static_cast<double>(values.size());
  for (const double value : values) m.mean += value / n;
  for (const double value : values) {
    const double d = value - m.mean;
    m.variance += d * d / n;
    m.skewness += d * d * d / n;
    m.kurtosis += d * d * d * d / n;
  }
  m.skewness /= std::pow(m.variance, 1.5);
  m.kurtosis /= m.variance * m.variance;
  return m;
}

// Standard errors of the moments of n normal draws: 1/sqrt(n), sqrt(2/n),
// sqrt(6/n), sqrt(24/n).
void expect_standard_normal(const std::vector<double>& values) {
  const double n = static_cast<double>(values.size());
  const Moments m = moments(values);
  EXPECT_NEAR(m.mean, 0.0, 5 * std::sqrt(1 / n));
  EXPECT_NEAR(m.variance, 1.0, 5 * std::sqrt(2 / n));
  EXPECT_NEAR(m.skewness, 0.0, 5 * std::sqrt(6 / n));
  EXPECT_NEAR(m.kurtosis, 3.0, 5 * std::sqrt(24 / n));
}

constexpr std::uint32_t kDraws = 100'000;

// One axis of the index runs, the others stand still.
class StandardNormalAlong : public testing::TestWithParam<int> {
 protected:
  static DrawIndex index(std::uint32_t i) {
    DrawIndex result{.stream = 3, .sample = 5, .step = 7, .axis = 1};
    const std::array fields{&result.stream, &result.sample, &result.step, &result.axis};
    *fields[static_cast<std::size_t>(GetParam())] = i;
    return result;
  }
};

TEST_P(StandardNormalAlong, HasTheMomentsOfANormal) {
  std::vector<double> draws;
  for (std::uint32_t i = 0; i < kDraws; ++i) draws.push_back(standard_normal(11, index(i)));
  expect_standard_normal(draws);
}

TEST_P(StandardNormalAlong, IsUncorrelatedBetweenNeighbours) {
  double sum = 0.0;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    sum += standard_normal(11, index(i)) * standard_normal(11, index(i + 1));
  }
  EXPECT_NEAR(sum / kDraws, 0.0, 5 / std::sqrt(double(kDraws)));
}

TEST_P(StandardNormalAlong, NeverRepeatsADraw) {
  std::set<double> seen;
  for (std::uint32_t i = 0; i < 10'000; ++i) seen.insert(standard_normal(11, index(i)));
  EXPECT_EQ(seen.size(), 10'000u);
}

std::string axis_name(const testing::TestParamInfo<int>& axis) {
  static constexpr std::array kNames{"Stream", "Sample", "Step", "Axis"};
  return kNames[static_cast<std::size_t>(axis.param)];
}

INSTANTIATE_TEST_SUITE_P(EveryAxis, StandardNormalAlong, testing::Range(0, 4), axis_name);

TEST(StandardNormal, HasTheMomentsOfANormalOverSeeds) {
  std::vector<double> draws;
  for (std::uint64_t seed = 0; seed < kDraws; ++seed) {
    draws.push_back(standard_normal(seed, {.stream = 1, .sample = 2, .step = 3, .axis = 0}));
  }
  expect_standard_normal(draws);
}

TEST(StandardNormal, UsesAll64BitsOfTheSeed) {
  const DrawIndex index{.sample = 1};
  EXPECT_NE(standard_normal(1, index), standard_normal(1 + (1ull << 32), index));
}

TEST(StandardNormal, IsAPureFunctionOfItsIndex) {
  const DrawIndex index{.stream = 9, .sample = 8, .step = 7, .axis = 6};
  const double first = standard_normal(5, index);
  for (std::uint32_t i = 0; i < 100; ++i) (void)standard_normal(i, {.sample = i});
  EXPECT_EQ(standard_normal(5, index), first);
}

TEST(StandardNormal, IsFiniteInTheCornersOfItsIndex) {
  constexpr std::uint32_t kMost = UINT32_MAX;
  for (const std::uint64_t seed : {std::uint64_t{0}, UINT64_MAX}) {
    for (const std::uint32_t corner : {0u, kMost}) {
      EXPECT_TRUE(std::isfinite(standard_normal(seed, {corner, corner, corner, corner})));
    }
  }
}

TEST(StandardUniform, StaysInsideTheOpenIntervalWithMeanHalf) {
  double sum = 0.0, square = 0.0, least = 1.0, most = 0.0;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    const double u = standard_uniform(2, {.sample = i});
    least = std::min(least, u);
    most = std::max(most, u);
    sum += u;
    square += u * u;
  }
  EXPECT_GT(least, 0.0);
  EXPECT_LT(most, 1.0);
  EXPECT_LT(least, 1e-3);
  EXPECT_GT(most, 1 - 1e-3);
  // Variance of u is 1/12, of u^2 is 4/45.
  EXPECT_NEAR(sum / kDraws, 0.5, 5 * std::sqrt(1.0 / 12 / kDraws));
  EXPECT_NEAR(square / kDraws, 1.0 / 3, 5 * std::sqrt(4.0 / 45 / kDraws));
}

// Philox4x32-10, from the file kat_vectors of Random123: counter, key, output.
struct KnownAnswer {
  std::array<std::uint32_t, 4> counter;
  std::array<std::uint32_t, 2> key;
  std::array<std::uint32_t, 4> output;
};
constexpr std::array<KnownAnswer, 3> kKnownAnswers{{
    {{0, 0, 0, 0}, {0, 0}, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
    {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
     {0xffffffff, 0xffffffff},
     {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
    {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
     {0xa4093822, 0x299f31d0},
     {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
}};

TEST(Philox, GivesItsKnownAnswers) {
  for (const KnownAnswer& known : kKnownAnswers) {
    const auto output = r123::Philox4x32{}({{known.counter[0], known.counter[1], known.counter[2], known.counter[3]}},
                                           {{known.key[0], known.key[1]}});
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(output[i], known.output[i]);
  }
}

// The index is the counter, the seed the key, low word first; the first 64 bits
// become (k + 1/2) / 2^64.
TEST(StandardUniform, IsPhiloxOfSeedAndIndex) {
  for (const KnownAnswer& known : kKnownAnswers) {
    const std::uint64_t seed = (std::uint64_t{known.key[1]} << 32) | known.key[0];
    const double wanted = std::ldexp(double(known.output[0]), -32) + std::ldexp(double(known.output[1]) + 0.5, -64);
    EXPECT_DOUBLE_EQ(standard_uniform(seed, {known.counter[0], known.counter[1], known.counter[2], known.counter[3]}),
                     wanted);
  }
}

TEST(CounterStream, RepeatsForEqualSeedAndStream) {
  CounterStream a(1, 2), b(1, 2);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.normal(0, 1), b.normal(0, 1));
}

TEST(CounterStream, DiffersBetweenSeedsAndStreams) {
  CounterStream a(1, 2), seed(2, 2), stream(1, 3);
  const double first = a.uniform(0, 1);
  EXPECT_NE(first, seed.uniform(0, 1));
  EXPECT_NE(first, stream.uniform(0, 1));
}

TEST(CounterStream, ScalesAndShifts) {
  CounterStream sut(4, 0), raw(4, 0);
  for (int i = 0; i < 100; ++i) {
    EXPECT_DOUBLE_EQ(sut.uniform(-2, 6), -2 + 8 * raw.uniform(0, 1));
    EXPECT_DOUBLE_EQ(sut.normal(3, 0.5), 3 + 0.5 * raw.normal(0, 1));
  }
}

TEST(CounterStream, TossesAFairCoin) {
  CounterStream sut(8, 1);
  int heads = 0;
  for (std::uint32_t i = 0; i < kDraws; ++i) heads += sut.coin() ? 1 : 0;
  EXPECT_NEAR(heads, kDraws / 2.0, 5 * std::sqrt(kDraws / 4.0));
}

SamplingLaw law() { return {.sigma = {0.1, 0.2, 0.0}, .limit = {100, 100, 100}, .seed = 77, .stream = 3}; }

TEST(SampleControls, AddsTheNoiseOfEveryIndex) {
  const ControlSequence nominal{.nu = 3, .values = {1, 2, 3, 4, 5, 6}};
  const ControlSequence sample = sample_controls(nominal, law(), 9);
  for (std::uint32_t t = 0; t < 2; ++t) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      const double z = standard_normal(77, {.stream = 3, .sample = 9, .step = t, .axis = i});
      EXPECT_EQ(sample.step(int(t))[i], nominal.step(int(t))[i] + law().sigma[i] * z);
    }
  }
}

TEST(SampleControls, ClampsToTheLimits) {
  SamplingLaw narrow = law();
  narrow.limit = {0.01, 0.02, 0.5};
  const ControlSequence nominal{.nu = 3, .values = {1, -2, 3}};
  EXPECT_EQ(sample_controls(nominal, narrow, 0).values, (std::vector<double>{0.01, -0.02, 0.5}));
}

TEST(SampleControls, GivesTheNominalControlsWhenSigmaIsZero) {
  SamplingLaw quiet = law();
  quiet.sigma = {0, 0, 0};
  const ControlSequence nominal{.nu = 3, .values = {1, -2, 3}};
  EXPECT_EQ(sample_controls(nominal, quiet, 12), nominal);
}

TEST(SampleControls, DoesNotDependOnTheNumberOfStepsThatFollow) {
  const ControlSequence two{.nu = 3, .values = {1, 2, 3, 4, 5, 6}};
  ControlSequence one = two;
  one.truncate(1);
  ControlSequence sample = sample_controls(two, law(), 1);
  sample.truncate(1);
  EXPECT_EQ(sample_controls(one, law(), 1), sample);
}

TEST(SampleControls, TakesARowOfSigmaPerStep) {
  SamplingLaw rows = law();
  rows.sigma = {0.1, 0.2, 0.0, 0.3, 0.0, 0.4};
  const ControlSequence nominal{.nu = 3, .values = {0, 0, 0, 0, 0, 0}};
  const ControlSequence sample = sample_controls(nominal, rows, 9);
  for (std::uint32_t t = 0; t < 2; ++t) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      const double z = standard_normal(77, {.stream = 3, .sample = 9, .step = t, .axis = i});
      EXPECT_EQ(sample.step(int(t))[i], rows.sigma[3 * t + i] * z);
    }
  }
}

TEST(SampleControls, DrawsStandForSamplesOfALargerBatch) {
  SamplingLaw picked = law();
  picked.scales = {1.0, 0.5, 0.25};
  const SamplingLaw all = picked;
  picked.draws = {4, 17};
  const ControlSequence nominal{.nu = 3, .values = {1, 2, 3, 4, 5, 6}};
  EXPECT_EQ(sample_controls(nominal, picked, 0), sample_controls(nominal, all, 4));
  EXPECT_EQ(sample_controls(nominal, picked, 1), sample_controls(nominal, all, 17));
}

// e[t] = p e[t-1] + sqrt(1-p^2) z keeps variance 1 and correlates neighbours by p.
TEST(SampleControls, PersistentNoiseKeepsItsVarianceAndCorrelatesNeighbours) {
  SamplingLaw persistent{.sigma = {1.0}, .limit = {1e9}, .seed = 5, .persistence = 0.6};
  const ControlSequence nominal{.nu = 1, .values = std::vector<double>(4, 0.0)};
  constexpr int kSamples = 20000;
  double variance = 0.0, product = 0.0;
  for (std::uint32_t k = 0; k < kSamples; ++k) {
    const ControlSequence noise = sample_controls(nominal, persistent, k);
    variance += noise.values[3] * noise.values[3];
    product += noise.values[2] * noise.values[3];
  }
  EXPECT_NEAR(variance / kSamples, 1.0, 0.05);  // 5 sigma: sqrt(2/20000) = 0.01
  EXPECT_NEAR(product / kSamples, 0.6, 0.05);
}

}  // namespace
}  // namespace jostle::physics_pool
