#include "services/common/lab/cable.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace jostle::common {
namespace {

std::vector<bool> fates(const LinkQuality& quality, std::uint64_t direction, int frames) {
  Losses sut(quality, direction);
  std::vector<bool> lost;
  for (int i = 0; i < frames; ++i) lost.push_back(sut.next());
  return lost;
}

TEST(Losses, AreAsFrequentAsAsked) {
  constexpr int kFrames = 100'000;
  constexpr double kLoss = 0.01;

  const auto lost = fates({.loss = kLoss}, 0, kFrames);

  const double deviation = std::sqrt(kFrames * kLoss * (1 - kLoss));  // binomial
  EXPECT_NEAR(static_cast<double>(std::ranges::count(lost, true)), kFrames * kLoss, 4 * deviation);
}

TEST(Losses, AreTheSameForTheSameSeedAndOthersForAnother) {
  EXPECT_EQ(fates({.loss = 0.5, .seed = 3}, 1, 1000), fates({.loss = 0.5, .seed = 3}, 1, 1000));
  EXPECT_NE(fates({.loss = 0.5, .seed = 3}, 1, 1000), fates({.loss = 0.5, .seed = 4}, 1, 1000));
  EXPECT_NE(fates({.loss = 0.5, .seed = 3}, 1, 1000), fates({.loss = 0.5, .seed = 3}, 2, 1000));
}

TEST(Losses, AreNoneOrAllAtTheEnds) {
  EXPECT_EQ(fates({.loss = 0.0}, 0, 1000), std::vector<bool>(1000, false));
  EXPECT_EQ(fates({.loss = 1.0}, 0, 1000), std::vector<bool>(1000, true));
}

}  // namespace
}  // namespace jostle::common
