#pragma once
/// \file
/// Limits: how much of the wire a process takes in. Whoever reaches a domain may send anything, and an honest peer may
/// be broken; what goes beyond these numbers is refused or left out, counted, and said once a second. All limits of
/// the system are here, so that each is said once and docs/security.md can list them.

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace jostle::wire::limits {

// --- texts ---------------------------------------------------------------------

/// Bytes of a scene or of parameters, before anybody parses them. The parser takes about 200 times as much for the
/// worst of texts; the largest honest one, a robot with all its meshes written out, has some 100 kB.
inline constexpr std::size_t kText = std::size_t{1} << 20;
/// Bytes of names and ids, and of errors, of others that are kept, shown or logged; what is longer is cut.
inline constexpr std::size_t kShown = 200;
inline constexpr std::size_t kShownError = 1000;

// --- an inbox ---------------------------------------------------------------

/// How many participants' full shares an inbox holds.
inline constexpr std::size_t kSendersPerInbox = 8;

// --- a worker ------------------------------------------------------------------

/// Bytes of worlds' texts that a worker keeps. A client has a world in use again and again, and sends its text once.
inline constexpr std::size_t kWorldTexts = std::size_t{128} << 20;
/// Worlds that a worker keeps as text, of one client and of all.
inline constexpr std::size_t kWorldsPerClient = 4096;
inline constexpr std::size_t kWorlds = 65'536;
/// Assignments of one client that are not looked at yet or wait for their world; bytes of them, and of everybody's.
inline constexpr std::size_t kWaitingPerClient = 1024;
inline constexpr std::size_t kWaitingBytesPerClient = std::size_t{16} << 20;
inline constexpr std::size_t kWaitingBytes = std::size_t{128} << 20;
/// Batches and samples of one client that a worker holds, waiting or running. A client of ours gives a thread no more
/// than some 20 samples at a time.
inline constexpr std::size_t kBatchesPerClient = 1000;
inline constexpr std::uint32_t kSamplesPerClient = 100'000;

// --- a client ------------------------------------------------------------------

/// Workers that one participant may be, that a client knows at all, and that it gets to know in one turn.
inline constexpr std::size_t kWorkersPerParticipant = 64;
inline constexpr std::size_t kWorkers = 1024;
inline constexpr std::size_t kNewWorkersPerTurn = 16;
/// Results that came and were not looked at yet.
inline constexpr std::size_t kUnreadResults = 16'384;

// --- datagrams -----------------------------------------------------------------

/// How far the sequence number of a writer may be when it is heard for the first time: that of 1000 samples a second
/// for 12 days. The middleware counts up to it one by one (75 ns each), with the receiving thread; so all such numbers
/// together may grow by so many a second, and who is beyond that has to wait.
inline constexpr std::int64_t kFirstNumber = std::int64_t{1} << 30;
inline constexpr std::int64_t kFirstNumbersPerSecond = std::int64_t{1} << 22;
/// How far the number of a writer that is heard all the time may go at once, and per second of silence.
inline constexpr std::int64_t kNumberLeap = std::int64_t{1} << 20;
inline constexpr std::int64_t kNumbersPerSecond = 1'000'000;
/// Writers whose numbers are remembered; others are judged as if they were heard for the first time.
inline constexpr std::size_t kWritersRemembered = 8192;
/// How long a participant that was not heard before, or for as long, may show from which ports it sends; later its name
/// is worth nothing from another. Ports of one participant, and participants whose ports are remembered.
inline constexpr std::chrono::seconds kShowsItsPorts{5};
inline constexpr std::size_t kPortsOfOne = 16;
inline constexpr std::size_t kParticipantsRemembered = 4096;
/// Bytes of a sample that comes in fragments, and into how many it may be cut.
inline constexpr std::uint32_t kFragmentedSample = std::uint32_t{1} << 28;
inline constexpr std::uint32_t kFragments = std::uint32_t{1} << 18;

// --- time ----------------------------------------------------------------------

/// From when on a batch of which nothing comes back says so, though workers are at it; and when it says so, and when it
/// ends, if none of them is.
inline constexpr std::chrono::seconds kBatchIsSlow{10};
inline constexpr std::chrono::seconds kBatchSaysSo{3};
inline constexpr std::chrono::seconds kBatchGivesUp{20};
/// From the end of a commander's lease on another one is obeyed; one that comes sooner waits so long.
inline constexpr std::chrono::seconds kNewcomerWaits{4};

}  // namespace jostle::wire::limits
