// What every ObjectSource promises, asked of every implementation.

#include <gmock/gmock.h>

#include <cmath>
#include <map>

#include "tests/support/world_rigs.hpp"

namespace jostle::tests {
namespace {

using perception::ObjectReading;

class ObjectSourceContract : public ::testing::TestWithParam<WorldCase> {
 protected:
  using Readings = std::map<std::string, ObjectReading>;

  // By name, once the robot was asked: what is planned from belongs together.
  Readings read() {
    if (auto ok = rig->robot().read(); !ok) throw std::runtime_error(ok.error().message);
    auto readings_result = sut.read();
    if (!readings_result) throw std::runtime_error(readings_result.error().message);
    count = readings_result->size();
    Readings readings;
    for (const ObjectReading& reading : *readings_result) readings[reading.name] = reading;
    return readings;
  }

  // Towards the target; the pusher reaches and pushes it.
  void act(int times = 1) {
    std::vector<double> u(static_cast<std::size_t>(rig->layout.nu), 0.0);
    u[kControlX] = 0.1;
    for (int i = 0; i < times; ++i) {
      const auto ok = rig->act(u, 0.2);
      ASSERT_TRUE(ok) << ok.error().message;
    }
  }

  void expect_truth(const Readings& readings) {
    const State truth = rig->truth();
    for (const ObjectSlot& slot : rig->layout.objects) {
      SCOPED_TRACE(slot.name);
      ASSERT_TRUE(readings.contains(slot.name));
      const ObjectReading& reading = readings.at(slot.name);
      const auto q = truth.q.begin() + slot.q, v = truth.v.begin() + slot.v;
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(reading.position[static_cast<std::size_t>(i)], q[i], 1e-9);
      for (int i = 0; i < 4; ++i) EXPECT_NEAR(reading.orientation[static_cast<std::size_t>(i)], q[3 + i], 1e-9);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(reading.linear[static_cast<std::size_t>(i)], v[i], 1e-9);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(reading.angular[static_cast<std::size_t>(i)], v[3 + i], 1e-9);
    }
  }

  const std::unique_ptr<WorldRig> rig = GetParam().make();
  perception::ObjectSource& sut = rig->objects();
  std::size_t count = 0;  // of the last reading
};

TEST_P(ObjectSourceContract, EveryObjectOfTheSceneIsThereOnce) {
  std::vector<std::string> wanted;
  for (const ObjectSlot& slot : rig->layout.objects) wanted.push_back(slot.name);
  for (int i = 0; i < 3; ++i) {
    std::vector<std::string> names;
    for (const auto& [name, reading] : read()) names.push_back(name);

    EXPECT_THAT(names, ::testing::UnorderedElementsAreArray(wanted));
    EXPECT_EQ(count, wanted.size());
    ASSERT_NO_FATAL_FAILURE(act());
  }
}

TEST_P(ObjectSourceContract, NumbersAreFiniteAndOrientationsAreUnitQuaternions) {
  for (int i = 0; i < 3; ++i) {
    for (const auto& [name, reading] : read()) {
      SCOPED_TRACE(name);
      double squares = 0.0;
      for (const double value : reading.orientation) squares += value * value;
      EXPECT_NEAR(squares, 1.0, 1e-9);
      for (const double value : reading.position) EXPECT_TRUE(std::isfinite(value));
      for (const double value : reading.linear) EXPECT_TRUE(std::isfinite(value));
      for (const double value : reading.angular) EXPECT_TRUE(std::isfinite(value));
    }
    ASSERT_NO_FATAL_FAILURE(act(2));
  }
}

TEST_P(ObjectSourceContract, FirstReadingIsTheScenesStart) {
  const Readings readings = read();
  for (const physics_pool::SceneObject& object : rig->scene.objects) {
    SCOPED_TRACE(object.name);
    const ObjectReading& reading = readings.at(object.name);
    EXPECT_NEAR(reading.position[0], object.x, 1e-9);
    EXPECT_NEAR(reading.position[1], object.y, 1e-9);
    EXPECT_NEAR(reading.orientation[0], std::cos(object.yaw / 2), 1e-9);
    EXPECT_NEAR(reading.orientation[3], std::sin(object.yaw / 2), 1e-9);
  }
}

TEST_P(ObjectSourceContract, ReadingsAreConsistentWithTheWorldAfterEveryAction) {
  for (int i = 0; i < 6; ++i) {
    ASSERT_NO_FATAL_FAILURE(act());
    expect_truth(read());
  }
}

TEST_P(ObjectSourceContract, ReadingsRepeatWhileNothingHappens) {
  ASSERT_NO_FATAL_FAILURE(act(3));
  const Readings first = read(), second = read();

  ASSERT_EQ(first.size(), second.size());
  for (const auto& [name, reading] : first) {
    SCOPED_TRACE(name);
    const ObjectReading& again = second.at(name);
    EXPECT_EQ(again.position, reading.position);
    EXPECT_EQ(again.orientation, reading.orientation);
    EXPECT_EQ(again.linear, reading.linear);
    EXPECT_EQ(again.angular, reading.angular);
  }
}

// Worlds with physics, and a pusher that is near enough.
class PushedObjectsContract : public ObjectSourceContract {};

TEST_P(PushedObjectsContract, WhatIsPushedIsSeenToMoveAndNothingElse) {
  const Readings before = read();

  ASSERT_NO_FATAL_FAILURE(act(3));

  for (const auto& [name, reading] : read()) {
    SCOPED_TRACE(name);
    const double way = reading.position[0] - before.at(name).position[0];
    if (name == rig->scene.task.target) {
      EXPECT_GT(way, 0.02);
    } else {
      EXPECT_NEAR(way, 0.0, 1e-4);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(InProcess, ObjectSourceContract, in_both_scenes<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(InProcess, PushedObjectsContract, with_pusher<InProcessRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, ObjectSourceContract, in_both_scenes<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Client, PushedObjectsContract, with_pusher<ClientRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Recorded, ObjectSourceContract, in_both_scenes<RecordedRig>(), scene_name);
INSTANTIATE_TEST_SUITE_P(Kinematic, ObjectSourceContract, in_both_scenes<KinematicRig>(), scene_name);

}  // namespace
}  // namespace jostle::tests
