#pragma once
/// \file
/// Datagrams as a network brings them, judged before the middleware reads them.

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <span>
#include <unordered_map>

#include "services/wire/dds/guid.hpp"
#include "services/wire/limits.hpp"

namespace jostle::wire {

/// What is wrong with a datagram.
enum class Flaw {
  kNone,
  kMalformed,   ///< no RTPS, or a part that is longer than what is left or shorter than it must be
  kStatistics,  ///< a submessage of the middleware's statistics that is not the last
  kNumber,      ///< a sequence number that its writer cannot have reached, or a range that it cannot have left out
  kFragments    ///< of a sample larger, or cut into more pieces, than there are
};

/// Returns a flaw in words, for a log.
const char* to_string(Flaw flaw);

/// A Judge keeps from Fast DDS 2.9.1 what it does not survive: a statistics submessage that is not the last ends the
/// process by an assertion; after a heartbeat, a gap or a sample of an absurd number a receiving thread counts up to
/// it one by one; a sample that claims 4 GiB is allocated. It reads the frame of an RTPS message (OMG DDSI-RTPS 2.5,
/// 8.3 and 9.4), never payloads. Numbers are compared with those their writer has had, as limits.hpp says.
///
/// What is encrypted as a whole (protected domains) is only seen as such: its numbers were written by somebody who has
/// the key. What a stranger sends to a protected domain is not encrypted, and is judged.
///
/// Threads  safe from any thread: each socket has one of its own.
class Judge {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  Flaw judge(std::span<const std::uint8_t> datagram, TimePoint now);

 private:
  /// A writer's number so far, and how far it may go at once.
  struct Progress {
    std::int64_t number = 0;
    std::int64_t budget = 0;
    TimePoint heard;
  };
  struct HashGuid {
    std::size_t operator()(const Guid& guid) const;
  };

  bool may_begin_at(std::int64_t number, TimePoint now);
  bool plausible(const Guid& writer, std::int64_t number, std::int64_t left_out, TimePoint now);
  void forget_silent(TimePoint now);

  std::mutex mutex_;  // guards everything below
  std::unordered_map<Guid, Progress, HashGuid> writers_;
  std::int64_t first_budget_ = limits::kFirstNumber;  // of numbers of writers that are heard for the first time
  TimePoint first_heard_;
};

}  // namespace jostle::wire
