// The learned coarse model: symmetries, slots, bystanders, scenes that fit.

#include "physics_pool/coarse/learned/learned_model.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "tests/support/networks.hpp"

namespace jostle::physics_pool {
namespace {

using testing::HasSubstr;

constexpr double kSame = 1e-6;  // m, rad, m/s: inputs are float32

std::unique_ptr<CoarseModel> model(int sliders) {
  return std::move(make_learned_model(tests::random_network(), tests::slider_scene(sliders), "test")).value();
}

struct Slider {
  double x, y, theta = 0.0, vx = 0.0, vy = 0.0, omega = 0.0;
};

std::vector<double> state_of(double px, double py, const std::vector<Slider>& sliders) {
  const PlanarLayout layout{static_cast<int>(sliders.size())};
  std::vector<double> state(static_cast<std::size_t>(layout.size()));
  state[0] = px;
  state[1] = py;
  for (std::size_t i = 0; i < sliders.size(); ++i) {
    double* pose = state.data() + layout.pose(static_cast<int>(i));
    double* velocity = state.data() + layout.velocity(static_cast<int>(i));
    pose[0] = sliders[i].x;
    pose[1] = sliders[i].y;
    pose[2] = sliders[i].theta;
    velocity[0] = sliders[i].vx;
    velocity[1] = sliders[i].vy;
    velocity[2] = sliders[i].omega;
  }
  return state;
}

// Four sliders that the pusher reaches, directly or not.
const std::vector<Slider> kCrowd{
    {0.08, 0.02, 0.3, 0.01, 0.02, 0.1}, {0.19, 0.01, -1.0}, {0.1, 0.13, 2.0}, {0.13, -0.1, 3.0, 0.0, -0.03, 0.0}};
constexpr std::array<double, 2> kAhead{0.09, 0.03};

std::vector<double> advanced(CoarseModel& sut, std::vector<double> state, std::array<double, 2> u,
                             double duration = 1.0) {
  sut.advance(state, u, duration);
  return state;
}

// A symmetry of the square, then a translation.
struct Motion {
  double quarter_turns = 0.0;
  bool is_mirrored = false;  // y, before turning
  double x = 0.0, y = 0.0;

  std::array<double, 2> turned(double vx, double vy) const {
    if (is_mirrored) vy = -vy;
    for (int i = 0; i < quarter_turns; ++i) std::tie(vx, vy) = std::pair{-vy, vx};
    return {vx, vy};
  }
  std::vector<double> moved(const std::vector<double>& state) const {
    const PlanarLayout layout{(static_cast<int>(state.size()) / 2 - 2) / 3};
    std::vector<double> result = state;
    const double hand = is_mirrored ? -1 : 1;
    const auto move = [&](int pose, int velocity, bool has_angle) {
      const auto p = turned(state[static_cast<std::size_t>(pose)], state[static_cast<std::size_t>(pose) + 1]);
      const auto v = turned(state[static_cast<std::size_t>(velocity)], state[static_cast<std::size_t>(velocity) + 1]);
      double* q = result.data() + pose;
      double* dq = result.data() + velocity;
      q[0] = p[0] + x;
      q[1] = p[1] + y;
      dq[0] = v[0];
      dq[1] = v[1];
      if (!has_angle) return;
      q[2] = std::remainder(hand * q[2] + quarter_turns * std::numbers::pi / 2, 2 * std::numbers::pi);
      dq[2] *= hand;
    };
    move(0, layout.pusher_velocity(), false);
    for (int i = 0; i < layout.sliders; ++i) move(layout.pose(i), layout.velocity(i), true);
    return result;
  }
};

class LearnedModelSymmetry : public testing::TestWithParam<Motion> {};

TEST_P(LearnedModelSymmetry, OfTheFineModelIsExact) {
  const Motion& motion = GetParam();
  const auto sut = model(4);
  const auto start = state_of(0.0, 0.0, kCrowd);
  for (const auto& u : {kAhead, std::array{0.1, 0.0}, std::array{0.07, 0.07}}) {
    const auto expected = motion.moved(advanced(*sut, start, u));
    const auto end = advanced(*sut, motion.moved(start), motion.turned(u[0], u[1]));
    for (std::size_t i = 0; i < end.size(); ++i)
      EXPECT_NEAR(end[i], expected[i], kSame) << "entry " << i << ", u " << u[1];
  }
}

INSTANTIATE_TEST_SUITE_P(, LearnedModelSymmetry,
                         testing::Values(Motion{1}, Motion{2}, Motion{3}, Motion{0, true}, Motion{1, true},
                                         Motion{2, true}, Motion{3, true}, Motion{0, false, 0.4, -0.7},
                                         Motion{3, true, -0.2, 0.5}));

TEST(LearnedModel, DoesNotCareForTheOrderOfSliders) {
  const auto sut = model(4);
  const auto expected = advanced(*sut, state_of(0, 0, kCrowd), kAhead);
  const std::array<std::size_t, 4> order{2, 0, 3, 1};
  std::vector<Slider> shuffled;
  for (const std::size_t i : order) shuffled.push_back(kCrowd[i]);
  const auto end = advanced(*sut, state_of(0, 0, shuffled), kAhead);
  const PlanarLayout layout{4};
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const int here = layout.pose(static_cast<int>(i)) + axis, there = layout.pose(static_cast<int>(order[i])) + axis;
      EXPECT_DOUBLE_EQ(end[static_cast<std::size_t>(here)], expected[static_cast<std::size_t>(there)]) << i << axis;
    }
  }
}

TEST(LearnedModel, PredictsTheSameWithSlidersParkedAsWithSlidersOutOfReach) {
  const auto alone = advanced(*model(1), state_of(0, 0, {kCrowd[0]}), kAhead);
  const auto crowd = advanced(*model(4), state_of(0, 0, {kCrowd[0], {-0.3, 0.0}, {0.9, 0.9}, {0.0, -0.5}}), kAhead);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(alone[i], crowd[i]) << i;
}

TEST(LearnedModel, MovesThePusherAsItIsTold) {
  const auto end = advanced(*model(4), state_of(0.01, -0.02, kCrowd), kAhead, 0.5);
  const PlanarLayout layout{4};
  EXPECT_DOUBLE_EQ(end[0], 0.01 + 0.5 * kAhead[0]);
  EXPECT_DOUBLE_EQ(end[1], -0.02 + 0.5 * kAhead[1]);
  EXPECT_EQ(end[static_cast<std::size_t>(layout.pusher_velocity())], kAhead[0]);
  EXPECT_EQ(end[static_cast<std::size_t>(layout.pusher_velocity()) + 1], kAhead[1]);
}

TEST(LearnedModel, LeavesBystandersExactlyWhereTheyAre) {
  const Slider far{0.0, 0.3, 1.0}, behind{-0.2, 0.0, 2.0};
  const auto end = advanced(*model(3), state_of(0, 0, {kCrowd[0], far, behind}), kAhead);
  EXPECT_NE(end[2], kCrowd[0].x);
  EXPECT_EQ(end[5], far.x);
  EXPECT_EQ(end[6], far.y);
  EXPECT_EQ(end[7], far.theta);
  EXPECT_EQ(end[8], behind.x);
}

TEST(LearnedModel, LeavesEverythingWhereItIsWhenThePusherStands) {
  const auto start = state_of(0, 0, {kCrowd[1], kCrowd[2]});
  EXPECT_EQ(advanced(*model(2), start, {0.0, 0.0}), start);
}

// v^2 / (2·mu·g) along an axis; sqrt(2) of it along the diagonal, where a pyramid brakes less.
TEST(LearnedModel, LetsSlidersCoastToRest) {
  const double braking = 2 * 0.2 * 9.81, v = 0.1;
  const auto end = advanced(*model(2), state_of(0, 0, {{0.3, 0.3, 0, v, 0}, {-0.3, 0.3, 0, v, v}}), {0.01, 0.0});
  EXPECT_NEAR(end[2], 0.3 + v * v / braking, 1e-12);
  EXPECT_EQ(end[3], 0.3);
  EXPECT_NEAR(end[5], -0.3 + 2 * v * v / braking, 1e-12);
  EXPECT_NEAR(end[6], 0.3 + 2 * v * v / braking, 1e-12);
  const PlanarLayout layout{2};
  for (int i = layout.velocity(0); i < layout.size(); ++i) EXPECT_EQ(end[static_cast<std::size_t>(i)], 0.0);
}

TEST(LearnedModel, TakesAStepOfAnotherDurationForOneWithTheSameWay) {
  const auto sut = model(4);
  const auto start = state_of(0, 0, kCrowd);
  const auto fast = advanced(*sut, start, kAhead, 1.0);
  const auto slow = advanced(*sut, start, {kAhead[0] / 2, kAhead[1] / 2}, 2.0);
  const std::size_t half = fast.size() / 2;
  for (std::size_t i = 0; i < half; ++i) {
    EXPECT_NEAR(slow[i], fast[i], kSame);
    EXPECT_NEAR(2 * slow[half + i], fast[half + i], kSame);
  }
}

TEST(LearnedModel, TakesALongStepInEqualParts) {
  const auto sut = model(4);
  auto expected = state_of(0, 0, kCrowd);
  for (int i = 0; i < 3; ++i) expected = advanced(*sut, expected, {0.12, 0.0}, 1.0);
  const auto end = advanced(*sut, state_of(0, 0, kCrowd), {0.12, 0.0}, 3.0);
  for (std::size_t i = 0; i < end.size() / 2; ++i) EXPECT_NEAR(end[i], expected[i], kSame) << i;
}

TEST(LearnedModel, PredictsEachStateAsIfItWereAlone) {
  constexpr std::size_t kMany = 21;
  const auto sut = model(4);
  const auto start = state_of(0, 0, kCrowd);
  std::vector<double> states, controls;
  for (std::size_t k = 0; k < kMany; ++k) {
    states.insert(states.end(), start.begin(), start.end());
    // Some touch nothing, one goes farther than a step of the training.
    controls.push_back(k == 3 ? 0.3 : 0.01 * static_cast<double>(k) - 0.1);
    controls.push_back(0.02);
  }
  sut->advance(states, controls, 1.0);
  for (std::size_t k = 0; k < kMany; ++k) {
    const auto alone = advanced(*sut, start, {controls[2 * k], controls[2 * k + 1]});
    for (std::size_t i = 0; i < start.size(); ++i) EXPECT_EQ(states[k * start.size() + i], alone[i]) << k << ' ' << i;
  }
}

TEST(LearnedModel, MakesWhatItCannotPredictNonFinite) {
  const auto sut = model(2);
  const std::vector<Slider> two{kCrowd[0], kCrowd[1]};
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e9}) {
    const auto end = advanced(*sut, state_of(0, 0, two), {bad, 0.0});
    EXPECT_FALSE(std::isfinite(end[2])) << bad;
  }
  const auto end = advanced(*sut, state_of(0, 0, {{std::nan(""), 0.0}, kCrowd[1]}), kAhead);
  EXPECT_FALSE(std::isfinite(end[2]));
}

struct Misfit {
  std::string name;
  std::function<void(Scene&)> change;
  std::string told;
};

void PrintTo(const Misfit& value, std::ostream* out) { *out << value.name; }

class LearnedModelMisfit : public testing::TestWithParam<Misfit> {};

TEST_P(LearnedModelMisfit, IsRefused) {
  Scene scene = tests::slider_scene(2);
  GetParam().change(scene);
  const auto sut = make_learned_model(tests::random_network(), scene, "a.net");
  ASSERT_FALSE(sut);
  EXPECT_EQ(sut.error().code, Code::kInvalidArgument);
  EXPECT_THAT(sut.error().message,
              testing::AllOf(HasSubstr("a.net: does not fit scene 'sliders'"), HasSubstr(GetParam().told),
                             HasSubstr("choose another coarse model")));
}

INSTANTIATE_TEST_SUITE_P(
    , LearnedModelMisfit,
    testing::Values(Misfit{"Gripper", [](Scene& scene) { scene.robot = physics_pool::planar_gripper({}); },
                           "robot.model: got planar_gripper, wanted a disc"},
                    Misfit{"OtherPusher", [](Scene& scene) { scene.robot = pusher({.radius = 0.02}); },
                           "robot.radius: got 0.02 m, wanted the 0.0145 m"},
                    Misfit{"NoSlider", [](Scene& scene) { scene.objects.clear(); }, "objects: got 0, wanted 1 to 4"},
                    Misfit{"FiveSliders", [](Scene& scene) { scene.objects.resize(5, scene.objects[0]); },
                           "objects: got 5, wanted 1 to 4"},
                    Misfit{"Box", [](Scene& scene) { scene.objects[1].shape = Shape::kBox; },
                           "objects[1].shape: got box, wanted cylinder"},
                    Misfit{"OtherSlider", [](Scene& scene) { scene.objects[1].radius = 0.04; },
                           "objects[1].radius: got 0.04 m, wanted the 0.05115 m"}),
    [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace jostle::physics_pool
