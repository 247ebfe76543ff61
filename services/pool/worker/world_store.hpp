#pragma once
/// \file
/// WorldStore: a worker's worlds, as text until they are needed.

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/hash.hpp"
#include "physics_pool/local/world.hpp"

namespace jostle::pool {

/// Keeps worlds as text, and compiles a world when it is first asked for.
///
/// Threads  safe from any thread; find() compiles outside the lock, so announce()
///          never waits for it.
class WorldStore {
 public:
  /// `bytes`: room for compiled worlds that are kept; the newest one always is.
  explicit WorldStore(std::size_t bytes) : bytes_(bytes) {}

  /// Keeps a text under the name its sender gave it. Cheap. A text with another
  /// hash is refused, unless the right one is already here.
  void announce(const Hash& hash, std::string scene);

  /// Returns the compiled world; nothing while its text has not arrived.
  /// Errors   kInvalidArgument  the text has another hash, is no scene, or the
  ///          engine refuses it; the message names the hash.
  std::optional<Result<physics_pool::WorldPtr>> find(const Hash& hash);

  /// Worlds compiled and kept.
  std::vector<Hash> compiled() const;

 private:
  struct Entry {
    std::string scene;
    physics_pool::WorldPtr world;
    std::optional<Error> refusal;
    std::uint64_t used = 0;  // larger is more recent
  };

  void keep(const Hash& hash, const Result<physics_pool::WorldPtr>& world_result);
  void drop_oldest_worlds();
  void drop_oldest_text();

  const std::size_t bytes_;
  mutable std::mutex mutex_;  // guards everything below
  std::map<Hash, Entry> entries_;
  std::uint64_t clock_ = 0;  // counts uses
};

}  // namespace jostle::pool
