#pragma once
/// \file
/// Datagrams as a network brings them, judged before the middleware reads them.

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include "services/wire/dds/guid.hpp"
#include "services/wire/limits.hpp"

namespace jostle::wire {

/// What is wrong with a datagram.
enum class Flaw {
  kNone,
  kMalformed,   ///< no RTPS, or a part that is longer than what is left or shorter than it must be
  kStatistics,  ///< a submessage of the middleware's statistics that is not the last
  kNumber,      ///< a sequence number that its writer cannot have reached, or a range that it cannot have left out
  kFragments,   ///< of a sample larger, or cut into more pieces, than there are
  kImpostor     ///< in the name of a participant that sends from other ports
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
/// Who forges the numbers of a writer makes its readers deaf to it, by numbers that are not absurd. A participant sends
/// from the same few ports as long as it lives, and a stranger cannot see which; so once it has shown them, what comes
/// in its name from other ports is dropped. That keeps out who comes later and does not listen to the wire; for
/// everybody else there are protected domains.
///
/// Threads  safe from any thread: each socket has one of its own.
class Judge {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// `port`: the sender's.
  Flaw judge(std::span<const std::uint8_t> datagram, std::uint16_t port, TimePoint now);

 private:
  /// A writer's number so far, and how far it may go at once.
  struct Progress {
    std::int64_t number = 0;
    std::int64_t budget = 0;
    TimePoint heard;
  };
  /// A participant's prefix of GUIDs, as whom a datagram may speak.
  using Prefix = std::array<std::uint8_t, 12>;
  /// From where a participant has spoken, and since when it may show more of its ports.
  struct Ports {
    std::vector<std::uint16_t> known;
    TimePoint shows_since, heard;
  };
  struct HashBytes {
    std::size_t operator()(std::span<const std::uint8_t> bytes) const;
  };

  /// Who was heard, up to so many. When it is full the silent ones are forgotten, looked for once a second.
  template <class Name, class Value>
  class Heard {
   public:
    explicit Heard(std::size_t most) : most_(most) {}
    Value* find(const Name& name) {
      const auto found = all_.find(name);
      return found == all_.end() ? nullptr : &found->second;
    }
    void add(const Name& name, Value value, TimePoint now);

   private:
    std::size_t most_;
    TimePoint looked_;
    std::unordered_map<Name, Value, HashBytes> all_;
  };

  bool is_its_own(const Prefix& participant, std::uint16_t port, TimePoint now);
  bool may_begin_at(std::int64_t number, TimePoint now);
  bool plausible(const Guid& writer, std::int64_t number, std::int64_t left_out, TimePoint now);
  std::mutex mutex_;  // guards everything below
  Heard<Guid, Progress> writers_{limits::kWritersRemembered};
  Heard<Prefix, Ports> participants_{limits::kParticipantsRemembered};
  std::int64_t first_budget_ = limits::kFirstNumber;  // of numbers of writers that are heard for the first time
  TimePoint first_heard_;
};

}  // namespace jostle::wire
