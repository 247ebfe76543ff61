// The network that is shipped, on pushes of a seed that it was not trained with.

#include <gmock/gmock.h>

#include <filesystem>

#include "physics_pool/local/thread_pool.hpp"
#include "services/studies/train_coarse/collect.hpp"
#include "services/studies/train_coarse/examples.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::studies {
namespace {

const std::filesystem::path kNetwork = std::filesystem::path(JOSTLE_SOURCE_DIR) / "models/coarse-sliders.net";

TEST(CoarseSliders, FitsIntoAMebibyte) { EXPECT_LT(std::filesystem::file_size(kNetwork), 1u << 20); }

// Half of the pushed sliders within 2 mm: README of physics_pool/coarse/learned has the numbers.
TEST(CoarseSliders, PredictsPushesItHasNotSeen) {
  const auto network = physics_pool::load_network(kNetwork);
  ASSERT_TRUE(network) << network.error().message;
  const tests::TempFolder folder;
  physics_pool::ThreadPool pool(2);
  const auto collected = collect(pool, folder.path() / "a", {.origin = {.seed = 4711}, .samples = 320}, {});
  ASSERT_TRUE(collected) << collected.error().message;
  const auto sut = accuracy_of(*network, *read_transitions(folder.path() / "a"), Part::kAll, 0.5);
  ASSERT_EQ(sut.size(), 4u);
  for (const Accuracy& row : sut) {
    EXPECT_GT(row.pushed, 30u);
    EXPECT_LT(row.median, 0.002) << row.sliders << " sliders";
    EXPECT_LT(row.mean, row.mean_way / 4) << row.sliders << " sliders";
  }
}

}  // namespace
}  // namespace jostle::studies
