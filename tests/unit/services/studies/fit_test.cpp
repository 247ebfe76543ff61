#include "services/studies/train_coarse/fit.hpp"

#include <gmock/gmock.h>

#include "physics_pool/local/thread_pool.hpp"
#include "services/studies/train_coarse/collect.hpp"
#include "services/studies/train_coarse/examples.hpp"
#include "tests/support/networks.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::studies {
namespace {

// Short steps of coarse physics: enough to fit to, quick to make.
class FitTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    const tests::TempFolder folder;
    physics_pool::ThreadPool pool(2);
    const CollectOptions options{.origin = {.duration = 0.05, .time_step = 0.005, .max_speed = 1.0}, .samples = 960};
    const auto collected = collect(pool, folder.path() / "a", options, {});
    ASSERT_TRUE(collected) << collected.error().message;
    data_ = std::move(read_transitions(folder.path() / "a")).value();
  }

  void SetUp() override { ASSERT_TRUE(can_fit()) << "built without libtorch"; }

  static inline TransitionFile data_;
};

TEST_F(FitTest, LowersTheLossAndGivesANetworkOfTheThesissShape) {
  std::vector<double> losses;
  const auto sut = fit(data_, {.epochs = 8, .batch_size = 64, .threads = 1}, {},
                       [&](const FitProgress& progress) { losses.push_back(progress.loss); });
  ASSERT_TRUE(sut) << sut.error().message;
  ASSERT_EQ(losses.size(), 8u);
  EXPECT_LT(losses.back(), 0.8 * losses.front());
  std::vector<int> widths;
  for (const auto& layer : sut->layers) widths.push_back(layer.outputs);
  EXPECT_THAT(widths, testing::ElementsAre(512, 256, 128, 64, 24));
  EXPECT_EQ(sut->samples, 960u);
  EXPECT_TRUE(physics_pool::parse_network(to_file(*sut), "fitted"));
}

TEST_F(FitTest, GivesEqualNetworksForEqualSeeds) {
  const FitOptions options{.epochs = 1, .batch_size = 128, .threads = 1};
  EXPECT_EQ(to_file(*fit(data_, options, {})), to_file(*fit(data_, options, {})));
}

TEST_F(FitTest, ForwardPassIsLibtorchs) {
  const auto network = fit(data_, {.epochs = 1, .batch_size = 128, .threads = 1}, {});
  ASSERT_TRUE(network) << network.error().message;
  const auto sut = largest_difference(*network, data_);
  ASSERT_TRUE(sut) << sut.error().message;
  EXPECT_LE(*sut, 1e-5);
  EXPECT_LE(*largest_difference(tests::random_network(13), data_), 1e-5);
}

TEST_F(FitTest, StopsWhenItIsTold) {
  std::stop_source stop;
  const auto sut =
      fit(data_, {.epochs = 1000, .threads = 1}, stop.get_token(), [&](const FitProgress&) { stop.request_stop(); });
  EXPECT_TRUE(sut) << "the best so far";
  const auto at_once = fit(data_, {.epochs = 1000, .threads = 1}, stop.get_token());
  ASSERT_FALSE(at_once);
  EXPECT_EQ(at_once.error().code, Code::kCancelled);
}

TEST_F(FitTest, RefusesTooFewTransitions) {
  TransitionFile few = data_;
  few.transitions.resize(100);
  const auto sut = fit(few, {}, {});
  ASSERT_FALSE(sut);
  EXPECT_THAT(sut.error().message, testing::HasSubstr("collect more"));
}

TEST(IsPart, HoldsOutWholeEpisodesOfAllNumbersOfSliders) {
  std::size_t held_out = 0;
  for (std::size_t i = 0; i < 3200; ++i) {
    EXPECT_NE(is_part(Part::kHeldOut, 0.05, i), is_part(Part::kLearn, 0.05, i));
    EXPECT_EQ(is_part(Part::kHeldOut, 0.05, i), is_part(Part::kHeldOut, 0.05, i / 16 * 16));
    held_out += is_part(Part::kHeldOut, 0.05, i);
  }
  EXPECT_EQ(held_out, 160u);
}

}  // namespace
}  // namespace jostle::studies
