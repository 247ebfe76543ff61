// MCAP, read: the blocks that the file's index tells of, merged by log time.

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <queue>
#include <tuple>

#include "services/bags/format/input_file.hpp"
#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/mcap_format.hpp"
#include "services/bags/format/mcap_index.hpp"
#include "services/bags/format/mcap_records.hpp"

namespace jostle::bags {
namespace {

using namespace mcap;

// A message in a loaded block.
struct Entry {
  Time log_time = 0;
  std::uint64_t offset = 0;  // of its body among the block's records
  std::uint64_t size = 0;    // of its body
  int topic = 0;
};

struct Loaded {
  Bytes records;
  std::vector<Entry> entries;  // by log time; equal ones as they were written
};

class McapReader final : public FileReader {
 public:
  McapReader(InputFile file, Index index, const OpenOptions& options)
      : file_(std::move(file)), options_(options), index_(std::move(index)) {
    by_start_.resize(index_.blocks.size());
    for (std::size_t i = 0; i < by_start_.size(); ++i) by_start_[i] = i;
    std::ranges::stable_sort(by_start_, {}, [&](std::size_t block) { return index_.blocks[block].start; });
    Time latest = std::numeric_limits<Time>::min();
    for (const std::size_t block : by_start_) {
      latest_end_.push_back(latest = std::max(latest, index_.blocks[block].end));
    }
  }

  const FileInfo& info() const override { return index_.info; }

  void seek(Time from, std::vector<bool> wanted) override {
    from_ = from;
    wanted_ = std::move(wanted);
    next_block_ = 0;
    cursors_ = {};
    loaded_.clear();
  }

  Result<std::optional<Message>> next() override {
    while (true) {
      // A block that begins no later than the message at hand may hold an earlier one.
      while (next_block_ < by_start_.size() &&
             (cursors_.empty() || index_.blocks[by_start_[next_block_]].start <= cursors_.top().log_time)) {
        if (auto ok = take_up(by_start_[next_block_++]); !ok) return ok.error();
      }
      if (cursors_.empty()) return std::optional<Message>();
      const Cursor cursor = cursors_.top();
      cursors_.pop();
      const auto loaded = loaded_.find(cursor.block);
      const Entry entry = loaded->second.entries[cursor.entry];
      Message message = message_of(loaded->second, entry);
      if (!advance(cursor.block, cursor.entry + 1)) loaded_.erase(loaded);
      return std::optional(std::move(message));
    }
  }

  Result<std::optional<Message>> last_at(int topic, Time time) override {
    std::optional<Message> best;
    std::uint64_t best_offset = 0;  // of its block
    // From the last block that begins in time backwards, until none can hold a later one.
    auto it =
        std::ranges::upper_bound(by_start_, time, {}, [&](std::size_t block) { return index_.blocks[block].start; });
    while (it != by_start_.begin()) {
      --it;
      const auto rank = static_cast<std::size_t>(it - by_start_.begin());
      if (best && latest_end_[rank] < best->log_time) break;
      const Block& block = index_.blocks[*it];
      if (!may_have(block, [&](int other) { return other == topic; })) continue;
      if (best && block.end < best->log_time) continue;
      if (kept_ != *it) {
        auto loaded_result = load(block);
        if (!loaded_result) {
          if (!options_.recover) return loaded_result.error();
          continue;
        }
        kept_block_ = std::move(*loaded_result);
        kept_ = *it;
      }
      const auto& entries = kept_block_.entries;
      auto entry = std::ranges::upper_bound(entries, time, {}, &Entry::log_time);
      while (entry != entries.begin()) {
        --entry;
        if (entry->topic != topic) continue;
        // At equal times the message that was written last; blocks come here in the order of their beginnings.
        if (!best || entry->log_time > best->log_time ||
            (entry->log_time == best->log_time && block.offset > best_offset)) {
          best = message_of(kept_block_, *entry);
          best_offset = block.offset;
        }
        break;
      }
    }
    return best;
  }

  Result<void> verify() override { return mcap::verify(file_, index_, options_); }

 private:
  struct Cursor {
    Time log_time = 0;
    std::size_t block = 0, entry = 0;
    bool operator<(const Cursor& other) const {  // the top of a heap is its greatest
      return std::tie(log_time, block, entry) > std::tie(other.log_time, other.block, other.entry);
    }
  };

  Result<Loaded> load(const Block& block) const {
    auto records_result = records_of(file_, block);
    if (!records_result) return records_result.error();
    Loaded loaded;
    auto ok = walk(file_, block, *records_result, [&](Op op, View body, std::uint64_t offset) -> Result<void> {
      if (op != Op::kMessage) return {};
      const auto place_result = index_.place_of(file_, block, body, offset);
      if (!place_result) return place_result.error();
      const Time log_time = place_result->log_time;
      if (log_time < block.start || log_time > block.end) {
        return damaged_in(
            file_, block, offset,
            fmt::format("got log time {}, wanted one of {} to {} as the chunk says", log_time, block.start, block.end));
      }
      loaded.entries.push_back(
          {.log_time = log_time, .offset = offset + kRecordHead, .size = body.size(), .topic = place_result->topic});
      return {};
    });
    if (!ok) return ok.error();
    std::ranges::stable_sort(loaded.entries, {}, &Entry::log_time);
    loaded.records = std::move(*records_result);
    return loaded;
  }

  static Message message_of(const Loaded& loaded, const Entry& entry) {
    const View body = View(loaded.records).subspan(entry.offset, entry.size);
    const auto head = *parse_message(body);
    const View data = body.subspan(kMessageHead);
    return {.topic = entry.topic,
            .log_time = entry.log_time,
            .publish_time = static_cast<Time>(head.publish_time),
            .sequence = head.sequence,
            .data = Bytes(data.begin(), data.end())};
  }

  bool is_wanted(int topic) const { return wanted_.empty() || wanted_[static_cast<std::size_t>(topic)]; }

  // Whether a block may have messages of topics that `is_sought`.
  template <class IsSought>
  bool may_have(const Block& block, IsSought is_sought) const {
    if (!block.knows_channels) return true;
    return std::ranges::any_of(block.channels, [&](const auto& channel) {
      const auto known = index_.topics.find(channel.first);
      return known == index_.topics.end() || is_sought(known->second);  // unknown: load() says what is wrong
    });
  }

  // Loads a block for next(), unless nothing in it is wanted.
  Result<void> take_up(std::size_t index) {
    const Block& block = index_.blocks[index];
    if (block.end < from_ || !may_have(block, [&](int topic) { return is_wanted(topic); })) return {};
    auto loaded_result = load(block);
    if (!loaded_result) {
      if (!options_.recover) return loaded_result.error();
      index_.info.damage.push_back(loaded_result.error().message);
      return {};
    }
    const auto& entries = loaded_result->entries;
    const auto first = std::ranges::lower_bound(entries, from_, {}, &Entry::log_time) - entries.begin();
    loaded_[index] = std::move(*loaded_result);
    if (!advance(index, static_cast<std::size_t>(first))) loaded_.erase(index);
    return {};
  }

  // Puts a block's next wanted message, from `entry` on, among the cursors.
  bool advance(std::size_t index, std::size_t entry) {
    const auto& entries = loaded_[index].entries;
    while (entry < entries.size() && !is_wanted(entries[entry].topic)) ++entry;
    if (entry == entries.size()) return false;
    cursors_.push({.log_time = entries[entry].log_time, .block = index, .entry = entry});
    return true;
  }

  InputFile file_;
  const OpenOptions options_;
  Index index_;
  std::vector<std::size_t> by_start_;  // blocks in the order of their beginnings
  std::vector<Time> latest_end_;       // of by_start_ up to each

  Time from_ = std::numeric_limits<Time>::min();
  std::vector<bool> wanted_;
  std::size_t next_block_ = 0;            // of by_start_
  std::priority_queue<Cursor> cursors_;   // the next message of every loaded block
  std::map<std::size_t, Loaded> loaded_;  // by block

  std::optional<std::size_t> kept_;  // block that last_at() has at hand
  Loaded kept_block_;
};

}  // namespace

Result<std::unique_ptr<FileReader>> open_mcap(const std::filesystem::path& file, const OpenOptions& options) {
  auto input_result = InputFile::open(file);
  if (!input_result) return input_result.error();
  auto index_result = index_of(*input_result, options);
  if (!index_result) return index_result.error();
  return std::unique_ptr<FileReader>(
      std::make_unique<McapReader>(std::move(*input_result), std::move(*index_result), options));
}

const Storage& mcap_storage() {
  static constexpr Storage kStorage{"mcap", ".mcap", create_mcap, open_mcap};
  return kStorage;
}

}  // namespace jostle::bags
