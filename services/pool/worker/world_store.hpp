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
#include "services/common/process/trouble.hpp"

namespace jostle::pool {

/// Keeps worlds as text, and compiles a world when it is first asked for. Texts have limits (services/wire/limits.hpp):
/// so many bytes each, so many worlds of one client, so many bytes in all; whoever takes the most room loses first,
/// what it used longest ago.
///
/// Threads  safe from any thread; find() compiles outside the lock, so announce()
///          never waits for it.
class WorldStore {
 public:
  /// `bytes`: room for compiled worlds that are kept; the newest one always is.
  explicit WorldStore(std::size_t bytes) : bytes_(bytes) {}

  /// Keeps a text under the name that a client gave it. Cheap. A text with another
  /// hash, or one that is too long, is refused, unless the right one is already here.
  void announce(const Hash& hash, std::string scene, std::uint64_t client);

  /// Returns the compiled world; nothing while its text has not arrived.
  /// Errors   kInvalidArgument  the text has another hash, is too long, is no scene, or the
  ///          engine refuses it; the message names the hash.
  std::optional<Result<physics_pool::WorldPtr>> find(const Hash& hash);

  /// Worlds compiled and kept.
  std::vector<Hash> compiled() const;

  /// Writes to the log what was refused since the last time.
  void say_refusals() { refusals_.say(); }

 private:
  struct Entry {
    std::uint64_t client = 0;  // that announced it
    std::string scene;
    physics_pool::WorldPtr world;
    std::optional<Error> refusal;
    std::uint64_t used = 0;  // larger is more recent
  };
  /// What one client takes.
  struct Share {
    std::size_t worlds = 0;
    std::size_t bytes = 0;
  };

  void keep(const Hash& hash, const Result<physics_pool::WorldPtr>& world_result);
  void refuse(Entry& entry, Error error);
  void drop_oldest_worlds();
  void make_room();
  void drop_oldest_text_of(std::uint64_t client);
  void count(const Entry& entry, int sign);

  const std::size_t bytes_;
  mutable std::mutex mutex_;  // guards everything below
  std::map<Hash, Entry> entries_;
  std::map<std::uint64_t, Share> shares_;  // by client
  std::size_t text_bytes_ = 0;             // of all
  std::uint64_t clock_ = 0;                // counts uses
  common::Trouble refusals_{"worlds were refused"};
};

}  // namespace jostle::pool
