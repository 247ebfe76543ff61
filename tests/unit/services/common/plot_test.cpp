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

TEST(Plot, DrawsWhatTheEndingSays) {
  const tests::TempFolder folder;
  std::filesystem::create_directory(folder.path() / "new folder");
  for (const auto& [ending, beginning] : {std::pair{".png", "\x89PNG"}, std::pair{".PNG", "\x89PNG"},
                                          std::pair{".svg", "<?xml"}, std::pair{".pdf", "%PDF"}}) {
    const auto picture = folder.path() / "new folder" / (std::string("it's a plot") + ending);
    const auto drawn = plot(picture, "Made-up curves, 100 % {of} $them", made_up_panels());
    ASSERT_TRUE(drawn) << drawn.error().message;
    const std::string bytes = tests::contents(picture);
    EXPECT_GT(bytes.size(), 5'000u) << ending;
    EXPECT_TRUE(bytes.starts_with(beginning)) << ending;
  }
}

TEST(Plot, IsAsWideAsItsPanelsAndItsLegend) {
  const tests::TempFolder folder;
  const auto width = [&](const std::vector<Panel>& panels) {
    const auto drawn = plot(folder.path() / "p.png", "", panels);
    EXPECT_TRUE(drawn) << drawn.error().message;
    return word(tests::contents(folder.path() / "p.png"), 16);
  };
  std::vector<Panel> panels = made_up_panels();
  const unsigned two = width(panels);
  panels[0].bands[0].name += std::string(20, 'x');
  EXPECT_GT(width(panels), two + 150);
  panels.pop_back();
  EXPECT_LT(width(panels), two);
}

TEST(Plot, OtherEndingsAreRefusedBeforeAnythingIsDrawn) {
  EXPECT_TRUE(check_picture("a/b.svg"));
  for (const char* name : {"/tmp/never.jpg", "/tmp/never", "/tmp/png"}) {
    const auto drawn = plot(name, "", made_up_panels());
    ASSERT_FALSE(drawn);
    EXPECT_EQ(drawn.error().code, Code::kInvalidArgument);
    EXPECT_EQ(drawn.error().message,
              std::string("picture: got '") + name + "', wanted a name that ends in .png, .svg or .pdf");
  }
}

// What stands in an SVG can be read.
std::string svg_of(const Panel& panel) {
  const tests::TempFolder folder;
  const auto drawn = plot(folder.path() / "p.svg", "title", {panel});
  EXPECT_TRUE(drawn) << drawn.error().message;
  return tests::contents(folder.path() / "p.svg");
}

TEST(Plot, CallsPlacesByTheirNames) {
  Panel panel{.y_label = "s", .names = {"coarse,kinematic x1", "it's fine"}};
  for (double i : {0.0, 1.0}) {
    panel.bands.push_back({.name = "band", .x = {i}, .low = {1.0}, .middle = {2.0}, .high = {3.0}});
  }
  const std::string svg = svg_of(panel);
  EXPECT_THAT(svg, testing::HasSubstr("kinematic x1"));
  EXPECT_THAT(svg, testing::HasSubstr("fine"));
  EXPECT_THAT(svg, testing::Not(testing::HasSubstr(">band<")));  // no legend
}

TEST(Plot, GivesZerosOfALogarithmicAxisAPlaceAndAName) {
  Panel panel{.x_label = "iteration", .y_label = "mm", .log_y = true, .counts_x = true, .zero = "exact"};
  panel.bands.push_back({.name = "band", .x = {0, 1, 2}, .low = {8, -1, 0}, .middle = {10, 1, 0}, .high = {12, 3, 0}});
  EXPECT_THAT(svg_of(panel), testing::HasSubstr("exact"));
}

TEST(Plot, SaysWhatIsMissingWithoutGnuplot) {
  const Path empty("/nowhere");
  const auto drawn = plot("/tmp/never.png", "", made_up_panels());
  ASSERT_FALSE(drawn);
  EXPECT_EQ(drawn.error().code, Code::kUnavailable);
  EXPECT_THAT(drawn.error().message, testing::HasSubstr("gnuplot-nox"));
}

TEST(Plot, NamesAFileThatCannotBeWritten) {
  const tests::TempFolder folder;
  std::filesystem::create_directory(folder.path() / "folder.png");
  const auto drawn = plot(folder.path() / "folder.png", "a folder is no file", made_up_panels());
  ASSERT_FALSE(drawn);
  EXPECT_EQ(drawn.error().code, Code::kIo);
  EXPECT_THAT(drawn.error().message, testing::HasSubstr("folder.png"));
}

TEST(RunGnuplot, PassesGnuplotsWordsOn) {
  const tests::TempFolder folder;
  const auto drawn = run_gnuplot(folder.path() / "p.png", 100, 100, "plot nonsense\n");
  ASSERT_FALSE(drawn);
  EXPECT_THAT(drawn.error().message, testing::HasSubstr("undefined variable: nonsense"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "p.png"));
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
