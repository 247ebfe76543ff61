#include "services/studies/bench/measurement.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace jostle::studies {
namespace {

using ::testing::ElementsAre;

const Hash kHash{.high = 1, .low = 2};

Side constant(std::string name, double value, Hash hash = kHash) {
  return {std::move(name), [value, hash]() -> Result<Sample> { return Sample{value, hash}; }};
}

TEST(Compare, RunsBothSidesInTurnsAfterOneUncountedRun) {
  std::string order;
  const auto noting = [&order](char letter) {
    return [&order, letter]() -> Result<Sample> {
      order += letter;
      return Sample{static_cast<double>(order.size()), kHash};
    };
  };
  const auto result = compare({"a", noting('a')}, {"b", noting('b')}, {.repeats = 2});
  ASSERT_TRUE(result);
  EXPECT_EQ(order, "ababab");
  EXPECT_THAT(result->a, ElementsAre(3.0, 5.0));
  EXPECT_THAT(result->b, ElementsAre(4.0, 6.0));
}

TEST(Compare, TakesTheMedianOfRatiosOfNeighbours) {
  std::vector<double> values{1.0, 9.0, 2.0};  // the last two are counted
  auto value = values.begin();
  const auto result = compare({"a",
                               [&]() -> Result<Sample> {
                                 return Sample{*value++, kHash};
                               }},
                              constant("b", 2.0), {.repeats = 2});
  ASSERT_TRUE(result);
  EXPECT_DOUBLE_EQ(result->ratio(), (9.0 / 2.0 + 2.0 / 2.0) / 2.0);
}

TEST(Compare, AgreesWhenEveryHashIsEqual) {
  const auto result = compare(constant("a", 1.0), constant("b", 1.0), {.repeats = 3});
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->agrees);
}

TEST(Compare, DisagreesWhenTheSidesComputeDifferentThings) {
  const auto result = compare(constant("a", 1.0), constant("b", 1.0, {.high = 3}), {.repeats = 1});
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->agrees);
  EXPECT_THAT(to_text(*result), ::testing::HasSubstr("WRONG"));
}

TEST(Compare, DisagreesWhenOneRunComputesSomethingElse) {
  std::uint64_t runs = 0;
  const Side fickle{"a", [&]() -> Result<Sample> { return Sample{1.0, {.high = 1, .low = ++runs == 3 ? 7u : 2u}}; }};
  const auto result = compare(fickle, constant("b", 1.0), {.repeats = 3});
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->agrees);
}

TEST(Compare, PassesAnErrorOn) {
  const Side broken{"b", []() -> Result<Sample> { return Error{Code::kUnavailable, "gone"}; }};
  const auto result = compare(constant("a", 1.0), broken, {.repeats = 3});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "gone");
}

TEST(Compare, KeepsThePairsThatWereCompleteWhenItIsStopped) {
  std::stop_source source;
  int runs = 0;
  const Side a{"a", [&]() -> Result<Sample> {
                 if (++runs == 4) source.request_stop();  // in the third pair that counts
                 if (source.stop_requested()) return Error{Code::kCancelled, "batch: cancelled by its caller"};
                 return Sample{3.0, kHash};
               }};
  auto result = compare(a, constant("b", 2.0), {.repeats = 9, .stop = source.get_token()});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->a.size(), 2u);
  EXPECT_EQ(result->b.size(), 2u);
  EXPECT_THAT(to_text(*result), ::testing::HasSubstr("2 of 9 repeats"));
  EXPECT_EQ(to_json({*result})[0]["repeats"], 2);
  EXPECT_EQ(to_json({*result})[0]["repeats_wanted"], 9);
}

TEST(Compare, TellsOfEveryRun) {
  int told = 0;
  const Turns turns{.repeats = 2, .on_run = [&] { ++told; }};
  ASSERT_TRUE(compare(constant("a", 1.0), constant("b", 1.0), turns));
  EXPECT_EQ(told, 6);
  EXPECT_EQ(turns.runs(), 6);
}

TEST(Compare, OneRepeatHasNoRange) {
  const auto result = compare(constant("a", 3.0), constant("b", 2.0), {.repeats = 1});
  EXPECT_THAT(to_text(*result), ::testing::HasSubstr("ratio 1.500  (1 repeat"));
}

TEST(ToText, HasADashWhereThereIsNoNumber) {
  auto result = compare(constant("a", 3.0), constant("b", 2.0), {.repeats = 1});
  result->details = {{"used_again_after_s", common::kNone}};
  EXPECT_THAT(to_text(*result), ::testing::ContainsRegex("used_again_after_s +-"));
  EXPECT_TRUE(to_json({*result})[0]["details"]["used_again_after_s"].is_null());
}

TEST(Compare, EndsOnAStopRequest) {
  std::stop_source source;
  source.request_stop();
  const auto result = compare(constant("a", 1.0), constant("b", 1.0), {.stop = source.get_token()});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kCancelled);
}

TEST(Compare, CountsTheCpuSecondsOfEachRun) {
  double used = 0.0;
  const auto spending = [&used](double seconds) {
    return [&used, seconds]() -> Result<Sample> {
      used += seconds;
      return Sample{1.0, kHash};
    };
  };
  const auto result =
      compare({"a", spending(2.0)}, {"b", spending(3.0)}, {.repeats = 1, .cpu_seconds = [&used] { return used; }});
  ASSERT_TRUE(result);
  EXPECT_THAT(result->cpu_a, ElementsAre(2.0));
  EXPECT_THAT(result->cpu_b, ElementsAre(3.0));
}

TEST(Aim, CountsTheBorderAsMet) {
  EXPECT_TRUE((Aim{Aim::Kind::kAtLeast, 0.95}).met_by(0.95));
  EXPECT_FALSE((Aim{Aim::Kind::kAtLeast, 0.95}).met_by(0.94));
  EXPECT_TRUE((Aim{Aim::Kind::kAtMost, 1.5}).met_by(1.5));
  EXPECT_FALSE((Aim{Aim::Kind::kAtMost, 1.5}).met_by(1.6));
}

TEST(ToJson, HoldsWhatScriptsRead) {
  auto result = compare(constant("a", 3.0), constant("b", 2.0), {.repeats = 2});
  ASSERT_TRUE(result);
  result->name = "thing";
  result->unit = "s";
  result->aim = Aim{Aim::Kind::kAtMost, 1.2};
  result->details = {{"workers", 4.0}};
  const auto list = to_json({*result});
  ASSERT_EQ(list.size(), 1u);
  const auto& object = list[0];
  EXPECT_EQ(object["name"], "thing");
  EXPECT_EQ(object["ratio"], 1.5);
  EXPECT_EQ(object["interval"], nlohmann::json::array({1.5, 1.5}));
  EXPECT_EQ(object["samples"].size(), 2u);
  EXPECT_EQ(object["a"], 3.0);
  EXPECT_EQ(object["b"], 2.0);
  EXPECT_EQ(object["unit"], "s");
  EXPECT_EQ(object["hash_a"], to_string(kHash));
  EXPECT_EQ(object["hash_b"], to_string(kHash));
  EXPECT_EQ(object["aim"], "<= 1.2");
  EXPECT_EQ(object["met"], false);
  EXPECT_EQ(object["details"]["workers"], 4.0);
}

}  // namespace
}  // namespace jostle::studies
