#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <vector>

#include "physics_pool/scenarios/chapter3.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

constexpr int kSeeds = 4000;
const std::vector kLevels{Uncertainty::kLow, Uncertainty::kMedium, Uncertainty::kHigh};

// Mean 0 and the wanted sigma, each within 5 of its standard errors.
void expect_normal(const std::vector<double>& errors, double sigma) {
  const double n = static_cast<double>(errors.size());
  double sum = 0.0, square = 0.0;
  for (const double error : errors) {
    sum += error;
    square += error * error;
  }
  EXPECT_NEAR(sum / n / sigma, 0.0, 5 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(square / n) / sigma, 1.0, 5 / std::sqrt(2 * n));
}

// One object, so that nothing is drawn again, and large, so that nothing is
// clamped: half a size is more than 5 sigma away at every level.
Scene one_large(Shape shape) {
  Scene scene = tests::target_only();
  SceneObject& object = scene.objects[0];
  object.shape = shape;
  if (shape == Shape::kBox)
    object.size = {0.2, 0.2, 0.2};
  else
    object = {.name = "target", .shape = shape, .radius = 0.2, .height = 0.2, .mass = 0.5, .friction = 0.4};
  scene.robot.q[0] = -0.5;
  return scene;
}

class PerturbAt : public testing::TestWithParam<Uncertainty> {
 protected:
  using Field = std::function<double(const SceneObject&)>;

  static void expect_sigma(Shape shape, double sigma_at_low, const Field& field) {
    const Scene truth = one_large(shape);
    std::vector<double> errors;
    for (int seed = 0; seed < kSeeds; ++seed) {
      const Scene belief = perturb(truth, GetParam(), static_cast<std::uint64_t>(seed));
      errors.push_back(field(belief.objects[0]) - field(truth.objects[0]));
    }
    expect_normal(errors, sigma_at_low * static_cast<int>(GetParam()));
  }
};

// Footnote 2 of Ch. 3, read as standard deviations.
TEST_P(PerturbAt, HasTheSigmaOfTheFootnoteOnPoses) {
  expect_sigma(Shape::kBox, 0.005, [](const SceneObject& o) { return o.x; });
  expect_sigma(Shape::kBox, 0.005, [](const SceneObject& o) { return o.y; });
  expect_sigma(Shape::kBox, 0.005, [](const SceneObject& o) { return o.yaw; });
}

TEST_P(PerturbAt, HasTheSigmaOfTheFootnoteOnSizes) {
  for (std::size_t i = 0; i < 2; ++i) {
    expect_sigma(Shape::kBox, 0.005, [i](const SceneObject& o) { return o.size[i]; });
  }
  expect_sigma(Shape::kCylinder, 0.005, [](const SceneObject& o) { return o.radius; });
  expect_sigma(Shape::kCylinder, 0.005, [](const SceneObject& o) { return o.height; });
}

TEST_P(PerturbAt, HasTheSigmaOfTheFootnoteOnMassAndFriction) {
  expect_sigma(Shape::kBox, 0.01, [](const SceneObject& o) { return o.mass; });
  expect_sigma(Shape::kBox, 0.005, [](const SceneObject& o) { return o.friction; });
}

TEST_P(PerturbAt, KeepsNamesShapesRobotAndTask) {
  const Scene truth = tests::three_objects();
  const Scene belief = perturb(truth, GetParam(), 5);
  ASSERT_EQ(belief.objects.size(), truth.objects.size());
  for (std::size_t i = 0; i < truth.objects.size(); ++i) {
    EXPECT_EQ(belief.objects[i].name, truth.objects[i].name);
    EXPECT_EQ(belief.objects[i].shape, truth.objects[i].shape);
  }
  EXPECT_EQ(belief.robot.q[0], truth.robot.q[0]);
  EXPECT_EQ(belief.task.target, truth.task.target);
  EXPECT_EQ(belief.physics.time_step, truth.physics.time_step);
  EXPECT_NE(to_yaml(belief), to_yaml(truth));
}

TEST_P(PerturbAt, NeverLetsBelievedObjectsOverlap) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const auto truth = generate_chapter3({.objects = 15, .seed = seed});
    ASSERT_TRUE(truth);
    const Scene belief = perturb(*truth, GetParam(), seed);
    for (std::size_t i = 0; i < belief.objects.size(); ++i) {
      EXPECT_FALSE(overlaps_robot(belief, belief.objects[i]));
      for (std::size_t j = 0; j < i; ++j) {
        EXPECT_FALSE(overlap(belief.objects[i], belief.objects[j])) << "seed " << seed << ": " << i << ", " << j;
      }
    }
    const auto ok = validate(belief, "belief");
    EXPECT_TRUE(ok) << ok.error().message;
  }
}

TEST_P(PerturbAt, RepeatsForEqualSeeds) {
  const Scene truth = tests::three_objects();
  EXPECT_EQ(to_yaml(perturb(truth, GetParam(), 9)), to_yaml(perturb(truth, GetParam(), 9)));
  EXPECT_NE(to_yaml(perturb(truth, GetParam(), 9)), to_yaml(perturb(truth, GetParam(), 10)));
}

TEST_P(PerturbAt, NeverMakesASizeOrMassThatIsNotPositive) {
  Scene truth = tests::target_only();
  truth.objects[0].size = {0.005, 0.005, 0.005};
  truth.objects[0].mass = 0.001;
  truth.objects[0].friction = 0.001;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const Scene belief = perturb(truth, GetParam(), seed);
    const auto ok = validate(belief, "belief");
    ASSERT_TRUE(ok) << ok.error().message;
  }
}

INSTANTIATE_TEST_SUITE_P(Levels, PerturbAt, testing::ValuesIn(kLevels),
                         [](const auto& level) { return std::string(to_string(level.param)); });

TEST(Perturb, ChangesNothingAtLevelNone) {
  const Scene truth = tests::three_objects();
  EXPECT_EQ(to_yaml(perturb(truth, Uncertainty::kNone, 1)), to_yaml(truth));
}

TEST(Uncertainty, ReadsItsOwnWords) {
  for (const Uncertainty level : {Uncertainty::kNone, Uncertainty::kLow, Uncertainty::kMedium, Uncertainty::kHigh}) {
    const auto again = parse_uncertainty(to_string(level));
    ASSERT_TRUE(again);
    EXPECT_EQ(*again, level);
  }
}

TEST(Uncertainty, RefusesOtherWords) {
  const auto level = parse_uncertainty("extreme");
  ASSERT_FALSE(level);
  EXPECT_THAT(level.error().message,
              testing::AllOf(testing::HasSubstr("'extreme'"), testing::HasSubstr("none, low, medium or high")));
}

TEST(VelocityNoise, GrowsInEqualStepsFromZero) {
  const double low = velocity_noise(Uncertainty::kLow);
  EXPECT_EQ(velocity_noise(Uncertainty::kNone), 0.0);
  EXPECT_GT(low, 0.0);
  EXPECT_DOUBLE_EQ(velocity_noise(Uncertainty::kMedium), 2 * low);
  EXPECT_DOUBLE_EQ(velocity_noise(Uncertainty::kHigh), 3 * low);
}

TEST(ObservedState, IsTheTruthWhereTheBeliefIsRight) {
  const Scene truth = tests::three_objects();
  State x = initial_state(truth);
  EXPECT_EQ(observed_state(truth, truth, x, Measurement::kInitial), x);
  x.q[5] += 0.1;
  EXPECT_EQ(observed_state(truth, truth, x, Measurement::kFeedback), x);
}

class ObservedStateAt : public PerturbAt {};

TEST_P(ObservedStateAt, StartsWhereThePlanningWorldHasTheObjects) {
  const Scene truth = tests::three_objects();
  const Scene belief = perturb(truth, GetParam(), 4);
  EXPECT_EQ(observed_state(truth, belief, initial_state(truth), Measurement::kInitial), initial_state(belief));
}

TEST_P(ObservedStateAt, SeesMovedObjectsWhereTheyAreAtTheirBelievedHeight) {
  const Scene truth = tests::three_objects();
  const Scene belief = perturb(truth, GetParam(), 4);
  State x = initial_state(truth);
  for (std::size_t i = 0; i < x.v.size(); ++i) x.v[i] = 0.01 * double(i);
  x.q[5] += 0.1;
  const State seen = observed_state(truth, belief, x, Measurement::kFeedback);
  EXPECT_EQ(seen.v, x.v);
  const StateLayout layout = layout_of(truth);
  for (std::size_t i = 0; i < layout.objects.size(); ++i) {
    const auto z = static_cast<std::size_t>(layout.objects[i].q) + 2;
    EXPECT_NEAR(seen.q[z], belief.objects[i].rest_height(), 1e-15);
    x.q[z] = seen.q[z];
  }
  EXPECT_EQ(seen.q, x.q);  // nothing else differs
}

INSTANTIATE_TEST_SUITE_P(Levels, ObservedStateAt, testing::ValuesIn(kLevels),
                         [](const auto& level) { return std::string(to_string(level.param)); });

}  // namespace
}  // namespace jostle::physics_pool
