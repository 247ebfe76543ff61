// MCAP, read: the blocks that the file's index tells of, merged by log time.

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <queue>
#include <set>
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

  Result<Attachment> attachment(std::size_t index) const override {
    return read_attachment(file_, index_.attachments.at(index));
  }

  Result<std::vector<Finding>> verify() override { return mcap::verify(file_, index_, options_.stop); }

 private:
  struct Cursor {
    Time log_time = 0;
    std::size_t block = 0, entry = 0;
    bool operator<(const Cursor& other) const {  // the top of a heap is its greatest
      return std::tie(log_time, block, entry) > std::tie(other.log_time, other.block, other.entry);
    }
  };

  Result<Loaded> load(const Block& block) {
    auto records_result = records_of(file_, block);
    if (!records_result) return records_result.error();
    if (records_result->problem) return *records_result->problem;
    // What a scan has found is not found again; nor is what this block had when it was loaded before.
    const bool is_judged = index_.was_scanned || !judged_.insert(block.offset).second;
    Findings* findings = is_judged ? nullptr : &index_.info.findings;
    Loaded loaded;
    Result<void> ok;
    Definitions own;  // this block's, to be compared with the summary's
    const auto broken = walk(records_result->bytes, [&](Op op, View body, std::uint64_t offset) {
      if (!index_.was_scanned && (op == Op::kSchema || op == Op::kChannel)) {
        if (auto agrees = compare(own, op, body, block, offset); !agrees && ok) ok = agrees;
      }
      if (op != Op::kMessage) return;
      const auto place = index_.place_of(file_, block, body, offset, findings);
      if (!place) return;
      const Time log_time = place->log_time;
      if (ok && (log_time < block.start || log_time > block.end)) {
        ok = damaged_in(
            file_, block, offset,
            fmt::format("got log time {}, wanted one of {} to {} as the chunk says", log_time, block.start, block.end));
      }
      loaded.entries.push_back(
          {.log_time = log_time, .offset = offset + kRecordHead, .size = body.size(), .topic = place->topic});
    });
    if (!ok) return ok.error();
    if (broken && !options_.recover) {
      return damaged_in(file_, block, *broken, "a record is longer than what holds it");
    }
    std::ranges::stable_sort(loaded.entries, {}, &Entry::log_time);
    loaded.records = std::move(records_result->bytes);
    return loaded;
  }

  // A chunk says again what its channels are: where it says other than the summary, files were put together, and the
  // summary tells of one of them.
  Result<void> compare(Definitions& own, Op op, View body, const Block& block, std::uint64_t offset) const {
    Findings unused;
    own.take(op, body, {block.offset, offset}, "", unused);
    const auto channel = op == Op::kChannel ? parse_channel(body) : std::nullopt;
    if (!channel) return {};
    const int* said = index_.definitions.topic_in_summary(channel->id);
    const Topic& here =
        own.topics()[static_cast<std::size_t>(*own.topic_of(channel->id, {block.offset, offset}))].topic;
    if (said == nullptr) return {};
    const Topic& wanted = index_.info.topics[static_cast<std::size_t>(*said)].topic;
    const bool is_typed = !here.type.empty() || channel->schema == 0;  // else its schema stands in an earlier chunk
    if (is_typed ? here.is_same_as(wanted) : here.name == wanted.name) return {};
    return damaged_in(file_, block, offset,
                      fmt::format("channel {}: got {} ({}), wanted {} ({}) as the summary says", channel->id, here.name,
                                  here.type, wanted.name, wanted.type));
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
  static bool may_have(const Block& block, IsSought is_sought) {
    return std::ranges::any_of(block.topics, [&](const auto& topic) { return is_sought(topic.first); });
  }

  // Loads a block for next(), unless nothing in it is wanted.
  Result<void> take_up(std::size_t index) {
    const Block& block = index_.blocks[index];
    if (block.end < from_ || !may_have(block, [&](int topic) { return is_wanted(topic); })) return {};
    auto loaded_result = load(block);
    if (!loaded_result) {
      if (!options_.recover) return loaded_result.error();
      index_.info.findings.lost(Part::kChunk, loaded_result.error().message, "");
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

  std::set<std::uint64_t> judged_;  // blocks whose findings are known, by offset

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
