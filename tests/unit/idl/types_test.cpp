#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <unordered_set>

#include "idl/types/hash.hpp"
#include "idl/types/result.hpp"
#include "idl/types/state.hpp"

namespace jostle {
namespace {

TEST(Result, HoldsTheValueItWasMadeFrom) {
  const Result<int> sut = 42;
  ASSERT_TRUE(sut);
  EXPECT_TRUE(sut.has_value());
  EXPECT_EQ(*sut, 42);
  EXPECT_EQ(sut.value(), 42);
}

TEST(Result, HoldsTheErrorItWasMadeFrom) {
  const Result<int> sut = Error{Code::kDeadline, "too late"};
  ASSERT_FALSE(sut);
  EXPECT_EQ(sut.error().code, Code::kDeadline);
  EXPECT_EQ(sut.error().message, "too late");
}

TEST(Result, TakesAValueThatCanOnlyBeMoved) {
  Result<std::unique_ptr<int>> sut = std::make_unique<int>(7);
  const std::unique_ptr<int> taken = std::move(sut).value();
  EXPECT_EQ(*taken, 7);
}

TEST(Result, LetsTheValueBeChangedInPlace) {
  Result<std::string> sut = std::string("push");
  sut->append("ing");
  EXPECT_EQ(*sut, "pushing");
}

TEST(Result, KeepsAnErrorApartFromAValueOfTheSameText) {
  const Result<std::string> value = std::string("x");
  const Result<std::string> error = Error{Code::kIo, "x"};
  EXPECT_TRUE(value);
  EXPECT_FALSE(error);
}

TEST(ResultOfNothing, IsSuccessUnlessGivenAnError) {
  EXPECT_TRUE(Result<void>{});
  const Result<void> sut = Error{Code::kCancelled, "stop"};
  ASSERT_FALSE(sut);
  EXPECT_EQ(sut.error().code, Code::kCancelled);
}

// Origin of the three values: `xxhsum -H2` of xxHash 0.8.1 over the same bytes,
// little endian.
TEST(Hash, EqualsXxh3OfTheSameBytes) {
  EXPECT_EQ(to_string(hash_of("")), "99aa06d3014798d86001c324468d497f");
  EXPECT_EQ(to_string(hash_of("jostle")), "7b77a8831780dabd9744e1b09295755c");
  const std::vector<double> values{1.0, -2.5, 0.125};
  EXPECT_EQ(to_string(hash_of(std::span<const double>(values))), "ae98085e0cc0acf583d08919ee097f8b");
}

Hash hash_of_one(double value) { return hash_of(std::span<const double>(&value, 1)); }

TEST(Hash, TellsMinusZeroFromZero) {
  EXPECT_EQ(0.0, -0.0);
  EXPECT_NE(hash_of_one(0.0), hash_of_one(-0.0));
}

TEST(Hash, TellsNeighbouringDoublesApart) {
  EXPECT_NE(hash_of_one(0.1), hash_of_one(std::nextafter(0.1, 1.0)));
  EXPECT_EQ(hash_of_one(0.1), hash_of_one(0.1));
}

TEST(Hash, DependsOnOrder) {
  const std::vector<double> ab{1.0, 2.0}, ba{2.0, 1.0};
  EXPECT_NE(hash_of(std::span<const double>(ab)), hash_of(std::span<const double>(ba)));
}

TEST(Hash, IsWrittenWith32HexDigitsEvenWhenSmall) {
  EXPECT_EQ(to_string(Hash{.high = 0, .low = 0x2a}), "0000000000000000000000000000002a");
}

TEST(Hash, IsEmptyOnlyWhenAllZero) {
  EXPECT_TRUE(Hash{}.empty());
  EXPECT_FALSE((Hash{.high = 1}.empty()));
  EXPECT_FALSE((Hash{.low = 1}.empty()));
  EXPECT_FALSE(hash_of("").empty());
}

TEST(Hash, WorksAsAKey) {
  const std::unordered_set<Hash> set{hash_of("a"), hash_of("b"), hash_of("a")};
  EXPECT_EQ(set.size(), 2u);
}

TEST(Hash, OrdersByHighThenLow) {
  EXPECT_LT((Hash{.high = 1, .low = 9}), (Hash{.high = 2, .low = 0}));
  EXPECT_LT((Hash{.high = 1, .low = 1}), (Hash{.high = 1, .low = 2}));
}

ControlSequence three_steps() { return {.nu = 2, .values = {1, 2, 3, 4, 5, 6}}; }

TEST(ControlSequence, CountsSteps) {
  EXPECT_EQ(three_steps().steps(), 3);
  EXPECT_EQ(ControlSequence{}.steps(), 0);
  EXPECT_EQ((ControlSequence{.nu = 0, .values = {1.0}}).steps(), 0);
}

TEST(ControlSequence, HandsOutRowsThatCanBeWritten) {
  ControlSequence sut = three_steps();
  ASSERT_EQ(sut.step(1).size(), 2u);
  EXPECT_EQ(sut.step(1)[0], 3);
  sut.step(1)[1] = 40;
  EXPECT_EQ(sut.values, (std::vector<double>{1, 2, 3, 40, 5, 6}));
}

TEST(ControlSequence, AppendsTruncatesAndDropsWholeSteps) {
  ControlSequence sut = three_steps();
  sut.append(std::vector<double>{7, 8});
  EXPECT_EQ(sut.steps(), 4);
  sut.drop_first();
  EXPECT_EQ(sut.values, (std::vector<double>{3, 4, 5, 6, 7, 8}));
  sut.truncate(1);
  EXPECT_EQ(sut.values, (std::vector<double>{3, 4}));
  sut.drop_first();
  EXPECT_EQ(sut.steps(), 0);
}

TEST(ControlSequence, DiffersWhenOnlyItsWidthDiffers) {
  EXPECT_NE(three_steps(), (ControlSequence{.nu = 3, .values = {1, 2, 3, 4, 5, 6}}));
  EXPECT_EQ(three_steps(), three_steps());
}

TEST(State, DiffersWhenAVelocityDiffers) {
  const State a{.q = {1.0}, .v = {0.0}}, b{.q = {1.0}, .v = {0.1}};
  EXPECT_NE(a, b);
  EXPECT_EQ(a, a);
}

}  // namespace
}  // namespace jostle
