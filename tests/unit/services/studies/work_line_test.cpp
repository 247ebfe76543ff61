#include "services/studies/progress/work_line.hpp"

#include <gmock/gmock.h>

namespace jostle::studies {
namespace {

TEST(WorkText, KnowsNoTimeLeftBeforeAnythingIsDone) {
  EXPECT_EQ(work_text("runs", {.total = 40, .work_left = 40, .seconds = 30, .since_last = 30}),
            "0 of 40 runs (0 %), 30 s so far");
}

TEST(WorkText, TakesTheRestToTakeAsLong) {
  EXPECT_EQ(work_text("runs", {.done = 10, .total = 40, .work_done = 10, .work_left = 30, .seconds = 100}),
            "10 of 40 runs (25 %), 2 min so far, about 5 min left");
}

TEST(WorkText, CountsDownWhileTheNextOneRuns) {
  EXPECT_EQ(
      work_text("runs", {.done = 10, .total = 12, .work_done = 10, .work_left = 2, .seconds = 305, .since_last = 5}),
      "10 of 12 runs (83 %), 5 min so far, about 55 s left");
  // One that takes longer than the others does not use up the time of those that come after it.
  EXPECT_EQ(
      work_text("runs", {.done = 10, .total = 12, .work_done = 10, .work_left = 2, .seconds = 400, .since_last = 100}),
      "10 of 12 runs (83 %), 7 min so far, about 30 s left");
}

TEST(WorkText, WhatWasFoundTookNoTime) {
  EXPECT_EQ(work_text("runs", {.done = 30, .total = 40, .found = 20, .work_done = 10, .work_left = 10, .seconds = 100}),
            "30 of 40 runs (75 %), 2 min so far, about 2 min left");
}

TEST(WorkText, WeighsWhatTakesLonger) {
  EXPECT_EQ(work_text("plans", {.done = 5, .total = 10, .work_done = 5, .work_left = 50, .seconds = 10}),
            "5 of 10 plans (50 %), 10 s so far, about 2 min left");
}

TEST(WorkText, SaysNoTimeLeftWhenAllIsDone) {
  EXPECT_EQ(work_text("runs", {.done = 40, .total = 40, .work_done = 40, .seconds = 80}),
            "40 of 40 runs (100 %), 80 s so far");
}

}  // namespace
}  // namespace jostle::studies
