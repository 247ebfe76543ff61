#include "services/common/charts/plot.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

Band made_up(const std::string& name, double rate) {
  Band band{.name = name};
  for (int i = 1; i <= 50; ++i) {
    const double y = std::exp(-rate * i);
    band.x.push_back(i);
    band.low.push_back(0.7 * y);
    band.middle.push_back(y);
    band.high.push_back(1.4 * y);
  }
  return band;
}

std::vector<Panel> made_up_panels() {
  Panel left{.x_label = "rollouts", .y_label = "it's \"cost\"", .log_y = true};
  for (int i = 0; i < 10; ++i) left.bands.push_back(made_up("rule_" + std::to_string(i), 0.01 * (i + 1)));
  left.bands[0].middle[7] = std::nan("");
  left.bands[0].high[9] = HUGE_VAL;
  Panel right = left;
  right.log_x = true;
  return {left, right};
}

// Big-endian, as a PNG has it.
unsigned word(const std::string& bytes, std::size_t at) {
  unsigned value = 0;
  for (std::size_t i = at; i < at + 4; ++i) value = 256 * value + static_cast<unsigned char>(bytes.at(i));
  return value;
}

class Path {
 public:
  explicit Path(const char* value) : before_(std::getenv("PATH")) { setenv("PATH", value, 1); }
  ~Path() { setenv("PATH", before_.c_str(), 1); }

 private:
  std::string before_;
};

TEST(Plot, DrawsAPng) {
  const tests::TempFolder folder;
  const auto png = folder.path() / "new folder" / "it's a plot.png";
  const auto drawn = plot(png, "Made-up curves, 100 % {of} $them", made_up_panels());
  ASSERT_TRUE(drawn) << drawn.error().message;
  const std::string bytes = tests::contents(png);
  ASSERT_GT(bytes.size(), 10'000u);
  EXPECT_EQ(bytes.substr(1, 3), "PNG");
  EXPECT_EQ(word(bytes, 16), 2 * 700u + 300u);  // two panels and the legend
  EXPECT_EQ(word(bytes, 20), 600u);
}

TEST(Plot, SaysWhatIsMissingWithoutGnuplot) {
  const Path empty("/nowhere");
  const auto drawn = plot("/tmp/never.png", "", made_up_panels());
  ASSERT_FALSE(drawn);
  EXPECT_EQ(drawn.error().code, Code::kUnavailable);
  EXPECT_THAT(drawn.error().message, testing::HasSubstr("gnuplot-nox"));
}

TEST(Plot, PassesGnuplotsWordsOn) {
  const tests::TempFolder folder;
  const auto drawn = plot(folder.path(), "a folder is no file", made_up_panels());
  ASSERT_FALSE(drawn);
  EXPECT_EQ(drawn.error().code, Code::kIo);
  EXPECT_THAT(drawn.error().message, testing::HasSubstr(folder.path().string()));
}

TEST(Plot, RefusesNothingAndBandsThatDisagree) {
  EXPECT_EQ(plot("/tmp/never.png", "", {}).error().code, Code::kInvalidArgument);
  EXPECT_EQ(plot("/tmp/never.png", "", {Panel{}}).error().code, Code::kInvalidArgument);
  std::vector<Panel> panels = made_up_panels();
  panels[1].bands[3].high.pop_back();
  const auto drawn = plot("/tmp/never.png", "", panels);
  ASSERT_FALSE(drawn);
  EXPECT_THAT(drawn.error().message, testing::HasSubstr("rule_3: got 50 x"));
}

}  // namespace
}  // namespace jostle::common
