#include "services/bags/format/findings.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace jostle::bags {
namespace {

// A file may have as many reasons as it has bytes; nobody reads more than this.
constexpr std::size_t kMostReasons = 200;

}  // namespace

std::string name_of(Part part, std::uint64_t count) {
  const auto name = [&]() -> std::string {
    switch (part) {
      case Part::kFile:
        return "file";
      case Part::kChunk:
        return "chunk";
      case Part::kRecord:
        return "record";
      case Part::kUnknownRecord:
        return "unknown record";
      case Part::kSchema:
        return "schema";
      case Part::kTopic:
        return "topic";
      case Part::kMessage:
        return "message";
      case Part::kAttachment:
        return "attachment";
      case Part::kNote:
        break;
    }
    return "note";
  }();
  return count == 1 ? name : name + "s";
}

std::string Finding::text() const {
  return fmt::format("{} {}{}: {}", count, name_of(part, count), is_lost ? " lost" : "", what);
}

void Findings::add_all(const std::vector<Finding>& others) {
  for (const Finding& other : others) add(other.part, other.what, "", other.count, other.is_lost);
}

bool Findings::any_lost() const { return std::ranges::any_of(list_, &Finding::is_lost); }

std::uint64_t Findings::count_lost(Part part) const {
  std::uint64_t count = 0;
  for (const Finding& finding : list_) {
    if (finding.part == part && finding.is_lost) count += finding.count;
  }
  return count;
}

void Findings::add(Part part, const std::string& reason, const std::string& where, std::uint64_t count, bool is_lost) {
  const bool is_full = places_.size() >= kMostReasons;
  const auto key = std::pair(part, fmt::format("{}{}", is_lost ? '-' : '+', reason));
  auto place = places_.find(key);
  if (place == places_.end() && is_full) {
    place = places_.try_emplace({part, is_lost ? "-" : "+"}, list_.size()).first;  // the rest of that part
    if (place->second == list_.size()) {
      list_.push_back(
          {.part = part, .what = "for reasons beyond those that are listed", .count = 0, .is_lost = is_lost});
    }
  } else if (place == places_.end()) {
    place = places_.emplace(key, list_.size()).first;
    list_.push_back({.part = part,
                     .what = where.empty() ? reason : fmt::format("{}: {}", where, reason),
                     .count = 0,
                     .is_lost = is_lost});
  }
  list_[place->second].count += count;
}

}  // namespace jostle::bags
