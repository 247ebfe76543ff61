#include "services/common/charts/lanes.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

using ::testing::HasSubstr;

LaneChart made_up(int lanes) {
  LaneChart chart{.title = "Made-up bars, 100 % of 'it'",
                  .x_label = "ms",
                  .series = {"one", "two", "none of it"},
                  .hatched = "copy, dropped",
                  .length = 100.0};
  for (int lane = 0; lane < lanes; ++lane) {
    chart.lanes.push_back("worker-" + std::to_string(lane));
    for (int i = 0; i < 10; ++i) {
      chart.bars.push_back({.lane = lane,
                            .series = i % 2,
                            .from = 10.0 * i + lane % 3,
                            .to = 10.0 * i + 9.0,
                            .hatched = i == lane % 10});
    }
  }
  return chart;
}

TEST(Lanes, DrawsPngSvgAndPdfByTheEnding) {
  const tests::TempFolder folder;
  for (const int lanes : {1, 5, 64}) {
    const auto png = folder.path() / "p.png", svg = folder.path() / "p.svg", pdf = folder.path() / "p.pdf";
    for (const auto& file : {png, svg, pdf}) {
      const auto drawn = draw(file, made_up(lanes));
      ASSERT_TRUE(drawn) << drawn.error().message;
    }
    EXPECT_EQ(tests::contents(png).substr(1, 3), "PNG");
    EXPECT_EQ(tests::contents(pdf).substr(1, 3), "PDF");
    EXPECT_THAT(tests::contents(svg), HasSubstr("<svg"));
    EXPECT_THAT(tests::contents(svg), HasSubstr("worker-" + std::to_string(lanes - 1)));
    EXPECT_THAT(tests::contents(svg), HasSubstr("none of it"));
  }
}

TEST(Lanes, OtherEndingsAreNamed) {
  const auto drawn = draw("/tmp/never.jpg", made_up(1));
  ASSERT_FALSE(drawn);
  EXPECT_EQ(drawn.error().code, Code::kInvalidArgument);
  EXPECT_EQ(drawn.error().message, "picture: got '/tmp/never.jpg', wanted a name that ends in .png, .svg or .pdf");
}

TEST(Lanes, RefusesWhatHasNoPlace) {
  const std::pair<const char*, std::function<void(LaneChart&)>> cases[] = {
      {"no lanes", [](LaneChart& chart) { chart.lanes.clear(); }},
      {"a length of 0", [](LaneChart& chart) { chart.length = 0.0; }},
      {"lane 9", [](LaneChart& chart) { chart.bars[3].lane = 9; }},
      {"series -1", [](LaneChart& chart) { chart.bars[3].series = -1; }},
      {"to nan", [](LaneChart& chart) { chart.bars[3].to = std::nan(""); }},
  };
  for (const auto& [what, spoil] : cases) {
    LaneChart chart = made_up(2);
    spoil(chart);
    const auto drawn = draw("/tmp/never.png", chart);
    ASSERT_FALSE(drawn) << what;
    EXPECT_THAT(drawn.error().message, HasSubstr(what));
  }
}

}  // namespace
}  // namespace jostle::common
