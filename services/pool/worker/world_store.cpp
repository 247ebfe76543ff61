#include "services/pool/worker/world_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "physics_pool/scene/scene.hpp"

namespace jostle::pool {

using physics_pool::World;
using physics_pool::WorldPtr;

namespace {

constexpr std::size_t kTexts = 4096;  // a few kilobytes each

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

void WorldStore::announce(const Hash& hash, std::string scene) {
  const Hash actual = hash_of(scene);
  const std::lock_guard lock(mutex_);
  Entry& entry = entries_[hash];
  if (!entry.scene.empty()) return;  // the right text; nothing can be said better
  const bool logged = entry.refusal.has_value();
  entry = {.used = ++clock_};
  if (actual == hash) {
    entry.scene = std::move(scene);
  } else {
    entry.refusal = refused(hash, fmt::format("its text has the hash {}", to_string(actual)));
    if (!logged) fmt::print(stderr, "refused: {}\n", entry.refusal->message);
  }
  drop_oldest_text();
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
    found->second.refusal = world_result.error();
    fmt::print(stderr, "refused: {}\n", world_result.error().message);
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

void WorldStore::drop_oldest_text() {
  if (entries_.size() <= kTexts) return;
  entries_.erase(std::ranges::min_element(entries_, {}, [](const auto& e) { return e.second.used; }));
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
