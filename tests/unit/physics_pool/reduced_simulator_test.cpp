#include "physics_pool/local/reduced_simulator.hpp"
#include "physics_pool/local/engine.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "physics_pool/local/simulator.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

constexpr Fidelity kFrozen{.freeze = true};
constexpr int kSecond = 500;  // engine steps of 2 ms

WorldPtr compile(const Scene& scene) { return std::move(World::compile(scene)).value(); }

Scene clutter(int objects, std::uint64_t seed) {
  return std::move(generate_chapter3({.objects = objects, .seed = seed})).value();
}

// [7] position and quaternion.
std::span<const double> pose(const StateLayout& layout, const State& x, std::size_t object) {
  return {&x.q[static_cast<std::size_t>(layout.objects[object].q)], 7};
}

double distance(std::span<const double> a, std::span<const double> b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

bool same(std::span<const double> a, std::span<const double> b) { return std::ranges::equal(a, b); }

TEST(ReducedSimulator, IsTheFineModelWhenNothingIsReduced) {
  const WorldPtr world = compile(clutter(5, 3));
  Simulator fine(world);
  ReducedSimulator sut(world, {.freeze = false, .time_step = world->time_step()});
  State a = initial_state(world->scene()), b = a;
  for (int t = 0; t < 4; ++t) {
    const std::array u{0.1, 0.02 * t, 0.1, 0.0};
    (void)fine.advance(a, u, kSecond);
    (void)sut.advance(b, u, kSecond);
    EXPECT_EQ(a, b);
  }
}

// A model in which somebody else was free is rewritten for the one that moves: it
// must then be the model that a world of that one alone compiles to.
TEST(ReducedSimulator, FreeObjectMovesAsIfTheFrozenOnesWereNotThere) {
  const Scene scene = clutter(6, 2);
  for (std::size_t moving = 0; moving < scene.objects.size(); ++moving) {
    Scene alone = scene;
    alone.objects = {scene.objects[moving]};
    alone.task.target = alone.objects[0].name;
    Simulator fine(compile(alone));
    ReducedSimulator sut(compile(scene), kFrozen);
    State a = initial_state(alone), b = initial_state(scene);
    const StateLayout layout = layout_of(scene);
    a.v[5 + 5] = b.v[static_cast<std::size_t>(layout.objects[moving].v) + 5] = 1.0;  // it spins, rad/s
    const std::array u{0.0, 0.0, 0.0, 0.0};

    (void)fine.advance(a, u, kSecond / 10);
    const Advance advance = sut.advance(b, u, kSecond / 10);

    ASSERT_EQ(advance.thawed, 0u);
    EXPECT_EQ(hash_of(std::vector<double>(a.q.begin() + 5, a.q.end())),
              hash_of(std::vector<double>(pose(layout, b, moving).begin(), pose(layout, b, moving).end())));
  }
}

TEST(ReducedSimulator, PushesWhatTheHandMeetsAndLeavesTheRestAlone) {
  const Scene scene = tests::three_objects();
  const WorldPtr world = compile(scene);
  Simulator fine(world);
  ReducedSimulator sut(world, kFrozen);
  State a = initial_state(scene), b = a;
  const State start = a;
  std::uint32_t thawed = 0;
  const std::array u{0.1, 0.0, 0.0, 0.0};
  for (int t = 0; t < 4; ++t) {
    (void)fine.advance(a, u, kSecond);
    thawed += sut.advance(b, u, kSecond).thawed;
  }
  EXPECT_GE(thawed, 1u);
  const StateLayout layout = layout_of(scene);
  int left_alone = 0;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    // An object that has settled rubs a little sooner than one just set free, and
    // what is pushed for 0.3 m remembers it.
    EXPECT_LT(distance(pose(layout, a, i), pose(layout, b, i)), 0.005) << scene.objects[i].name;
    left_alone += same(pose(layout, b, i), pose(layout, start, i)) ? 1 : 0;
  }
  EXPECT_GE(left_alone, 1);
}

TEST(ReducedSimulator, DependsOnStateAndControlAlone) {
  const WorldPtr world = compile(clutter(10, 4));
  ReducedSimulator whole(world, kFrozen);
  State a = initial_state(world->scene()), b = a;
  for (int t = 0; t < 5; ++t) {
    const std::array u{0.12, 0.03 - 0.02 * t, 0.0, 0.0};
    (void)whole.advance(a, u, kSecond);
    ReducedSimulator fresh(world, kFrozen);
    (void)fresh.advance(b, u, kSecond);
    ASSERT_EQ(a, b) << "step " << t;
  }
}

TEST(ReducedSimulator, LongStepsKeepTheDrivesStable) {
  const Scene scene = tests::target_only();
  for (const double time_step : {0.004, 0.008, 0.01, 0.02}) {
    ReducedSimulator sut(compile(scene), {.time_step = time_step});
    State x = initial_state(scene);
    const double start = x.q[kJointX];
    const Advance advance =
        sut.advance(x, std::array{-0.1, 0.0, 0.0, 0.0}, static_cast<int>(std::lround(1 / time_step)));
    EXPECT_EQ(advance.diverged, "");
    EXPECT_NEAR(x.q[kJointX] - start, -0.1, 0.006) << time_step;  // it starts late by inertia/kv
    EXPECT_NEAR(x.v[kJointX], -0.1, 1e-3);
  }
}

// A dozen boxes that reach a little into the arm: more contacts at once than a model
// without free objects has room for.
TEST(ReducedSimulator, SurvivesAHandThatStandsAmidManyObjects) {
  Scene scene = tests::target_only();
  scene.objects.clear();
  for (int i = 0; i < 6; ++i) {
    scene.objects.push_back(tests::box(fmt::format("left{}", i), -0.46 - 0.045 * i, 0.062));
    scene.objects.push_back(tests::box(fmt::format("right{}", i), -0.46 - 0.045 * i, -0.062));
  }
  scene.surface = physics_pool::Surface::table(1.6, 0.6);
  scene.objects[0].name = "target";
  scene.robot.q[0] = -0.33;
  ReducedSimulator sut(compile(scene), kFrozen);
  State x = initial_state(scene);
  const Advance advance = sut.advance(x, std::array{0.0, 0.0, 0.0, 0.0}, kSecond / 10);
  EXPECT_EQ(advance.diverged, "");
  EXPECT_GE(advance.thawed, 8u);
}

// As many models as there can be numbers of free objects, and then the first again.
TEST(ReducedSimulator, DependsOnStateAloneWhenModelsWereDropped) {
  const WorldPtr world = compile(clutter(20, 2));
  ReducedSimulator sut(world, kFrozen);
  const auto spun = [&](std::size_t count) {
    State x = initial_state(world->scene());
    for (std::size_t i = 0; i < count; ++i)
      x.v[static_cast<std::size_t>(world->geometry().layout.objects[i].v) + 5] = 1.0;
    (void)sut.advance(x, std::array{0.0, 0.0, 0.0, 0.0}, 20);
    return x;
  };
  std::vector<State> first;
  for (std::size_t count = 0; count <= 21; ++count) first.push_back(spun(count));
  for (const std::size_t count : {0u, 21u, 10u, 3u, 20u}) EXPECT_EQ(spun(count), first[count]);
}

TEST(ReducedSimulator, StopsWhenInterrupted) {
  const WorldPtr world = compile(tests::three_objects());
  ReducedSimulator sut(world, kFrozen);
  State x = initial_state(world->scene());
  int asked = 0;
  const Advance advance = sut.advance(x, std::array{0.1, 0.0, 0.0, 0.0}, kSecond, [&] { return ++asked > 7; });
  EXPECT_TRUE(advance.interrupted);
  EXPECT_EQ(advance.engine_steps, 7u);
}

TEST(StandsStill, OnlyOnTheSurfaceUprightAndAtRest) {
  const Scene scene = tests::target_only();
  const TaskGeometry geometry(scene);
  const State at_rest = initial_state(scene);
  const auto q = static_cast<std::size_t>(geometry.layout.objects[0].q),
             v = static_cast<std::size_t>(geometry.layout.objects[0].v);
  EXPECT_TRUE(stands_still(geometry, at_rest, 0));
  const auto after = [&](const std::function<void(State&)>& change) {
    State x = at_rest;
    change(x);
    return stands_still(geometry, x, 0);
  };
  EXPECT_FALSE(after([&](State& x) { x.v[v + 1] = 0.01; }));
  EXPECT_FALSE(after([&](State& x) { x.v[v + 4] = -0.1; }));
  EXPECT_FALSE(after([&](State& x) { x.q[q + 2] += 0.01; }));
  EXPECT_FALSE(after([&](State& x) { x.q[q + 3] = std::cos(0.05), x.q[q + 4] = std::sin(0.05); }));
  EXPECT_FALSE(after([&](State& x) { x.q[q + 1] = geometry.surface.parts[0].high_y() + 0.001; }));
  EXPECT_TRUE(after([&](State& x) { x.q[q + 3] = std::cos(0.7), x.q[q + 6] = std::sin(0.7); }));  // a turn about z
}

// The promise of freezing, over many random pushes through random clutter, against
// the full model's own collision test: whatever meets something that moves is free.
class RandomPushes : public testing::Test {
 protected:
  struct Rollout {
    int thawed = 0;
    State end;
  };

  // Objects that something which moved from x to after touches in the full world at x.
  std::set<std::size_t> touched_by_movers(const World& world, mjData& data, const State& x, const State& after) {
    const StateLayout& layout = world.geometry().layout;
    std::ranges::copy(x.q, data.qpos);
    std::ranges::copy(x.v, data.qvel);
    mj_fwdPosition(world.model(), &data);
    const int objects = static_cast<int>(layout.objects.size()), first_geom = world.model()->ngeom - objects;
    const auto moves = [&](int geom) {
      if (geom < first_geom) return world.model()->geom_bodyid[geom] != 0;  // the robot, not the table
      const auto i = static_cast<std::size_t>(geom - first_geom);
      return !same(pose(layout, x, i), pose(layout, after, i));
    };
    std::set<std::size_t> touched;
    for (int i = 0; i < data.ncon; ++i) {
      const int a = data.contact[i].geom1, b = data.contact[i].geom2;
      if (a >= first_geom && moves(b)) touched.insert(static_cast<std::size_t>(a - first_geom));
      if (b >= first_geom && moves(a)) touched.insert(static_cast<std::size_t>(b - first_geom));
    }
    return touched;
  }

  Rollout push(const WorldPtr& world, ReducedSimulator& sut, mjData& data, std::uint32_t sample) {
    SamplingLaw law{.sigma = {0.06, 0.06, 0.4, 0.01}, .limit = {0.15, 0.15, 0.8, 0.05}, .seed = 11};
    ControlSequence nominal{.nu = kGripperControls};
    for (int t = 0; t < 4; ++t) nominal.append(std::vector{0.08, 0.0, 0.0, 0.0});
    const ControlSequence controls = sample_controls(nominal, law, sample);
    Rollout rollout{.end = initial_state(world->scene())};
    State& x = rollout.end;
    const StateLayout& layout = world->geometry().layout;
    for (int t = 0; t < controls.steps(); ++t) {
      for (int part = 0; part < 5; ++part) {  // looks five times a second
        const State before = x;
        const Advance advance = sut.advance(x, std::as_const(controls).step(t), kSecond / 5);
        EXPECT_EQ(advance.diverged, "");
        rollout.thawed += static_cast<int>(advance.thawed);
        for (const std::size_t i : touched_by_movers(*world, data, before, x)) {
          EXPECT_FALSE(same(pose(layout, before, i), pose(layout, x, i)))
              << "object " << i << " was touched and stayed frozen, sample " << sample;
        }
      }
    }
    return rollout;
  }
};

TEST_F(RandomPushes, FindEveryTouchAndAgreeWithTheFullModelWhereNothingIsTouched) {
  int rollouts = 0, with_touches = 0, untouched = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const WorldPtr world = compile(clutter(8, seed));
    const DataPtr data(mj_makeData(world->model()));
    Simulator fine(world);
    ReducedSimulator sut(world, kFrozen);
    for (std::uint32_t sample = 0; sample < 21; ++sample) {
      const Rollout rollout = push(world, sut, *data, sample);
      if (sample % 7 == 3) {  // what ran before in the same models must not matter
        ReducedSimulator fresh(world, kFrozen);
        EXPECT_EQ(push(world, fresh, *data, sample).end, rollout.end);
      }
      ++rollouts;
      with_touches += rollout.thawed > 0 ? 1 : 0;
    }
    // Away from everything: the hand draws back and turns.
    for (const double turn : {-0.2, 0.0, 0.2}) {
      const State start = initial_state(world->scene());
      State a = start, b = start;
      const std::array u{-0.05, 0.02, turn, -0.01};
      (void)fine.advance(a, u, kSecond);
      ASSERT_EQ(sut.advance(b, u, kSecond).thawed, 0u);
      ++untouched;
      const StateLayout& layout = world->geometry().layout;
      for (int joint = 0; joint < 5; ++joint) EXPECT_NEAR(a.q[joint], b.q[joint], 1e-9);
      for (std::size_t i = 0; i < layout.objects.size(); ++i) {
        EXPECT_LT(distance(pose(layout, a, i), pose(layout, b, i)), 0.001);
      }
    }
  }
  EXPECT_GE(rollouts, 200);
  EXPECT_GE(with_touches, rollouts / 2);  // the pushes do meet something
  EXPECT_EQ(untouched, 30);
}

}  // namespace
}  // namespace jostle::physics_pool
