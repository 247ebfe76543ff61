#pragma once
/// \file
/// SequenceSet: which samples of one writer were seen.

#include <cstdint>
#include <iterator>
#include <map>

namespace jostle::bags {

/// A SequenceSet remembers numbers that come roughly in order, with up to a thousand gaps. Older gaps are forgotten:
/// they stay gaps.
class SequenceSet {
 public:
  /// Takes in a number. False for one that was here before, or that is older than what is remembered.
  bool insert(std::uint64_t number) {
    if (number < oldest_) return false;
    auto next = spans_.upper_bound(number);
    const auto span = next == spans_.begin() ? spans_.end() : std::prev(next);
    if (span != spans_.end() && number <= span->second) return false;
    if (first_ == 0 || number < first_) first_ = number;
    if (number > last_) last_ = number;
    ++count_;
    const bool joins_next = next != spans_.end() && next->first == number + 1;
    if (span != spans_.end() && span->second + 1 == number) {
      span->second = joins_next ? next->second : number;
      if (joins_next) spans_.erase(next);
    } else if (joins_next) {
      const std::uint64_t end = next->second;
      spans_.erase(next);
      spans_[number] = end;
    } else {
      spans_[number] = number;
    }
    if (spans_.size() > kMostSpans) {
      spans_.erase(spans_.begin());
      oldest_ = spans_.begin()->first;
    }
    return true;
  }

  /// Counts the numbers that are missing between the first and the last one seen.
  std::uint64_t missing() const { return count_ == 0 ? 0 : last_ - first_ + 1 - count_; }

 private:
  static constexpr std::size_t kMostSpans = 1000;

  std::map<std::uint64_t, std::uint64_t> spans_;  // first to last, without gaps in between
  std::uint64_t first_ = 0, last_ = 0, count_ = 0;
  std::uint64_t oldest_ = 0;  // below: not remembered
};

}  // namespace jostle::bags
