#pragma once
/// \file
/// Definitions: which topic a channel of an MCAP file is, at every place of the file.

#include <algorithm>
#include <compare>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "services/bags/format/bag_reader.hpp"
#include "services/bags/format/findings.hpp"
#include "services/bags/format/mcap_format.hpp"

namespace jostle::bags::mcap {

/// Where a record is: in the block that begins at byte `block` of the file, `offset` bytes behind the beginning of
/// the block's records.
struct Position {
  std::uint64_t block = 0, offset = 0;
  auto operator<=>(const Position&) const = default;
};

/// What the numbers of one kind stand for. A number should stand for one thing in the whole file; in files that
/// were put together it may stand for another one from some place on.
template <class T>
class ById {
 public:
  void set(std::uint16_t id, const Position& from, T value) {
    auto& history = history_[id];
    if (history.empty() || !(history.back().second == value)) history.emplace_back(from, std::move(value));
  }
  void set_in_summary(std::uint16_t id, T value) { summary_.insert_or_assign(id, std::move(value)); }

  /// What a number stands for at a place: as it was told last before it, else as the summary has it; null if nobody
  /// has told.
  const T* at(std::uint16_t id, const Position& place) const {
    if (const auto known = history_.find(id); known != history_.end()) {
      const auto after = std::ranges::upper_bound(known->second, place, {}, &std::pair<Position, T>::first);
      if (after != known->second.begin()) return &std::prev(after)->second;
    }
    return in_summary(id);
  }
  const T* in_summary(std::uint16_t id) const {
    const auto known = summary_.find(id);
    return known == summary_.end() ? nullptr : &known->second;
  }
  void forget_data() { history_.clear(); }
  /// How many numbers stand for something.
  std::size_t count() const {
    std::size_t count = summary_.size();
    for (const auto& [id, unused] : history_) count += summary_.contains(id) ? 0 : 1;
    return count;
  }

 private:
  std::map<std::uint16_t, std::vector<std::pair<Position, T>>> history_;
  std::map<std::uint16_t, T> summary_;
};

class Definitions {
 public:
  /// Takes in a Schema or a Channel of the data. `where`: for findings, which are about what is malformed, what is
  /// missing, and a number that stood for something else before.
  void take(Op op, View body, const Position& at, const std::string& where, Findings& findings);
  /// Takes in the summary's: schemas first, channels then. False for one that is malformed, or a channel whose schema
  /// the summary does not have.
  bool take_from_summary(Op op, View body);

  /// Returns the topic of a channel at a place, as an index into topics(); null if nobody has told.
  const int* topic_of(std::uint16_t channel, const Position& at) const { return channels_.at(channel, at); }
  /// Returns what the summary alone says, likewise.
  const int* topic_in_summary(std::uint16_t channel) const { return channels_.in_summary(channel); }

  /// Returns the summary's part, without counts.
  Definitions of_summary() const;

  std::vector<TopicInfo>& topics() { return topics_; }
  const std::vector<TopicInfo>& topics() const { return topics_; }
  std::size_t schemas() const { return schemas_.count(); }
  std::size_t channels() const { return channels_.count(); }

 private:
  int topic_for(const Channel& channel, const Schema* schema);

  ById<Schema> schemas_;
  ById<int> channels_;
  std::vector<TopicInfo> topics_;
  std::map<std::string, std::vector<int>> by_name_;
};

/// Makes the topic that a channel is. `schema`: null if the channel has none, or none is known.
Topic topic_of(const Channel& channel, const Schema* schema);

}  // namespace jostle::bags::mcap
