#pragma once
/// \file
/// Roll: the workers of a domain, as their heartbeats have them.

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "idl/msg/pool.h"
#include "idl/types/time.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::pool {

/// A worker of the roll.
struct WorkerLine {
  struct Client {
    std::uint64_t id = 0;  ///< its participant
    std::string text;      ///< who it is, as far as it is known
    std::uint32_t samples = 0;
  };

  std::uint64_t id = 0;
  std::string name, host, version;
  std::uint32_t pid = 0;
  std::uint32_t threads = 0, busy = 0;
  double load = 0.0;            ///< of its host: processes that run or want to, mean of a minute
  std::optional<double> rate;   ///< rollouts per second, where it was heard for long enough
  std::uint64_t rollouts = 0;   ///< since its start
  std::vector<Client> clients;  ///< with samples there; those that only listen are not served
};

/// Takes heartbeats in, as many workers of a participant and in all as limits.hpp allows. Threads: one at a time.
class Roll {
 public:
  using FindParticipant = std::function<std::optional<wire::ParticipantInfo>(std::uint64_t)>;

  explicit Roll(FindParticipant find) : find_(std::move(find)) {}

  void hear(const jostle_msgs::msg::WorkerHeartbeat& heartbeat, std::uint64_t writer, TimePoint now);

  /// Returns those that are there: heard within the last second. By host and name. Rates are those since the last call,
  /// or since a worker was heard first.
  std::vector<WorkerLine> call(TimePoint now);

 private:
  struct Entry {
    WorkerLine line;
    std::uint64_t writer = 0;  // participant
    TimePoint heard;
    TimePoint since;             // of the rate
    std::uint64_t rollouts = 0;  // then
  };

  FindParticipant find_;
  std::map<std::uint64_t, Entry> entries_;
};

/// Returns the lines as a table for people, with a head; ends with a newline.
std::string to_table(const std::vector<WorkerLine>& lines);

nlohmann::json to_json(const std::vector<WorkerLine>& lines);

}  // namespace jostle::pool
