#include "services/common/results/journal.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Key;
using ::testing::Pair;

class JournalTest : public ::testing::Test {
 protected:
  std::unique_ptr<Journal> opened(const json& from) const {
    auto journal_result = Journal::open(file, from);
    if (!journal_result) throw std::runtime_error(journal_result.error().message);
    return std::move(journal_result).value();
  }
  std::unique_ptr<Journal> opened() const { return opened(origin); }

  const tests::TempFolder folder;
  const std::filesystem::path file = folder.path() / "x.json.journal";
  const json origin{{"commit", "abc"}, {"settings", {{"timeout", 3}}}};
};

TEST_F(JournalTest, HasWhatWasAppended) {
  {
    const auto sut = opened();
    EXPECT_TRUE(sut->found().empty());
    ASSERT_TRUE(sut->append("seed 1", {{"cost", 0.1}}));
    ASSERT_TRUE(sut->append("seed 2", {{"cost", nullptr}}));
    ASSERT_TRUE(sut->append("seed 1", {{"cost", 1.0 / 3}}));
  }
  EXPECT_THAT(opened()->found(),
              ElementsAre(Pair("seed 1", json{{"cost", 1.0 / 3}}), Pair("seed 2", json{{"cost", nullptr}})));
}

// As far as a process comes that is killed: whole lines, and half of one.
TEST_F(JournalTest, LosesNoMoreThanTheLineThatWasBeingWritten) {
  ASSERT_TRUE(opened()->append("seed 1", 1));
  const std::string whole = tests::contents(file);
  for (const std::string rest : {"{\"key\": \"seed 2\", \"par", "{", "{\"key\": \"seed 2\", \"part\": 2}"}) {
    folder.write("x.json.journal", whole + rest);
    {
      const auto sut = opened();
      EXPECT_THAT(sut->found(), ElementsAre(Key("seed 1")));
      ASSERT_TRUE(sut->append("seed 3", 3));
    }
    EXPECT_THAT(opened()->found(), ElementsAre(Key("seed 1"), Key("seed 3")));
  }
}

TEST_F(JournalTest, IsOnTheDiskWhenAppendReturns) {
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto sut = Journal::open(file, origin);
    if (!sut || !(*sut)->append("seed 1", 1)) _exit(1);
    if (write(ready[1], "r", 1) != 1) _exit(1);
    for (;;) pause();
  }
  close(ready[1]);  // so that a child that ends is noticed
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(ready[0]);
  EXPECT_THAT(opened()->found(), ElementsAre(Key("seed 1")));
}

TEST_F(JournalTest, RefusesPartsOfAnotherOriginAndSaysTheDifference) {
  ASSERT_TRUE(opened()->append("seed 1", 1));
  const auto refused = Journal::open(file, {{"commit", "abc"}, {"settings", {{"timeout", 5}}}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Code::kInvalidArgument);
  EXPECT_THAT(refused.error().message, HasSubstr("settings.timeout: got 3, wanted 5"));
  EXPECT_THAT(Journal::open(file, {{"settings", {{"timeout", 3}}}}).error().message,
              HasSubstr("commit: got \"abc\", wanted null"));
  EXPECT_THAT(opened()->found(), ElementsAre(Key("seed 1")));  // and leaves it as it is
}

TEST_F(JournalTest, RefusesWhatIsNoJournal) {
  folder.write("x.json.journal", "{\"title\": \"a result\"}\n");
  EXPECT_THAT(Journal::open(file, origin).error().message, HasSubstr("no journal"));
  EXPECT_EQ(Journal::open(folder.path(), origin).error().code, Code::kIo);
}

TEST_F(JournalTest, DoesADamagedPartAgain) {
  {
    const auto sut = opened();
    ASSERT_TRUE(sut->append("seed 1", 1));
    ASSERT_TRUE(sut->append("seed 2", 2));
  }
  std::string text = tests::contents(file);
  text[text.find("{\"key\":\"seed 1")] = '#';
  folder.write("x.json.journal", text);
  EXPECT_THAT(opened()->found(), ElementsAre(Key("seed 2")));
}

TEST_F(JournalTest, HasOneWriterAtATime) {
  const auto first = opened();
  const auto second = Journal::open(file, origin);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Code::kUnavailable);
}

TEST_F(JournalTest, TakesTextThatIsNoUtf8) {
  ASSERT_TRUE(opened()->append("seed 1", "\xff"));
  EXPECT_THAT(opened()->found(), ElementsAre(Key("seed 1")));
}

TEST_F(JournalTest, IsGoneOnceItIsRemoved) {
  opened()->remove();
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace jostle::common
