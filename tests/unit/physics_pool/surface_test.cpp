// What objects stand on.

#include "physics_pool/scene/surface.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace jostle::physics_pool {
namespace {

// An L: a bar along x from (-0.3, -0.1) to (0.3, 0.1), and one along y on its right end, up to y = 0.5.
const Surface kL{{{.size = {0.6, 0.2}}, {.x = 0.2, .y = 0.3, .size = {0.2, 0.4}}}};

TEST(Rectangle, ContainsWhatIsAtLeastTheMarginFromItsSides) {
  const Rectangle sut{.x = 1, .y = -1, .size = {0.4, 0.2}};
  EXPECT_TRUE(sut.contains(1.19, -0.91));
  EXPECT_FALSE(sut.contains(1.21, -1));
  EXPECT_FALSE(sut.contains(1, -0.89));
  EXPECT_TRUE(sut.contains(1.09, -1, 0.1));
  EXPECT_FALSE(sut.contains(1.11, -1, 0.1));
  EXPECT_FALSE(sut.contains(1, -1, 0.11));  // no such point
}

TEST(Surface, IsATableOfSixtyCentimetresByDefault) {
  EXPECT_EQ(Surface{}, Surface::table(0.6, 0.6));
  EXPECT_TRUE(Surface{}.carries(0.299, -0.299));
  EXPECT_FALSE(Surface{}.carries(0.301, 0));
}

TEST(Surface, CarriesWhatIsOnAnyPart) {
  EXPECT_TRUE(kL.carries(-0.29, 0.09));
  EXPECT_TRUE(kL.carries(0.29, 0.49));
  EXPECT_TRUE(kL.carries(0.2, 0.1));  // on the seam
  EXPECT_FALSE(kL.carries(0.09, 0.11));
  EXPECT_FALSE(kL.carries(0.2, 0.51));
  EXPECT_FALSE(kL.carries(-0.31, 0));
}

TEST(Surface, HasNoBorderWhereTwoPartsMeet) {
  EXPECT_TRUE(kL.contains(0.2, 0.1, 0.05));
  EXPECT_TRUE(kL.contains(0.2, 0.08, 0.05));
  EXPECT_TRUE(kL.contains(0.2, 0.12, 0.05));
  EXPECT_TRUE(kL.contains(0.25, 0.1, 0.05));
}

TEST(Surface, HasABorderEverywhereElse) {
  EXPECT_FALSE(kL.contains(0.26, 0.1, 0.05));   // 4 cm from the right side, on the seam
  EXPECT_FALSE(kL.contains(0.14, 0.12, 0.05));  // 4 cm from the left side of the upright bar
  EXPECT_FALSE(kL.contains(0.0, 0.06, 0.05));   // 4 cm from the upper side of the level one
  EXPECT_FALSE(kL.contains(0.12, 0.08, 0.05));  // near the inner corner
  EXPECT_TRUE(kL.contains(0.0, 0.04, 0.05));
  EXPECT_FALSE(kL.contains(0.0, 0.2, 0.05));  // outside
}

TEST(Surface, ContainsWithoutMarginWhatItCarries) {
  EXPECT_TRUE(kL.contains(0.2, 0.3, 0));
  EXPECT_FALSE(kL.contains(0.0, 0.2, 0));
  EXPECT_FALSE(kL.contains(9.0, 9.0, 0));
}

// Of a square around a point every piece of one centimetre must be carried. All sides are at whole centimetres, so
// the middles of pieces decide without rounding.
bool is_covered(const Surface& surface, int x_cm, int y_cm, int margin_cm) {
  for (int i = x_cm - margin_cm; i < x_cm + margin_cm; ++i) {
    for (int j = y_cm - margin_cm; j < y_cm + margin_cm; ++j) {
      if (!surface.carries(0.01 * (i + 0.5), 0.01 * (j + 0.5))) return false;
    }
  }
  return true;
}

class SurfaceOfParts : public testing::TestWithParam<std::pair<std::string, Surface>> {
 protected:
  const Surface& sut = GetParam().second;
};

TEST_P(SurfaceOfParts, ContainsWhatItsPartsCoverTogether) {
  for (int x = -42; x <= 42; x += 3) {
    for (int y = -42; y <= 62; y += 3) {
      for (const int margin : {1, 4, 11}) {
        // A hair's breadth inside, as sides of squares and parts fall together.
        EXPECT_EQ(sut.contains(0.01 * x, 0.01 * y, 0.01 * margin - 1e-7), is_covered(sut, x, y, margin))
            << "at (" << x << ", " << y << ") cm with " << margin << " cm";
      }
    }
  }
}

TEST_P(SurfaceOfParts, DoesNotDependOnTheOrderOfTheParts) {
  Surface reversed = sut;
  std::ranges::reverse(reversed.parts);
  for (int x = -42; x <= 42; ++x) {
    for (int y = -42; y <= 62; ++y) {
      const double px = 0.01 * x + 0.003, py = 0.01 * y + 0.003;
      EXPECT_EQ(reversed.carries(px, py), sut.carries(px, py));
      EXPECT_EQ(reversed.contains(px, py, 0.04), sut.contains(px, py, 0.04));
    }
  }
}

TEST_P(SurfaceOfParts, IsWithinItsBounds) {
  const Rectangle bounds = sut.bounds();
  double low_x = 1, high_x = -1, low_y = 1, high_y = -1;
  for (int x = -50; x < 50; ++x) {
    for (int y = -50; y < 70; ++y) {
      const double px = 0.01 * (x + 0.5), py = 0.01 * (y + 0.5);
      if (!sut.carries(px, py)) continue;
      low_x = std::min(low_x, px), high_x = std::max(high_x, px);
      low_y = std::min(low_y, py), high_y = std::max(high_y, py);
    }
  }
  EXPECT_NEAR(bounds.low_x(), low_x - 0.005, 1e-9);
  EXPECT_NEAR(bounds.high_x(), high_x + 0.005, 1e-9);
  EXPECT_NEAR(bounds.low_y(), low_y - 0.005, 1e-9);
  EXPECT_NEAR(bounds.high_y(), high_y + 0.005, 1e-9);
}

const std::vector<std::pair<std::string, Surface>> kShapes{
    {"Table", Surface{}},
    {"L", kL},
    // A table that narrows to a strip, and widens again.
    {"Strip", {{{.x = -0.3, .size = {0.2, 0.6}}, {.size = {0.4, 0.12}}, {.x = 0.3, .size = {0.2, 0.3}}}}},
    // A frame around a hole, its parts meeting like bricks.
    {"Frame",
     {{{.x = -0.05, .y = -0.25, .size = {0.5, 0.1}},
       {.x = 0.25, .y = -0.05, .size = {0.1, 0.5}},
       {.x = 0.05, .y = 0.25, .size = {0.5, 0.1}},
       {.x = -0.25, .y = 0.05, .size = {0.1, 0.5}}}}},
    // Two that do not touch.
    {"Apart", {{{.x = -0.2, .size = {0.2, 0.2}}, {.x = 0.2, .size = {0.2, 0.2}}}}},
};

INSTANTIATE_TEST_SUITE_P(Shapes, SurfaceOfParts, testing::ValuesIn(kShapes),
                         [](const auto& param) { return param.param.first; });

// Sides are computed from centres and sizes: parts that meet may be 1e-17 m apart.
TEST(Surface, HasNoBorderInAGapOfRounding) {
  int gaps = 0, borders = 0;
  for (int i = 1; i <= 60; ++i) {
    for (int k = 1; k <= 60; ++k) {
      const double seam = 0.01 * i, width = 0.01 * (k + 20);
      const Surface sut{{{.x = seam - 0.15, .size = {0.3, 0.4}}, {.x = seam + width / 2, .size = {width, 0.4}}}};
      if (sut.parts[0].high_x() < sut.parts[1].low_x()) ++gaps;
      if (!sut.contains(seam + 0.01, 0, 0.05)) ++borders;
    }
  }
  EXPECT_EQ(borders, 0);
  EXPECT_GT(gaps, 0);  // or this shows nothing
}

}  // namespace
}  // namespace jostle::physics_pool
