#include <gmock/gmock.h>

#include <numbers>
#include <random>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/parareal_pool.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/pushing.hpp"

namespace jostle::tests {
namespace {

using namespace physics_pool;
using namespace std::chrono_literals;
using ::testing::HasSubstr;

TimePoint soon() { return std::chrono::steady_clock::now() + 60s; }

Scene one_slider() { return pushing_scene(-0.075, 0.02, {slider_box("box", 0.0, 0.0, 0.1)}); }

// A coarse model that leaves everything where it is.
class Lazy final : public CoarseModel {
 public:
  explicit Lazy(const Scene& scene) : layout_{static_cast<int>(scene.objects.size())} {}
  std::string_view name() const override { return "lazy"; }
  PlanarLayout layout() const override { return layout_; }
  void advance(std::span<double> states, std::span<const double>, double) override {
    if (spoil) states[3] = std::nan("");
  }
  bool spoil = false;

 private:
  PlanarLayout layout_;
};

// F for tests of the recursion alone: the first slider moves by a fifth of the distance to
// x = 1 and what the pusher's control says.
State relax(const State& start, double u) {
  State end = start;
  end.q[2] += 0.2 * (1.0 - start.q[2]) + u;
  return end;
}

struct Recursion {
  explicit Recursion(const PararealStop& stop, int steps = 4) : scene(one_slider()), update(scene), coarse(scene) {
    controls.nu = kPusherControls;
    for (int t = 0; t < steps; ++t) controls.append(std::vector{0.01 * t, 0.0});
    x0 = initial_state(scene);
    x0.q[0] = -1.0;  // the pusher is out of the way
    sut = std::make_unique<PararealIteration>(update, coarse, x0, controls, 1.0, stop);
  }

  void guess() {
    std::vector<double> planar(static_cast<std::size_t>(update.planar_layout().size()));
    for (int n = 0; n < controls.steps(); ++n) {
      sut->next_start(planar);
      coarse.advance(planar, controls.step(n), 1.0);
      sut->guess(planar);
    }
  }

  State fine(const PararealIteration::Slice& slice) const { return relax(*slice.start, controls.step(slice.step)[0]); }

  std::vector<State> serial() const {
    std::vector<State> states{x0};
    for (int n = 0; n < controls.steps(); ++n) states.push_back(relax(states.back(), controls.step(n)[0]));
    return states;
  }

  Scene scene;
  PlanarUpdate update;
  Lazy coarse;
  ControlSequence controls;
  State x0;
  std::unique_ptr<PararealIteration> sut;
};

// Runs what is ready, picked by `order`; the number of slices that ran.
int run_all(Recursion& recursion, std::mt19937* order = nullptr) {
  std::vector<PararealIteration::Slice> waiting;
  int count = 0;
  for (;;) {
    for (const auto& slice : recursion.sut->take_ready()) waiting.push_back(slice);
    if (waiting.empty() || recursion.sut->done()) return count;
    const std::size_t pick = order ? (*order)() % waiting.size() : 0;
    const auto slice = waiting[pick];
    waiting.erase(waiting.begin() + static_cast<std::ptrdiff_t>(pick));
    recursion.sut->complete(slice.id, recursion.fine(slice));
    ++count;
  }
}

TEST(PararealIteration, EveryLevelIsOneStateMoreExact) {
  for (int k = 1; k <= 4; ++k) {
    Recursion recursion({.iterations = k});
    recursion.guess();
    run_all(recursion);
    ASSERT_TRUE(recursion.sut->done());
    const auto serial = recursion.serial();
    for (int n = 0; n <= k; ++n) {
      EXPECT_EQ(recursion.sut->states()[static_cast<std::size_t>(n)], serial[static_cast<std::size_t>(n)])
          << k << " " << n;
    }
    EXPECT_EQ(recursion.sut->states()[4] == serial[4], k == 4) << k;
  }
}

TEST(PararealIteration, AppliesEq63) {
  Recursion recursion({.iterations = 1});
  recursion.guess();
  run_all(recursion);
  // C leaves a state alone, so x_{n+1}^1 = x_n^1 + F(x_n^0) - x_n^0 with x_n^0 = x0.
  double wanted = recursion.x0.q[2];
  for (int n = 0; n < 4; ++n) {
    wanted += 0.2 * (1.0 - recursion.x0.q[2]) + 0.01 * n;
    EXPECT_NEAR(recursion.sut->states()[static_cast<std::size_t>(n) + 1].q[2], wanted, 1e-12);
  }
}

TEST(PararealIteration, ConvergedSlicesAreNotRunAgain) {
  Recursion recursion({.iterations = 4});
  recursion.guess();
  EXPECT_EQ(run_all(recursion), 4 + 3 + 2 + 1);
}

TEST(PararealIteration, OrderOfArrivalChangesNothing) {
  Recursion orderly({.iterations = 3}, 6);
  orderly.guess();
  run_all(orderly);
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 order(seed);
    Recursion recursion({.iterations = 3}, 6);
    recursion.guess();
    run_all(recursion, &order);
    EXPECT_EQ(recursion.sut->states(), orderly.sut->states()) << seed;
  }
}

TEST(PararealIteration, SliceStartsBeforeTheOthersOfItsLevelAreDone) {
  Recursion recursion({.iterations = 2});
  recursion.guess();
  const auto first = recursion.sut->take_ready();
  ASSERT_EQ(first.size(), 4u);
  // Times 0 and 1 of level 0 are back: x_2^1 is known, whatever times 2 and 3 do.
  recursion.sut->complete(first[0].id, recursion.fine(first[0]));
  recursion.sut->complete(first[1].id, recursion.fine(first[1]));

  const auto next = recursion.sut->take_ready();

  ASSERT_EQ(next.size(), 2u);
  EXPECT_EQ(next[0].level, 1);
  EXPECT_EQ(next[0].step, 1);
  EXPECT_EQ(next[1].step, 2);
}

TEST(PararealIteration, AdaptiveEndsWhenNothingMovesAnyMore) {
  Recursion strict({.iterations = 6, .adaptive = true, .translation_mm = 1e-9}, 6);
  strict.guess();
  run_all(strict);
  EXPECT_EQ(strict.sut->iterations(), 6);

  Recursion loose({.iterations = 6, .adaptive = true, .translation_mm = 60.0}, 6);
  loose.guess();
  run_all(loose);
  EXPECT_GT(loose.sut->iterations(), 0);
  EXPECT_LT(loose.sut->iterations(), 6);
}

TEST(PararealIteration, NamesACoarseModelThatLosesItself) {
  Recursion recursion({.iterations = 2});
  recursion.coarse.spoil = true;
  recursion.guess();
  EXPECT_THAT(recursion.sut->problem(), HasSubstr("coarse model 'lazy'"));
  EXPECT_THAT(recursion.sut->problem(), HasSubstr("after control step 0"));
}

TEST(PlanarUpdate, CorrectionTurnsAboutTheVertical) {
  const Scene scene = one_slider();
  const PlanarUpdate sut(scene);
  State x = initial_state(scene);
  std::vector<double> before(10), after(10);
  to_planar(sut.layout(), x, before);
  after = before;
  after[2] += 0.01;
  after[4] += std::numbers::pi;  // a half turn more is fine
  after[9] += 2.0;

  sut.correct(x, {before, after}, {before, before}, HUGE_VAL);

  std::vector<double> planar(10);
  to_planar(sut.layout(), x, planar);
  EXPECT_NEAR(planar[2], before[2] + 0.01, 1e-12);
  EXPECT_NEAR(std::abs(std::remainder(planar[4] - before[4], 2 * std::numbers::pi)), std::numbers::pi, 1e-9);
  EXPECT_NEAR(planar[9], 2.0, 1e-12);
  double norm = 0.0;
  for (int i = 5; i < 9; ++i) norm += x.q[static_cast<std::size_t>(i)] * x.q[static_cast<std::size_t>(i)];
  EXPECT_NEAR(norm, 1.0, 1e-12);
}

TEST(PlanarUpdate, CorrectionKeepsToItsLimit) {
  const Scene scene = one_slider();
  const PlanarUpdate sut(scene);
  State x = initial_state(scene);
  std::vector<double> before(10), now(10);
  to_planar(sut.layout(), x, before);
  now = before;
  now[2] += 0.001;  // the starts are 1 mm apart,
  std::vector<double> far = now;
  far[2] += 0.1;  // and C has lost the slider from one of them

  sut.correct(x, {now, far}, {before, before}, 2.0);

  EXPECT_NEAR(x.q[2], 0.002, 1e-12);
}

TEST(PlanarUpdate, ProjectionMovesNoMoreThanItMust) {
  const Scene scene = one_slider();
  const PlanarUpdate sut(scene);
  State x = initial_state(scene);
  x.q[0] = -0.0545 - 0.0145 + 0.004;  // 4 mm inside, but for the box's turn
  x.q[1] = 0.0;
  x.q[5] = 1.0;
  x.q[8] = 0.0;
  State free = x;
  free.q[0] -= 0.01;
  const State untouched = free;

  sut.project(x);
  sut.project(free);

  EXPECT_NEAR(x.q[2], 0.004, 1e-9);
  EXPECT_NEAR(x.q[3], 0.0, 1e-12);
  EXPECT_EQ(free, untouched);
}

TEST(PlanarUpdate, ProjectionSeparatesManyBodies) {
  Scene scene = four_sliders();
  const PlanarUpdate sut(scene);
  State x = initial_state(scene);
  for (int i = 0; i < 4; ++i) {  // in a heap, with the pusher in it
    x.q[static_cast<std::size_t>(2 + 7 * i)] = 0.03 * i;
    x.q[static_cast<std::size_t>(3 + 7 * i)] = 0.02 * (i % 2);
  }
  sut.project(x);

  std::vector<double> planar(static_cast<std::size_t>(sut.planar_layout().size()));
  to_planar(sut.layout(), x, planar);
  for (int i = 0; i < 4; ++i) {
    const double* a = &planar[static_cast<std::size_t>(sut.planar_layout().pose(i))];
    EXPECT_GE(std::hypot(a[0] - planar[0], a[1] - planar[1]), 0.0145 + 0.05115 - 0.001);
    for (int j = 0; j < i; ++j) {
      const double* b = &planar[static_cast<std::size_t>(sut.planar_layout().pose(j))];
      EXPECT_GE(std::hypot(a[0] - b[0], a[1] - b[1]), 2 * 0.05115 - 0.001) << i << " " << j;
    }
  }
}

class PararealOnThreads : public ::testing::TestWithParam<int> {
 protected:
  PararealOnThreads() : scene(GetParam() == 1 ? one_slider() : four_sliders()) { EXPECT_TRUE(threads.load(scene)); }

  BatchReply predict(const RolloutBatch& batch, PararealOptions options) {
    PararealPool sut(threads, std::move(options));
    EXPECT_TRUE(sut.load(scene));
    auto reply_result = sut.run(batch, soon());
    if (!reply_result) throw std::runtime_error(reply_result.error().message);
    return std::move(reply_result).value();
  }

  const Scene scene;
  ThreadPool threads{2};
};

TEST_P(PararealOnThreads, AsManyIterationsAsStepsIsTheFineModel) {
  const RolloutBatch batch = pushes(scene, {0.05, 0.005}, 4, 0.5, 3, 0.01);
  const auto fine = fingerprints(threads.run(batch, soon()).value());
  for (const char* model : {"kinematic", "limit-surface", "planar"}) {
    EXPECT_EQ(fingerprints(predict(batch, {.model = model, .stop = {.iterations = 4}})), fine) << model;
  }
}

TEST_P(PararealOnThreads, IterationsComeNearer) {
  const RolloutBatch batch = pushes(scene, {0.04, 0.01}, 4, 1.0);
  const State truth = threads.run(batch, soon())->outcomes[0].trajectory.back();
  const PlanarUpdate update(scene);
  std::vector<double> errors;
  for (int k = 0; k <= 4; ++k) {
    const auto reply = predict(batch, {.model = "planar", .stop = {.iterations = k}});
    errors.push_back(update.change(reply.outcomes[0].trajectory.back(), truth).translation);
  }
  EXPECT_LT(errors[2], errors[0]);
  EXPECT_EQ(errors[4], 0.0);
}

TEST_P(PararealOnThreads, FirstStepIsExactAfterOneIteration) {
  const RolloutBatch batch = pushes(scene, {0.05, 0.0}, 3, 0.5);
  const auto fine = threads.run(batch, soon()).value();
  const auto reply = predict(batch, {.stop = {.iterations = 1}});
  EXPECT_EQ(reply.outcomes[0].trajectory[1], fine.outcomes[0].trajectory[1]);
}

TEST_P(PararealOnThreads, SplitByItselfSaysWhatItChose) {
  std::vector<std::string> said;
  const RolloutBatch one = pushes(scene, {0.05, 0.0}, 4, 0.3), many = pushes(scene, {0.05, 0.0}, 4, 0.3, 16, 0.01);
  PararealPool sut(threads, {.stop = {.iterations = 1},
                             .split_by_itself = true,
                             .on_split = [&](const std::string& why) { said.push_back(why); }});
  ASSERT_TRUE(sut.load(scene));
  ASSERT_TRUE(sut.run(one, soon()));
  const auto whole = sut.run(many, soon());
  ASSERT_TRUE(whole);
  ASSERT_EQ(said.size(), 2u);
  EXPECT_THAT(said[0], HasSubstr("1 samples x 4 steps on 2 workers: 0 whole, 1 in slices"));
  EXPECT_THAT(said[1], HasSubstr("16 whole, 0 in slices"));
  EXPECT_EQ(fingerprints(*whole), fingerprints(threads.run(many, soon()).value()));
}

INSTANTIATE_TEST_SUITE_P(Sliders, PararealOnThreads, ::testing::Values(1, 4),
                         [](const auto& test) { return std::to_string(test.param); });

TEST(PararealPool, RefusesWhatItCannotPredict) {
  ThreadPool threads(1);
  PararealPool sut(threads, {});
  const auto no_pusher = sut.load(small_scene());
  ASSERT_FALSE(no_pusher);
  EXPECT_THAT(no_pusher.error().message, HasSubstr("wanted a disc that moves in the plane"));
}

// An engine that loses every slice that starts where `lost` says.
class LosingPool final : public AsyncPool {
 public:
  explicit LosingPool(AsyncPool& engine) : engine_(engine) {}
  Result<Hash> load(const Scene& scene) override { return engine_.load(scene); }
  PoolStatus status() const override { return engine_.status(); }
  Result<std::unique_ptr<Ticket>> submit(const RolloutBatch& batch, OnReply on_reply) override {
    return engine_.submit(batch, [is_lost = lost(batch), reply = std::move(on_reply)](Result<BatchReply> result) {
      if (result && is_lost) {
        result->outcomes.front().end = End::kDiverged;
        result->outcomes.front().reason = "told to diverge";
      }
      reply(std::move(result));
    });
  }
  std::function<bool(const RolloutBatch&)> lost;

 private:
  AsyncPool& engine_;
};

TEST(PararealPool, SliceThatDivergesEndsItsSampleAndNoOther) {
  const Scene scene = one_slider();
  ThreadPool threads(2);
  LosingPool losing(threads);
  RolloutBatch batch = pushes(scene, {0.05, 0.0}, 3, 0.2, 3, 0.01);
  const std::vector<double> second = sample_controls(batch.nominal, batch.law, 1).values;
  losing.lost = [&](const RolloutBatch& slice) { return slice.nominal.values[0] == second[2]; };  // its step 1
  PararealPool sut(losing, {.stop = {.iterations = 2}});
  ASSERT_TRUE(sut.load(scene));

  const auto reply_result = sut.run(batch, soon());

  ASSERT_TRUE(reply_result) << reply_result.error().message;
  EXPECT_EQ(reply_result->outcomes[0].end, End::kCompleted);
  EXPECT_EQ(reply_result->outcomes[1].end, End::kDiverged);
  EXPECT_THAT(reply_result->outcomes[1].reason, HasSubstr("told to diverge"));
  EXPECT_EQ(reply_result->outcomes[1].cost, kInfinity);
  EXPECT_EQ(reply_result->outcomes[2].end, End::kCompleted);
}

TEST(Split, OneSampleGoesAcrossTime) {
  const SplitProblem problem{.samples = 1, .steps = 4, .workers = 4, .iterations = 1, .coarse = 1e-6, .fine = 0.01};
  const Split split = choose_split(problem);
  EXPECT_EQ(split.sliced, 1);
  EXPECT_NEAR(split.seconds, 0.01, 1e-4);
  EXPECT_NEAR(split.all_whole, 0.04, 1e-9);
  EXPECT_NEAR(split.speed_up, 4.0, 0.01);
}

TEST(Split, ManySamplesGoAcrossWorkers) {
  const Split split =
      choose_split({.samples = 20, .steps = 4, .workers = 4, .iterations = 2, .coarse = 1e-6, .fine = 0.01});
  EXPECT_EQ(split.whole, 20);
}

TEST(Split, TheRestOfABatchIsSliced) {
  // Four whole samples fill four workers; the fifth would keep three of them idle.
  const Split split =
      choose_split({.samples = 5, .steps = 4, .workers = 4, .iterations = 1, .coarse = 1e-6, .fine = 0.01});
  EXPECT_GT(split.sliced, 0);
  EXPECT_LT(split.seconds, split.all_whole);
}

TEST(Split, SpeedUpIsEq64) {
  EXPECT_DOUBLE_EQ(parareal_speed_up(1, 4, 4, 0.0, 1.0), 4.0);
  EXPECT_DOUBLE_EQ(parareal_speed_up(2, 4, 4, 0.1, 1.0), 1 / (0.3 + 0.5));
  EXPECT_DOUBLE_EQ(parareal_speed_up(1, 2, 8, 0.0, 1.0), 2.0);
}

}  // namespace
}  // namespace jostle::tests
