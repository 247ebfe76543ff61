#include "services/studies/train_coarse/collect.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/local/thread_pool.hpp"
#include "services/studies/train_coarse/episode.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::studies {
namespace {

namespace fs = std::filesystem;

// Six milliseconds of physics per step do for what is tested here.
CollectOptions quick(std::uint64_t samples, int in_flight = 2) {
  return {.origin = {.duration = 0.02, .time_step = 0.002}, .samples = samples, .in_flight = in_flight};
}

std::array<float, kPlanarSize> start_of(const physics_pool::RolloutBatch& batch, int sliders) {
  return transitions_of(batch, {batch.x0, batch.x0}, sliders).front().before;
}

TEST(DrawEpisode, PutsNothingIntoAnythingElse) {
  const DataOrigin origin;
  for (std::uint32_t episode = 0; episode < 400; ++episode) {
    const auto batch = draw_episode(origin, episode, 0);
    EXPECT_GE(clearance(origin, start_of(batch, episode_sliders(episode)), episode_sliders(episode)), -1e-6) << episode;
  }
}

TEST(DrawEpisode, IsAFunctionOfItsNumberAndAttempt) {
  const DataOrigin origin;
  const auto sut = draw_episode(origin, 7, 0);
  EXPECT_EQ(sut.x0, draw_episode(origin, 7, 0).x0);
  EXPECT_EQ(sut.nominal, draw_episode(origin, 7, 0).nominal);
  EXPECT_NE(sut.x0, draw_episode(origin, 11, 0).x0);
  EXPECT_NE(sut.x0, draw_episode(origin, 7, 1).x0);
  EXPECT_NE(sut.x0, draw_episode({.seed = 2}, 7, 0).x0);
}

TEST(DrawEpisode, KeepsToTheSpeed) {
  const DataOrigin origin;
  double fastest = 0.0;
  for (std::uint32_t episode = 0; episode < 400; ++episode) {
    const auto batch = draw_episode(origin, episode, 0);
    for (int t = 0; t < kEpisodeSteps; ++t) {
      const auto u = batch.nominal.step(t);
      fastest = std::max(fastest, std::hypot(u[0], u[1]));
    }
  }
  EXPECT_LE(fastest, 0.1 * std::sqrt(2.0));
  EXPECT_GT(fastest, 0.13);
}

TEST(DrawEpisode, AimsAtSlidersMostly) {
  const DataOrigin origin;
  int touching = 0;
  for (std::uint32_t episode = 0; episode < 400; ++episode) {
    const auto batch = draw_episode(origin, episode, 0);
    const int sliders = episode_sliders(episode);
    auto end = start_of(batch, sliders);
    for (int part = 0; part < 50 && clearance(origin, end, sliders) > -0.001; ++part) {
      for (std::size_t axis = 0; axis < 2; ++axis) end[axis] += static_cast<float>(batch.nominal.step(0)[axis] / 50);
    }
    touching += clearance(origin, end, sliders) <= -0.001;
  }
  EXPECT_GT(touching, 200);
  EXPECT_LT(touching, 380);
}

class CollectTest : public testing::Test {
 protected:
  std::string collected(const std::string& name, const CollectOptions& options) {
    const auto result = collect(pool_, folder_.path() / name, options, {});
    EXPECT_TRUE(result) << result.error().message;
    return tests::contents(folder_.path() / name);
  }

  tests::TempFolder folder_;
  physics_pool::ThreadPool pool_{2};
};

TEST_F(CollectTest, GivesFilesThatDoNotDependOnInterruptions) {
  const std::string whole = collected("whole", quick(64));
  EXPECT_EQ(whole.size(), 96u + 64 * sizeof(Transition));
  collected("resumed", quick(12));
  fs::resize_file(folder_.path() / "resumed", fs::file_size(folder_.path() / "resumed") - 100);
  EXPECT_EQ(collected("resumed", quick(64)), whole);
}

TEST_F(CollectTest, GivesFilesThatDoNotDependOnTheNumberOfThreads) {
  EXPECT_EQ(collected("one", quick(48, 1)), collected("five", quick(48, 5)));
}

TEST_F(CollectTest, KeepsWhatIsFinishedWhenItIsStopped) {
  std::stop_source stop;
  const auto file = folder_.path() / "a";
  const auto result = collect(pool_, file, quick(100'000), stop.get_token(), [&](const CollectProgress& progress) {
    if (progress.done >= 20) stop.request_stop();
  });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kCancelled);
  const auto data = read_transitions(file);
  ASSERT_TRUE(data) << data.error().message;
  EXPECT_GE(data->transitions.size(), 20u);
  EXPECT_LT(data->transitions.size(), 100'000u);
}

TEST_F(CollectTest, NotesStatesThatFollowEachOther) {
  collected("a", quick(32));
  const auto data = read_transitions(folder_.path() / "a");
  const auto& transitions = data->transitions;
  for (std::size_t i = 0; i < transitions.size(); ++i) {
    EXPECT_EQ(transitions[i].sliders, 1 + (i / kEpisodeSteps) % kMaxSliders);
    if (i % kEpisodeSteps > 0) {
      EXPECT_EQ(transitions[i].before, transitions[i - 1].after) << i;
    }
    // The drive is up to speed within 4 ms.
    EXPECT_NEAR(transitions[i].after[0] - transitions[i].before[0], 0.02f * transitions[i].control[0], 2e-3f);
  }
}

}  // namespace
}  // namespace jostle::studies
