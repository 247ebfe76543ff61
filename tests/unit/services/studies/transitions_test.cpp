#include "services/studies/train_coarse/transitions.hpp"

#include <gmock/gmock.h>

#include "tests/support/temp_folder.hpp"

namespace jostle::studies {
namespace {

namespace fs = std::filesystem;

using testing::HasSubstr;

constexpr int kGroup = 4;

std::vector<Transition> some(int count, float first = 1.0f) {
  std::vector<Transition> transitions(static_cast<std::size_t>(count));
  for (Transition& transition : transitions) {
    transition.control[0] = first++;
    transition.sliders = 2;
  }
  return transitions;
}

class TransitionFileTest : public testing::Test {
 protected:
  void write(int count) {
    auto writer = TransitionWriter::open(file_, {}, kGroup);
    ASSERT_TRUE(writer) << writer.error().message;
    ASSERT_TRUE(writer->append(some(count)));
  }

  tests::TempFolder folder_;
  fs::path file_ = folder_.path() / "a.dat";
};

TEST_F(TransitionFileTest, ComesBack) {
  write(8);
  const auto sut = read_transitions(file_);
  ASSERT_TRUE(sut) << sut.error().message;
  EXPECT_EQ(sut->origin, DataOrigin{});
  EXPECT_EQ(sut->transitions, some(8));
}

TEST_F(TransitionFileTest, ForgetsARecordThatWasCutOff) {
  write(8);
  fs::resize_file(file_, fs::file_size(file_) - 3);
  EXPECT_EQ(read_transitions(file_)->transitions, some(7));
}

TEST_F(TransitionFileTest, GoesOnAfterTheLastCompleteGroup) {
  write(8);
  const std::string whole = tests::contents(file_);
  fs::resize_file(file_, fs::file_size(file_) - 3);
  auto sut = TransitionWriter::open(file_, {}, kGroup);
  ASSERT_TRUE(sut);
  EXPECT_EQ(sut->size(), 4u);
  ASSERT_TRUE(sut->append(some(4, 5.0f)));
  EXPECT_EQ(tests::contents(file_), whole);
}

TEST_F(TransitionFileTest, OfAnotherOriginIsNotContinued) {
  write(4);
  const auto other_seed = TransitionWriter::open(file_, {.seed = 2}, kGroup);
  ASSERT_FALSE(other_seed);
  EXPECT_THAT(other_seed.error().message, HasSubstr("a.dat: seed: the file has 1, this run 2"));
  const auto other_radius = TransitionWriter::open(file_, {.slider_radius = 0.04}, kGroup);
  ASSERT_FALSE(other_radius);
  EXPECT_THAT(other_radius.error().message, HasSubstr("slider radius: the file has 0.05115, this run 0.04"));
}

TEST_F(TransitionFileTest, OfAnotherKindIsRefused) {
  folder_.write("a.dat", std::string(200, 'x'));
  for (const Error& error : {read_transitions(file_).error(), TransitionWriter::open(file_, {}, kGroup).error()}) {
    EXPECT_EQ(error.code, Code::kInvalidArgument);
    EXPECT_THAT(error.message, HasSubstr("a.dat: magic: wanted 'jostle-pushes 1'"));
  }
  folder_.write("a.dat", "jostle");
  EXPECT_THAT(TransitionWriter::open(file_, {}, kGroup).error().message, HasSubstr("header: got 6 bytes, wanted 96"));
}

TEST_F(TransitionFileTest, WithAnImpossibleRecordIsRefused) {
  auto writer = TransitionWriter::open(file_, {}, kGroup);
  auto transitions = some(4);
  transitions[2].sliders = 5;
  ASSERT_TRUE(writer->append(transitions));
  EXPECT_THAT(read_transitions(file_).error().message, HasSubstr("record 2: got 5 sliders, wanted 1 to 4"));
}

TEST_F(TransitionFileTest, ThatIsNotThereIsNamed) {
  const auto sut = read_transitions("/nowhere/a.dat");
  EXPECT_EQ(sut.error().code, Code::kNotFound);
  EXPECT_THAT(sut.error().message, HasSubstr("/nowhere/a.dat"));
}

}  // namespace
}  // namespace jostle::studies
