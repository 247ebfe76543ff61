#pragma once
/// \file
/// Findings: parts of a bag that are not as they should be, each judged on its own.

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace jostle::bags {

/// The kinds of parts that a bag is made of.
enum class Part { kFile, kChunk, kRecord, kUnknownRecord, kSchema, kTopic, kMessage, kAttachment, kNote };
inline constexpr int kParts = 9;

/// Names parts of a kind, such as "messages"; "message" for one.
std::string name_of(Part part, std::uint64_t count);

struct Finding {
  Part part = Part::kFile;
  std::string what;         ///< where the first one is, what was got and what was wanted
  std::uint64_t count = 1;  ///< parts of which it is true
  bool is_lost = true;      ///< they are not given out; else they are, all the same

  /// "3 messages lost: …", or "one topic: …".
  std::string text() const;
};

/// Collects findings: those of one part and reason are one, with a count.
class Findings {
 public:
  /// Takes in a finding about a part that is not given out. `where` is kept of the first one of a reason.
  void lost(Part part, const std::string& reason, const std::string& where, std::uint64_t count = 1) {
    add(part, reason, where, count, true);
  }
  /// Takes in a finding about a part that is given out all the same.
  void flawed(Part part, const std::string& reason, const std::string& where, std::uint64_t count = 1) {
    add(part, reason, where, count, false);
  }
  void add_all(const std::vector<Finding>& others);

  const std::vector<Finding>& list() const { return list_; }
  bool empty() const { return list_.empty(); }
  bool any_lost() const;
  std::uint64_t count_lost(Part part) const;

 private:
  void add(Part part, const std::string& reason, const std::string& where, std::uint64_t count, bool is_lost);

  std::vector<Finding> list_;
  std::map<std::pair<Part, std::string>, std::size_t> places_;  // in list_, by part and reason
};

}  // namespace jostle::bags
