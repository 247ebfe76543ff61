#include "services/wire/dds/datagrams.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "idl/types/hash.hpp"
#include "services/wire/limits.hpp"

namespace jostle::wire {
namespace {

using Bytes = std::span<const std::uint8_t>;

// Kinds of submessages, RTPS 2.5, 9.4.5.1.1; the last is Fast DDS's own.
enum Kind : std::uint8_t {
  kPad = 0x01,
  kAckNack = 0x06,
  kHeartbeat = 0x07,
  kGap = 0x08,
  kInfoTimestamp = 0x09,
  kInfoSource = 0x0c,
  kNackFragments = 0x12,
  kHeartbeatFragments = 0x13,
  kData = 0x15,
  kDataFragments = 0x16,
  kStatisticsOfFastDds = 0x80
};

constexpr std::size_t kHeader = 20;  // bytes: "RTPS", version, vendor, prefix of the GUID
constexpr std::size_t kVendor = 6;
constexpr std::size_t kPrefix = 8;
constexpr std::uint32_t kMostBits = 256;  // of a set of numbers
// Who is silent is forgotten when a table is full.
constexpr std::chrono::seconds kSilent{10}, kLook{1};

// One submessage, its header read.
struct Submessage {
  std::uint8_t kind = 0;
  bool little_endian = true;
  bool last = false;
  Bytes body;

  template <class Number>
  Number number(std::size_t at) const {
    Number value = 0;
    for (std::size_t i = 0; i < sizeof(Number); ++i) {
      const std::size_t place = little_endian ? at + sizeof(Number) - 1 - i : at + i;
      value = static_cast<Number>(value << 8 | body[place]);
    }
    return value;
  }

  // A sequence number: the high half first, whatever the byte order.
  std::int64_t sequence(std::size_t at) const {
    const auto high = static_cast<std::int32_t>(number<std::uint32_t>(at));
    return static_cast<std::int64_t>(high) * (std::int64_t{1} << 32) + number<std::uint32_t>(at + 4);
  }
};

// The submessage that begins at a place; nothing if it is longer than what is left.
std::optional<Submessage> submessage_at(Bytes datagram, std::size_t at) {
  if (datagram.size() - at < 4) return {};
  Submessage result{.kind = datagram[at], .little_endian = (datagram[at + 1] & 1) != 0};
  result.body = datagram.subspan(at, 4);
  const std::size_t length = result.number<std::uint16_t>(2), left = datagram.size() - at - 4;
  if (length > left) return {};
  result.last = length == 0 && result.kind != kInfoTimestamp && result.kind != kPad;
  result.body = datagram.subspan(at + 4, result.last ? left : length);
  return result;
}

std::size_t least_size(std::uint8_t kind) {
  switch (kind) {
    case kData:
    case kInfoSource:
      return 20;
    case kDataFragments:
      return 32;
    case kHeartbeat:
    case kGap:
      return 28;
    case kAckNack:
    case kHeartbeatFragments:
      return 24;
    case kNackFragments:
      return 28;
    default:
      return 0;
  }
}

bool is_of_fast_dds(Bytes datagram) { return datagram[kVendor] == 1 && datagram[kVendor + 1] == 15; }

// Where Fast DDS looks for its statistics it takes lengths as they are; where it reads, it rounds them up to four.
bool statistics_come_last(Bytes datagram, std::size_t round_to) {
  for (std::size_t at = kHeader; at < datagram.size();) {
    const auto submessage = submessage_at(datagram, at);
    if (!submessage || submessage->last) return true;
    const std::size_t end = at + 4 + submessage->body.size();
    if (submessage->kind == kStatisticsOfFastDds && end != datagram.size()) return false;
    at = (end + round_to - 1) / round_to * round_to;
  }
  return true;
}

// Saturates after minutes, long before anything overflows.
std::int64_t grown(std::chrono::steady_clock::duration time, std::int64_t per_second) {
  const double seconds = std::clamp(std::chrono::duration<double>(time).count(), 0.0, 1000.0);
  return static_cast<std::int64_t>(seconds * static_cast<double>(per_second));
}

}  // namespace

const char* to_string(Flaw flaw) {
  switch (flaw) {
    case Flaw::kNone:
      return "nothing";
    case Flaw::kMalformed:
      return "it is malformed";
    case Flaw::kStatistics:
      return "a statistics submessage is not its last one";
    case Flaw::kNumber:
      return "it has a sequence number that its writer cannot have reached";
    case Flaw::kFragments:
      return "it is a fragment of a sample larger than any";
    case Flaw::kImpostor:
      return "the participant whose name it bears sends from other ports";
  }
  return "";
}

std::size_t Judge::HashBytes::operator()(Bytes bytes) const {
  return hash_of(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size())).low;
}

Flaw Judge::judge(Bytes datagram, std::uint16_t port, TimePoint now) {
  if (datagram.size() < kHeader || std::memcmp(datagram.data(), "RTPS", 4) != 0) return Flaw::kMalformed;
  if (is_of_fast_dds(datagram) && !(statistics_come_last(datagram, 1) && statistics_come_last(datagram, 4))) {
    return Flaw::kStatistics;
  }
  Guid writer{};
  const auto speaks_as = [&](Bytes from) {
    Prefix prefix;
    std::copy_n(from.begin(), prefix.size(), prefix.begin());
    std::ranges::copy(prefix, writer.begin());
    return is_its_own(prefix, port, now);
  };
  if (!speaks_as(datagram.subspan(kPrefix))) return Flaw::kImpostor;
  for (std::size_t at = kHeader; at < datagram.size();) {
    const auto submessage = submessage_at(datagram, at);
    if (!submessage || submessage->body.size() < least_size(submessage->kind)) return Flaw::kMalformed;
    const Submessage& part = *submessage;
    const auto is_plausible = [&](std::size_t place_of_writer, std::int64_t number, std::int64_t left_out = 0) {
      std::copy_n(part.body.begin() + static_cast<std::ptrdiff_t>(place_of_writer), 4, writer.end() - 4);
      return plausible(writer, number, left_out, now);
    };
    switch (part.kind) {
      case kInfoSource:
        if (!speaks_as(part.body.subspan(8))) return Flaw::kImpostor;
        break;
      case kData:
        if (!is_plausible(8, part.sequence(12))) return Flaw::kNumber;
        break;
      case kDataFragments: {
        if (!is_plausible(8, part.sequence(12))) return Flaw::kNumber;
        const std::uint32_t piece = part.number<std::uint16_t>(26), sample = part.number<std::uint32_t>(28);
        if (piece == 0 || sample > limits::kFragmentedSample || sample / piece > limits::kFragments)
          return Flaw::kFragments;
        break;
      }
      case kHeartbeat: {
        const std::int64_t first = part.sequence(8), last = part.sequence(16);
        if (first < 0 || last < 0 || !is_plausible(4, std::max(first - 1, last))) return Flaw::kNumber;
        break;
      }
      case kGap: {
        const std::int64_t start = part.sequence(8), base = part.sequence(16);
        if (part.number<std::uint32_t>(24) > kMostBits) return Flaw::kMalformed;
        if (start < 0 || base < start || !is_plausible(4, base - 1, base - start)) return Flaw::kNumber;
        break;
      }
      case kHeartbeatFragments:
        if (!is_plausible(4, part.sequence(8))) return Flaw::kNumber;
        break;
      case kAckNack:
        if (part.number<std::uint32_t>(16) > kMostBits) return Flaw::kMalformed;
        if (part.sequence(8) < 0) return Flaw::kNumber;
        break;
      case kNackFragments:
        if (part.number<std::uint32_t>(20) > kMostBits) return Flaw::kMalformed;
        if (part.sequence(8) < 0) return Flaw::kNumber;
        break;
      default:
        break;
    }
    if (part.last) break;
    at += 4 + (part.body.size() + 3) / 4 * 4;
  }
  return Flaw::kNone;
}

template <class Name, class Value>
void Judge::Heard<Name, Value>::add(const Name& name, Value value, TimePoint now) {
  if (all_.size() >= most_ && now - looked_ >= kLook) {
    looked_ = now;
    std::erase_if(all_, [&](const auto& entry) { return entry.second.heard + kSilent < now; });
  }
  if (all_.size() < most_) all_.emplace(name, std::move(value));
}

bool Judge::is_its_own(const Prefix& participant, std::uint16_t port, TimePoint now) {
  const std::lock_guard lock(mutex_);
  Ports* const found = participants_.find(participant);
  if (!found) {
    participants_.add(participant, {.known = {port}, .shows_since = now, .heard = now}, now);
    return true;
  }
  Ports& ports = *found;
  if (std::ranges::find(ports.known, port) == ports.known.end()) {
    if (now - ports.heard >= limits::kShowsItsPorts) ports.shows_since = now;
    if (now - ports.shows_since >= limits::kShowsItsPorts || ports.known.size() >= limits::kPortsOfOne) return false;
    ports.known.push_back(port);
  }
  ports.heard = now;
  return true;
}

bool Judge::may_begin_at(std::int64_t number, TimePoint now) {
  if (number <= limits::kNumberLeap) return true;  // costs next to nothing
  first_budget_ =
      std::min(first_budget_ + grown(now - first_heard_, limits::kFirstNumbersPerSecond), limits::kFirstNumber);
  first_heard_ = now;
  if (number > first_budget_) return false;
  first_budget_ -= number;
  return true;
}

bool Judge::plausible(const Guid& writer, std::int64_t number, std::int64_t left_out, TimePoint now) {
  if (number < 0) return false;
  const std::lock_guard lock(mutex_);
  Progress* const found = writers_.find(writer);
  if (!found) {
    if (!may_begin_at(std::max(number, left_out), now)) return false;
    writers_.add(writer, {.number = number, .budget = limits::kNumberLeap, .heard = now}, now);
    return true;
  }
  Progress& progress = *found;
  progress.budget =
      std::min(progress.budget, limits::kNumberLeap) + grown(now - progress.heard, limits::kNumbersPerSecond);
  progress.heard = now;
  const std::int64_t price = std::max({number - progress.number, left_out, std::int64_t{0}});
  if (price > std::min(progress.budget, limits::kFirstNumber)) return false;
  progress.budget -= price;
  progress.number = std::max(progress.number, number);
  return true;
}

}  // namespace jostle::wire
