// Words, keys and the line of a playback.

#include <gmock/gmock.h>

#include "services/bags/playback/control.hpp"
#include "services/bags/playback/progress.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace bags;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Optional;

TEST(ParseControl, TakesWordsAndNumbers) {
  EXPECT_EQ(taken(parse_control("pause")), Control{"pause"});
  EXPECT_EQ(taken(parse_control("seek:12.5")), (Control{"seek", 12.5}));
  EXPECT_EQ(taken(parse_control("rate:2")), (Control{"rate", 2.0}));
  for (const char* text : {"", "jump", "seek", "seek:", "seek:x", "seek:1s", "pause:1", "rate"}) {
    const auto result = parse_control(text);
    ASSERT_FALSE(result) << text;
    EXPECT_THAT(result.error().message, HasSubstr("wanted pause, resume")) << text;
  }
}

std::vector<KeyPress> pressed(std::string_view bytes) { return KeyDecoder().feed(bytes); }

TEST(KeyDecoder, KnowsLettersAndArrows) {
  EXPECT_THAT(pressed(" s+"),
              ElementsAre(KeyPress{Key::kSpace}, KeyPress{Key::kOther, 's'}, KeyPress{Key::kOther, '+'}));
  EXPECT_THAT(pressed("\033[C\033[D\033OA\033[B"),
              ElementsAre(KeyPress{Key::kRight}, KeyPress{Key::kLeft}, KeyPress{Key::kUp}, KeyPress{Key::kDown}));
}

TEST(KeyDecoder, PassesOverWhatItDoesNotKnow) {
  EXPECT_THAT(pressed("\033[1;5C\033[15~\033Zq"), ElementsAre(KeyPress{Key::kOther, 'q'}));
}

TEST(KeyDecoder, JoinsSequencesAndForgetsALoneEscape) {
  KeyDecoder sut;
  EXPECT_THAT(sut.feed("\033"), IsEmpty());
  EXPECT_THAT(sut.feed("[C"), ElementsAre(KeyPress{Key::kRight}));
  EXPECT_THAT(sut.feed("\033"), IsEmpty());
  EXPECT_THAT(sut.feed("q"), ElementsAre(KeyPress{Key::kOther, 'q'}));
}

class Silent : public Playback::Sink {
  void on_message(const Message&, TimePoint) override {}
  void on_moment(const std::vector<Message>&) override {}
};

class ControlTest : public ::testing::Test {
 protected:
  ControlTest() {
    auto writer = taken(BagWriter::create(folder.path() / "bag", {}));
    taken(writer->add_topic(string_topic("/a")));
    const auto data = cdr_of("a");
    for (const Time time : {0, 50}) taken(writer->write(0, {.log_time = time * 1'000'000'000, .data = data}));
    taken(writer->close());
    sut = taken(Playback::create(taken(BagReader::open(folder.path() / "bag")), {.paused = true, .topics = {0}}, sink));
  }

  // Presses a key, and does what it means.
  std::optional<Control> press(std::string_view bytes) {
    const auto control = control_of(pressed(bytes).front(), *sut, now);
    if (control) taken(apply(*control, *sut, now));
    return control;
  }
  double at() const { return std::chrono::duration<double>(sut->at(now)).count(); }

  TempFolder folder;
  Silent sink;
  std::unique_ptr<Playback> sut;
  const TimePoint now{1s};
};

TEST_F(ControlTest, KeysSeekAndStayWithinTheBag) {
  EXPECT_THAT(press("\033[C"), Optional(Control{"seek", 5.0}));
  press("\033[C");
  EXPECT_EQ(at(), 10.0);
  for (int i = 0; i < 3; ++i) press("\033[D");
  EXPECT_EQ(at(), 0.0);
  press("7");
  EXPECT_EQ(at(), 35.0);
  press("0");
  EXPECT_EQ(at(), 0.0);
}

TEST_F(ControlTest, KeysChangeRateLoopAndPause) {
  press("+");
  EXPECT_EQ(sut->rate(), 2.0);
  for (int i = 0; i < 9; ++i) press("+");
  EXPECT_EQ(sut->rate(), 100.0);
  press("-");
  EXPECT_EQ(sut->rate(), 50.0);
  taken(sut->set_rate(3.0, now));
  press("-");
  EXPECT_EQ(sut->rate(), 2.0);
  press("l");
  EXPECT_TRUE(sut->loops());
  press("l");
  EXPECT_FALSE(sut->loops());
  press(" ");
  EXPECT_FALSE(sut->paused());
  press(" ");
  EXPECT_TRUE(sut->paused());
  EXPECT_EQ(press("x"), std::nullopt);
}

TEST_F(ControlTest, RefusesWhatItCannotDo) {
  EXPECT_FALSE(apply({"rate", 0.0}, *sut, now));
  EXPECT_FALSE(apply({"seek", std::numeric_limits<double>::quiet_NaN()}, *sut, now));
  EXPECT_FALSE(apply({"explode"}, *sut, now));
  EXPECT_TRUE(apply({"seek", 1e300}, *sut, now));
  EXPECT_EQ(at(), 50.0);
}

TEST(ProgressLine, ShowsBarTimeRateStateAndTheBusiestTopics) {
  const Progress progress{.state = "playing",
                          .time = 15.0,
                          .start = 10.0,
                          .end = 20.0,
                          .rate = 0.5,
                          .loop = true,
                          .topics = {{"/quiet", 0.0}, {"/slow", 10.0}, {"/fast", 100.0}}};
  EXPECT_EQ(progress_line(progress, 200),
            "[============>           ]  15.0/20.0 s  x0.5  playing  loop  110/s  /fast 100  /slow 10");
  EXPECT_THAT(progress_line(progress, 78), testing::EndsWith("110/s  /fast 100"));
}

}  // namespace
}  // namespace jostle::tests
