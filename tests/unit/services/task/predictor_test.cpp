#include <gmock/gmock.h>

#include "physics_pool/local/thread_pool.hpp"
#include "services/task/config/predictor.hpp"
#include "tests/support/pushing.hpp"

namespace jostle::tests {
namespace {

using ::testing::HasSubstr;

TEST(Predictor, KnowsItsWords) {
  physics_pool::ThreadPool threads(1);
  const auto scene = pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)});
  for (const char* text : {"fine", "coarse", "coarse,kinematic", "parareal:1", "parareal:2,limit-surface",
                           "parareal:adaptive", "parareal:3,planar,split", "parareal:adaptive,split"}) {
    auto predictor_result = task::Predictor::make(text, threads);
    ASSERT_TRUE(predictor_result) << text;
    EXPECT_TRUE(predictor_result->pool().load(scene)) << text;
    EXPECT_EQ(&predictor_result->pool() == &threads, std::string(text) == "fine") << text;
  }
}

TEST(Predictor, NamesWhatIsWrong) {
  physics_pool::ThreadPool threads(1);
  for (const char* text : {"", "oracle", "parareal", "parareal:", "parareal:0", "parareal:2x", "parareal:-1",
                           "coarse,a,b", "fine,planar", "coarse:2"}) {
    const auto predictor_result = task::Predictor::make(text, threads);
    ASSERT_FALSE(predictor_result) << text;
    EXPECT_THAT(predictor_result.error().message, HasSubstr("parareal:K[,MODEL]")) << text;
  }
}

TEST(Predictor, UnknownModelIsToldWhenAWorldIsLoaded) {
  physics_pool::ThreadPool threads(1);
  auto predictor_result = task::Predictor::make("coarse,astrology", threads);
  ASSERT_TRUE(predictor_result);
  const auto hash_result = predictor_result->pool().load(pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)}));
  ASSERT_FALSE(hash_result);
  EXPECT_THAT(hash_result.error().message, HasSubstr("got 'astrology'"));
}

}  // namespace
}  // namespace jostle::tests
