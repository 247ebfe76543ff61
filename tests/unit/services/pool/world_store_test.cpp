// Worlds of many clients in one worker.

#include "services/pool/worker/world_store.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "services/wire/limits.hpp"
#include "tests/support/batches.hpp"

namespace jostle::pool {
namespace {

using ::testing::HasSubstr;
namespace limits = wire::limits;

// A text that is no scene: what it is worth is only known when somebody asks for it.
std::string text_of(int number, std::size_t bytes = 10) {
  return fmt::format("# {}\n", number) + std::string(bytes, 'x');
}

class WorldStores : public ::testing::Test {
 protected:
  bool has(const Hash& hash) { return sut.find(hash).has_value(); }

  Hash announce(const std::string& text, std::uint64_t client) {
    const Hash hash = hash_of(text);
    sut.announce(hash, text, client);
    return hash;
  }

  WorldStore sut{std::size_t{1} << 20};
};

TEST_F(WorldStores, CompileAWorldWhenItIsAskedFor) {
  const Hash hash = announce(physics_pool::to_yaml(tests::small_scene()), 1);
  const auto world_result = sut.find(hash);
  ASSERT_TRUE(world_result);
  ASSERT_TRUE(*world_result) << world_result->error().message;
  EXPECT_EQ(sut.compiled(), std::vector{hash});
}

TEST_F(WorldStores, RefuseTextsThatAreTooLongAndSaySo) {
  const Hash hash = announce(std::string(limits::kText + 1, '['), 1);
  const auto world_result = sut.find(hash);
  ASSERT_TRUE(world_result);
  ASSERT_FALSE(*world_result);
  EXPECT_THAT(world_result->error().message, HasSubstr(fmt::format("got {} bytes", limits::kText + 1)));
}

TEST_F(WorldStores, TakeTheRightTextAfterAWrongOne) {
  const std::string text = physics_pool::to_yaml(tests::small_scene());
  sut.announce(hash_of(text), "a lie", 1);
  EXPECT_FALSE(*sut.find(hash_of(text)));

  announce(text, 2);

  EXPECT_TRUE(*sut.find(hash_of(text)));
}

TEST_F(WorldStores, ThatOneClientFillsLoseHisAndNobodyElses) {
  const Hash ours = announce(text_of(-1), 1);
  const Hash his_first = announce(text_of(0), 2);
  for (int i = 1; i <= static_cast<int>(limits::kWorldsPerClient); ++i) announce(text_of(i), 2);
  EXPECT_TRUE(has(ours));
  EXPECT_FALSE(has(his_first));
}

TEST_F(WorldStores, KeepSoManyBytesOfTextsAndNoMore) {
  const Hash ours = announce(text_of(-1), 1);
  constexpr std::size_t kLarge = limits::kText / 2;
  const int count = 2 * static_cast<int>(limits::kWorldTexts / kLarge);
  std::vector<Hash> his;
  for (int i = 0; i < count; ++i) his.push_back(announce(text_of(i, kLarge), 2));
  EXPECT_TRUE(has(ours));
  EXPECT_FALSE(has(his.front()));
  EXPECT_TRUE(has(his.back()));
  const auto kept = std::ranges::count_if(his, [&](const Hash& hash) { return has(hash); });
  EXPECT_LE(static_cast<std::size_t>(kept) * kLarge, limits::kWorldTexts);
}

}  // namespace
}  // namespace jostle::pool
