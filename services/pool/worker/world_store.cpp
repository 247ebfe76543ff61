#include "services/pool/worker/world_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "physics_pool/scene/scene.hpp"
#include "services/wire/limits.hpp"

namespace jostle::pool {

using physics_pool::World;
using physics_pool::WorldPtr;

namespace limits = wire::limits;

namespace {

Error refused(const Hash& hash, const std::string& why) {
  return {Code::kInvalidArgument, fmt::format("world: {}: {}", to_string(hash), why)};
}

Result<WorldPtr> compile(const Hash& hash, const std::string& text) {
  auto scene_result = physics_pool::parse_scene(text, "scene");
  if (!scene_result) return refused(hash, scene_result.error().message);
  auto world_result = World::compile(*scene_result);
  if (!world_result) return refused(hash, world_result.error().message);
  return world_result;
}

}  // namespace

void WorldStore::announce(const Hash& hash, std::string scene, std::uint64_t client) {
  const bool too_long = scene.size() > limits::kText;
  const Hash actual = too_long ? Hash{} : hash_of(scene);
  const std::lock_guard lock(mutex_);
  const auto [found, is_new] = entries_.try_emplace(hash);
  Entry& entry = found->second;
  if (!entry.scene.empty()) return;  // the right text; nothing can be said better
  if (!is_new) count(entry, -1);
  entry = {.client = client, .used = ++clock_};
  if (too_long) {
    refuse(entry, refused(hash, fmt::format("its text: got {} bytes, wanted at most {}", scene.size(), limits::kText)));
  } else if (actual != hash) {
    refuse(entry, refused(hash, fmt::format("its text has the hash {}", to_string(actual))));
  } else {
    entry.scene = std::move(scene);
  }
  count(entry, 1);
  make_room();
}

void WorldStore::refuse(Entry& entry, Error error) {
  refusals_.note("refused: {}", error.message);
  entry.refusal = std::move(error);
}

std::optional<Result<WorldPtr>> WorldStore::find(const Hash& hash) {
  std::string text;
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(hash);
    if (found == entries_.end()) return {};
    Entry& entry = found->second;
    entry.used = ++clock_;
    if (entry.refusal) return *entry.refusal;
    if (entry.world) return entry.world;
    text = entry.scene;
  }
  auto world_result = compile(hash, text);
  keep(hash, world_result);
  return world_result;
}

void WorldStore::keep(const Hash& hash, const Result<WorldPtr>& world_result) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(hash);
  if (found == entries_.end()) return;  // dropped meanwhile
  if (world_result) {
    found->second.world = *world_result;
    drop_oldest_worlds();
  } else {
    refuse(found->second, world_result.error());
  }
}

void WorldStore::drop_oldest_worlds() {
  std::vector<Entry*> compiled;
  for (auto& [hash, entry] : entries_) {
    if (entry.world) compiled.push_back(&entry);
  }
  std::ranges::sort(compiled, std::greater(), [](const Entry* entry) { return entry->used; });
  std::size_t sum = 0;
  for (std::size_t i = 0; i < compiled.size(); ++i) {
    sum += compiled[i]->world->bytes();
    if (i > 0 && sum > bytes_) compiled[i]->world.reset();
  }
}

void WorldStore::count(const Entry& entry, int sign) {
  Share& share = shares_[entry.client];
  share.worlds += static_cast<std::size_t>(sign);  // wraps to what was there before
  share.bytes += static_cast<std::size_t>(sign) * entry.scene.size();
  text_bytes_ += static_cast<std::size_t>(sign) * entry.scene.size();
  if (share.worlds == 0) shares_.erase(entry.client);
}

// One entry came, so one or a few go.
void WorldStore::make_room() {
  const auto most_worlds = [](const auto& share) { return share.second.worlds; };
  const auto most_bytes = [](const auto& share) { return share.second.bytes; };
  for (auto most = std::ranges::max_element(shares_, {}, most_worlds);
       most->second.worlds > limits::kWorldsPerClient || entries_.size() > limits::kWorlds;
       most = std::ranges::max_element(shares_, {}, most_worlds)) {
    drop_oldest_text_of(most->first);
  }
  while (text_bytes_ > limits::kWorldTexts) {
    drop_oldest_text_of(std::ranges::max_element(shares_, {}, most_bytes)->first);
  }
}

void WorldStore::drop_oldest_text_of(std::uint64_t client) {
  auto oldest = entries_.end();
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    if (entry->second.client != client) continue;
    if (oldest == entries_.end() || entry->second.used < oldest->second.used) oldest = entry;
  }
  count(oldest->second, -1);
  entries_.erase(oldest);
}

std::vector<Hash> WorldStore::compiled() const {
  const std::lock_guard lock(mutex_);
  std::vector<Hash> hashes;
  for (const auto& [hash, entry] : entries_) {
    if (entry.world) hashes.push_back(hash);
  }
  return hashes;
}

}  // namespace jostle::pool
