// What a simulated motion capture does wrong: as often, as long and as much as was ordered.

#include "services/world/link/mocap_faults.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace jostle::world {
namespace {

using perception::natnet::Body;
using perception::natnet::Frame;

constexpr int kFrames = 20'000;

Frame frame_of(int bodies) {
  Frame frame;
  for (int i = 0; i < bodies; ++i)
    frame.bodies.push_back({.id = i + 1, .position = {static_cast<float>(i), 0.0F, 0.1F}});
  return frame;
}

TEST(MocapFaults, NoneLeaveFramesAsTheyAre) {
  MocapFaults sut(MocapFaultOptions{});
  Frame frame = frame_of(3);
  sut.spoil(frame);
  const Frame truth = frame_of(3);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(frame.bodies[i].id, truth.bodies[i].id);
    EXPECT_EQ(frame.bodies[i].position, truth.bodies[i].position);
    EXPECT_EQ(frame.bodies[i].orientation, truth.bodies[i].orientation);
    EXPECT_TRUE(frame.bodies[i].tracked);
  }
  EXPECT_EQ(sut.latency(), 0.0);
  EXPECT_TRUE(arguments_of({}).empty());
}

TEST(MocapFaults, NoiseHasItsStandardDeviationAndIsTold) {
  MocapFaults sut({.noise = 0.01});
  double squares = 0, turns = 0;
  for (int i = 0; i < kFrames; ++i) {
    Frame frame = frame_of(1);
    sut.spoil(frame);
    const Body& body = frame.bodies[0];
    squares += std::pow(body.position[0], 2);
    turns += std::pow(2 * body.orientation[3], 2);  // about z, small angles
    ASSERT_FLOAT_EQ(body.mean_error, 0.01F);
  }
  EXPECT_NEAR(std::sqrt(squares / kFrames), 0.01, 0.0003);
  EXPECT_NEAR(std::sqrt(turns / kFrames), 0.04, 0.0015);
}

TEST(MocapFaults, HiddenIsAShareOfTheTimeInSpells) {
  MocapFaults sut({.hidden = 0.3});
  int hidden = 0, spells = 0;
  bool was_hidden = false;
  for (int i = 0; i < kFrames; ++i) {
    Frame frame = frame_of(2);
    sut.spoil(frame);
    const bool is_hidden = !frame.bodies[0].tracked;
    hidden += is_hidden;
    spells += is_hidden && !was_hidden;
    was_hidden = is_hidden;
  }
  EXPECT_NEAR(static_cast<double>(hidden) / kFrames, 0.3, 0.06);
  EXPECT_NEAR(static_cast<double>(hidden) / spells, 50, 15);
}

TEST(MocapFaults, SwappedBodiesHaveEachOthersPlaces) {
  MocapFaults sut({.swapped = 0.2});
  int swapped = 0;
  for (int i = 0; i < kFrames; ++i) {
    Frame frame = frame_of(4);
    sut.spoil(frame);
    int elsewhere = 0;
    for (const Body& body : frame.bodies) elsewhere += std::lround(body.position[0]) != body.id - 1;
    ASSERT_TRUE(elsewhere == 0 || elsewhere == 2) << elsewhere;
    swapped += elsewhere == 2;
  }
  EXPECT_NEAR(static_cast<double>(swapped) / kFrames, 0.2, 0.05);
}

TEST(MocapFaults, LatencyIsUpToWhatWasOrdered) {
  MocapFaults sut({.latency = 0.1});
  double sum = 0, most = 0;
  for (int i = 0; i < kFrames; ++i) {
    const double latency = sut.latency();
    ASSERT_GE(latency, 0.0);
    sum += latency, most = std::max(most, latency);
  }
  EXPECT_NEAR(sum / kFrames, 0.05, 0.002);
  EXPECT_LE(most, 0.1);
  EXPECT_GT(most, 0.099);
}

TEST(MocapFaults, EqualSeedsGiveEqualFaultsAndOthersDoNot) {
  const auto spoilt = [](std::uint64_t seed) {
    MocapFaults faults({.noise = 0.01, .hidden = 0.1, .swapped = 0.1, .seed = seed});
    std::vector<float> all;
    for (int i = 0; i < 100; ++i) {
      Frame frame = frame_of(3);
      faults.spoil(frame);
      for (const Body& body : frame.bodies) all.insert(all.end(), body.position.begin(), body.position.end());
    }
    return all;
  };
  EXPECT_EQ(spoilt(7), spoilt(7));
  EXPECT_NE(spoilt(7), spoilt(8));
}

}  // namespace
}  // namespace jostle::world
