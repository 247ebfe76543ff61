// Playback on a clock of the test's own.

#include <gmock/gmock.h>

#include <fmt/format.h>

#include "services/bags/playback/lateness.hpp"
#include "services/bags/playback/playback.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using bags::Playback;
using bags::PlaybackOptions;
using bags::Timeline;
using std::chrono::nanoseconds;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr bags::Time kBegin = 1'700'000'000'000'000'000;
constexpr auto kPatience = 60s;

TimePoint at(nanoseconds time) { return TimePoint(1000s + time); }

// ---------------------------------------------------------------- timeline

TEST(Timeline, StandsUntilItRunsThenMapsBothWays) {
  Timeline sut(kBegin, 2.0);
  EXPECT_EQ(sut.at(at(5s)), kBegin);
  EXPECT_EQ(sut.when(kBegin + 1), TimePoint::max());
  sut.run(at(5s));
  EXPECT_EQ(sut.at(at(6s)), kBegin + 2'000'000'000);
  EXPECT_EQ(sut.when(kBegin + 3'000'000'000), at(6500ms));
  EXPECT_EQ(sut.when(kBegin - 2'000'000'000), at(4s));
}

TEST(Timeline, KeepsItsMomentWhenRateChangesAndWhileItStands) {
  Timeline sut(kBegin, 1.0);
  sut.run(at(0s));
  sut.set_rate(0.1, at(10s));
  EXPECT_EQ(sut.at(at(20s)), kBegin + 11'000'000'000);
  sut.stand(at(20s));
  EXPECT_EQ(sut.at(at(99s)), kBegin + 11'000'000'000);
  sut.run(at(100s));
  EXPECT_EQ(sut.at(at(110s)), kBegin + 12'000'000'000);
}

TEST(Timeline, HoldsMomentsAWorldAwayAtBay) {
  Timeline sut(0, 0.01);
  sut.run(at(0s));
  EXPECT_EQ(sut.when(std::numeric_limits<bags::Time>::max()), TimePoint::max());
}

// ---------------------------------------------------------------- lateness

TEST(Lateness, QuantilesAreTrueToTheBinAndTheWorstIsExact) {
  bags::Lateness sut;
  EXPECT_EQ(sut.quantile(0.5), 0ns);
  for (int i = 1; i <= 100; ++i) sut.add(i * 100us);
  sut.add(-3ms);  // early is not late
  EXPECT_NEAR(static_cast<double>(sut.quantile(0.5).count()), 5.0e6, 0.11e6);
  EXPECT_NEAR(static_cast<double>(sut.quantile(0.99).count()), 9.9e6, 0.2e6);
  EXPECT_EQ(sut.worst(), 10ms);
  EXPECT_EQ(sut.quantile(1.0), 10ms);
  sut.add(500s);
  EXPECT_EQ(sut.worst(), 500s);
  EXPECT_EQ(sut.count(), 102u);
}

// ---------------------------------------------------------------- playback

// What went out: "a0@0.25" is message a0 when the clock showed 0.25 s.
class Log : public Playback::Sink {
 public:
  void on_message(const bags::Message& message, TimePoint due) override {
    dues.push_back(due - at(0s));
    lines.push_back(fmt::format("{}@{:g}", text_of(message.data), std::chrono::duration<double>(now - at(0s)).count()));
  }
  void on_moment(const std::vector<bags::Message>& state) override {
    lines.push_back(fmt::format("[{}]", fmt::join(texts_of(state), " ")));
  }

  std::vector<std::string> taken() { return std::exchange(lines, {}); }

  TimePoint now = at(0s);
  std::vector<std::string> lines;
  std::vector<nanoseconds> dues;
};

class PlaybackTest : public ::testing::Test {
 protected:
  // a0 a1 a2 a3 at 0, 1, 2, 3 s; b0 at 0.5 s, b1 and b2 at 2 s.
  PlaybackTest() { write("bag", {{0, 0ms}, {1, 500ms}, {0, 1s}, {0, 2s}, {1, 2s}, {1, 2s}, {0, 3s}}); }

  void write(const std::string& name, const std::vector<std::pair<int, nanoseconds>>& messages) {
    auto writer = taken(bags::BagWriter::create(folder.path() / name, {}));
    const std::string names[] = {"a", "b"};
    for (const std::string& topic : names) taken(writer->add_topic(string_topic("/" + topic)));
    int counts[] = {0, 0};
    for (const auto& [topic, offset] : messages) {
      const auto data = cdr_of(names[topic] + std::to_string(counts[topic]++));
      const bags::Time time = kBegin + offset.count();
      taken(writer->write(topic, {.log_time = time, .publish_time = time, .data = data}));
    }
    taken(writer->close());
  }

  Result<std::unique_ptr<Playback>> create(PlaybackOptions options, const std::string& name = "bag") {
    if (options.topics.empty()) options.topics = {0, 1};
    return Playback::create(taken(bags::BagReader::open(folder.path() / name)), std::move(options), log);
  }
  void start(PlaybackOptions options = {}, const std::string& name = "bag") {
    sut = taken(create(std::move(options), name));
  }

  // Lets the clock run to `time`, from event to event.
  void go(nanoseconds time) {
    const TimePoint end = at(time);
    while (true) {
      const auto next_result = sut->advance(log.now);
      ASSERT_TRUE(next_result) << next_result.error().message;
      if (*next_result == TimePoint::max() && awaits_news()) {
        ASSERT_TRUE(sut->wait(std::chrono::steady_clock::now() + kPatience));
        continue;
      }
      if (*next_result > end) break;
      log.now = std::max(log.now, *next_result);
    }
    log.now = end;
  }

  bool awaits_news() const {
    return sut->state() == Playback::State::kSeeking || sut->state() == Playback::State::kPlaying;
  }

  void step() {
    sut->step(log.now);
    while (sut->state() == Playback::State::kSeeking) {
      ASSERT_TRUE(sut->wait(std::chrono::steady_clock::now() + kPatience));
      const auto next_result = sut->advance(log.now);
      ASSERT_TRUE(next_result) << next_result.error().message;
    }
  }

  TempFolder folder;
  Log log;
  std::unique_ptr<Playback> sut;
};

TEST_F(PlaybackTest, SendsEveryMessageAtItsTime) {
  start();
  go(10s);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@0.5", "a1@1", "a2@2", "b1@2", "b2@2", "a3@3"));
  EXPECT_EQ(sut->state(), Playback::State::kEnded);
  EXPECT_EQ(sut->passes(), 1);
  EXPECT_EQ(sut->at(log.now), 3s);
}

TEST_F(PlaybackTest, RatesStretchTheSpacingAndKeepTheOrder) {
  start({.rate = 0.1});
  go(30s);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@5", "a1@10", "a2@20", "b1@20", "b2@20", "a3@30"));
  log.now = at(0s);
  start({.rate = 10.0});
  go(300ms);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@0.05", "a1@0.1", "a2@0.2", "b1@0.2", "b2@0.2", "a3@0.3"));
}

TEST_F(PlaybackTest, RateChangesTakeEffectAtOnceAndOutsideOfItsRangeNone) {
  start();
  go(500ms);
  ASSERT_TRUE(sut->set_rate(0.5, log.now));
  go(10s);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@0.5", "a1@1.5", "a2@3.5", "b1@3.5", "b2@3.5", "a3@5.5"));
  for (const double rate : {0.0, -1.0, 1000.0, std::nan("")}) EXPECT_FALSE(sut->set_rate(rate, log.now)) << rate;
  EXPECT_EQ(sut->rate(), 0.5);
}

TEST_F(PlaybackTest, LateCallsDoNotShiftWhatFollows) {
  start();
  go(0s);
  log.now = at(1250ms);  // its caller was busy
  go(2s);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@1.25", "a1@1.25", "a2@2", "b1@2", "b2@2"));
  EXPECT_THAT(log.dues, ElementsAre(0s, 500ms, 1s, 2s, 2s, 2s));
}

TEST_F(PlaybackTest, PauseHoldsTheClockAndResumeGoesOn) {
  start();
  go(700ms);
  sut->pause(log.now);
  go(5s);
  EXPECT_EQ(sut->state(), Playback::State::kPaused);
  EXPECT_EQ(sut->at(log.now), 700ms);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@0.5"));
  sut->resume(log.now);
  go(5400ms);
  EXPECT_THAT(log.taken(), ElementsAre("a1@5.3"));
}

TEST_F(PlaybackTest, StepsGoMessageByMessageAlsoThroughEqualTimes) {
  start({.paused = true});
  go(1s);
  EXPECT_THAT(log.taken(), ElementsAre("[]"));
  for (int i = 0; i < 5; ++i) step();
  EXPECT_THAT(log.taken(), ElementsAre("a0@1", "b0@1", "a1@1", "a2@1", "b1@1"));
  EXPECT_EQ(sut->at(log.now), 2s);
  go(9s);
  EXPECT_THAT(log.taken(), IsEmpty());
  sut->resume(log.now);
  go(20s);
  EXPECT_THAT(log.taken(), ElementsAre("b2@9", "a3@10"));
  EXPECT_EQ(sut->state(), Playback::State::kEnded);
}

TEST_F(PlaybackTest, StepWhilePlayingPauses) {
  start();
  go(100ms);
  step();
  EXPECT_TRUE(sut->paused());
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@0.1"));
}

TEST_F(PlaybackTest, SeekTellsTheMomentThenGoesOn) {
  start({.state_topics = {0, 1}});
  go(100ms);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0"));
  sut->seek(1500ms);
  EXPECT_EQ(sut->state(), Playback::State::kSeeking);
  EXPECT_EQ(sut->at(log.now), 1500ms);
  go(600ms);
  EXPECT_THAT(log.taken(), ElementsAre("[b0 a1]", "a2@0.6", "b1@0.6", "b2@0.6"));
  sut->seek(600ms);
  go(1s);
  EXPECT_THAT(log.taken(), ElementsAre("[a0 b0]", "a1@1"));
}

TEST_F(PlaybackTest, SeekToAMessagesTimeSendsItOnceAndNotAsPartOfTheMoment) {
  start({.paused = true, .state_topics = {0}});
  go(0s);
  log.taken();
  sut->seek(2s);
  go(1s);
  EXPECT_THAT(log.taken(), ElementsAre("[a1]"));
  sut->resume(log.now);
  go(1s);
  EXPECT_THAT(log.taken(), ElementsAre("a2@1", "b1@1", "b2@1"));
}

TEST_F(PlaybackTest, SeeksBeyondEitherEndStopThere) {
  start({.start = 400ms, .duration = 2s, .paused = true});
  go(0s);
  sut->seek(nanoseconds::max());
  EXPECT_EQ(sut->at(log.now), 2400ms);
  sut->seek(nanoseconds::min());
  EXPECT_EQ(sut->at(log.now), 400ms);
}

TEST_F(PlaybackTest, StartOffsetAndDurationCutOutAPart) {
  start({.start = 500ms, .duration = 1500ms, .state_topics = {0, 1}});
  go(10s);
  EXPECT_THAT(log.taken(), ElementsAre("[a0]", "b0@0", "a1@0.5", "a2@1.5", "b1@1.5", "b2@1.5"));
  EXPECT_EQ(sut->state(), Playback::State::kEnded);
}

TEST_F(PlaybackTest, OnlyTopicsAskedForAreSentAndTimeStaysTheBags) {
  start({.topics = {1}, .state_topics = {1}});
  go(2500ms);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "b0@0.5", "b1@2", "b2@2"));
  EXPECT_EQ(sut->state(), Playback::State::kPlaying);
  go(3s);
  EXPECT_EQ(sut->state(), Playback::State::kEnded);
}

TEST_F(PlaybackTest, LoopsBeginAgainWithTheMomentOfTheStart) {
  start({.start = 2s, .loop = true, .state_topics = {0}});
  go(2500ms);
  EXPECT_THAT(log.taken(), ElementsAre("[a1]", "a2@0", "b1@0", "b2@0", "a3@1", "[a1]", "a2@1", "b1@1", "b2@1", "a3@2",
                                       "[a1]", "a2@2", "b1@2", "b2@2"));
  EXPECT_EQ(sut->passes(), 2);
  sut->set_loop(false);
  go(9s);
  EXPECT_THAT(log.taken(), ElementsAre("a3@3"));
}

TEST_F(PlaybackTest, ALoopedBagOfOneMessageDoesNotRace) {
  write("single", {{0, 0ms}});
  start({.rate = 100.0, .loop = true}, "single");
  go(250ms);
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "[]", "a0@0.1", "[]", "a0@0.2"));
}

TEST_F(PlaybackTest, ReadsOnWithLittleMemory) {
  start({.memory = 1});
  go(10s);
  EXPECT_EQ(log.taken().size(), 8u);
}

TEST_F(PlaybackTest, CommandsWhileSeekingCount) {
  start();
  sut->pause(log.now);
  sut->seek(1s);
  sut->seek(2500ms);
  go(1s);
  EXPECT_THAT(log.taken(), ElementsAre("[]"));
  EXPECT_EQ(sut->state(), Playback::State::kPaused);
  EXPECT_EQ(sut->at(log.now), 2500ms);
}

TEST_F(PlaybackTest, RefusesAnEmptyBagAndAStartBehindTheEnd) {
  write("empty", {});
  const auto empty = create({}, "empty");
  ASSERT_FALSE(empty);
  EXPECT_THAT(empty.error().message, AllOf(HasSubstr("empty: got no messages")));
  const auto behind = create({.start = 4s});
  ASSERT_FALSE(behind);
  EXPECT_THAT(behind.error().message, AllOf(HasSubstr("start at 4 s"), HasSubstr("at most 3 s")));
}

// A reader that fails after what it has.
class Damaged : public bags::BagReader {
 public:
  explicit Damaged(std::unique_ptr<bags::BagReader> whole) : whole_(std::move(whole)) {}
  const bags::BagInfo& info() const override { return whole_->info(); }
  std::vector<bags::Finding> findings() const override { return {}; }
  void seek(bags::Time from, std::vector<int> topics) override { whole_->seek(from, std::move(topics)); }
  Result<std::optional<bags::Message>> next() override {
    if (count_++ == 2) return Error{Code::kInvalidArgument, "byte 77: damaged"};
    return whole_->next();
  }
  Result<std::optional<bags::Message>> last_at(int topic, bags::Time time) override {
    return whole_->last_at(topic, time);
  }

 private:
  std::unique_ptr<bags::BagReader> whole_;
  int count_ = 0;
};

TEST_F(PlaybackTest, DamageIsReportedBehindWhatIsWhole) {
  auto reader = std::make_unique<Damaged>(taken(bags::BagReader::open(folder.path() / "bag")));
  sut = taken(Playback::create(std::move(reader), {.topics = {0, 1}}, log));
  Result<TimePoint> next_result = TimePoint{};
  while (next_result) {
    if (*next_result != TimePoint::max()) log.now = std::max(log.now, *next_result);
    ASSERT_TRUE(sut->wait(std::chrono::steady_clock::now() + kPatience));
    next_result = sut->advance(log.now);
  }
  EXPECT_THAT(next_result.error().message, HasSubstr("byte 77"));
  EXPECT_THAT(log.taken(), ElementsAre("[]", "a0@0", "b0@0.5"));
}

}  // namespace
}  // namespace jostle::tests
