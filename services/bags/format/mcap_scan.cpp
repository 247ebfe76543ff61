#include "services/bags/format/mcap_scan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "services/bags/format/checksum.hpp"

namespace jostle::bags::mcap {
namespace {

// Records outside of chunks are read in runs of about this many bytes.
constexpr std::uint64_t kRunBytes = 1 << 20;

class Scan {
 public:
  Scan(const InputFile& file, ScanMode mode, Index& index) : file_(file), mode_(mode), index_(index) {}

  Result<void> run(std::uint64_t end) {
    std::uint64_t at = kMagic.size();
    while (at < end) {
      const auto record_result = record_at(file_, at, end);
      if (!record_result) return step_over(record_result.error());
      const Record& record = *record_result;
      if (record.op == Op::kFooter) return {};
      if (record.op == Op::kDataEnd) return verifies() ? verify_data_end(record) : Result<void>();
      if (is_of_blocks(record.op)) {
        auto run_end = take_run(record, end);
        if (!run_end) return step_over(run_end.error());
        at = *run_end;
        continue;
      }
      if (static_cast<std::uint8_t>(record.op) == 0) {
        return step_over(file_.damaged(at, "got opcode 0, wanted a record"));
      }
      // Whatever is wrong in it, its length was fine: go on behind it.
      if (auto ok = step_over(take(record)); !ok) return ok;
      at = record.end();
    }
    return step_over(file_.damaged(end, "cut off: the data has no end"));
  }

 private:
  bool verifies() const { return mode_ == ScanMode::kVerify; }

  // What went wrong is noted, if that is enough.
  Result<void> step_over(Result<void> outcome) {
    if (outcome || mode_ != ScanMode::kRecover) return outcome;
    index_.info.damage.push_back(outcome.error().message);
    return {};
  }

  Result<void> take(const Record& record) {
    switch (record.op) {
      case Op::kChunk:
        return take_chunk(record);
      case Op::kMetadata:
        return index_.take_metadata(file_, record);
      case Op::kMessageIndex:
        return verifies() ? verify_message_index(record) : Result<void>();
      case Op::kAttachment:
        return verifies() ? verify_attachment(record) : Result<void>();
      default:
        return {};
    }
  }

  Result<void> take_chunk(const Record& record) {
    auto head_result = file_.read(record.body(), std::min<std::uint64_t>(record.size, chunk_head_size("") + 64));
    if (!head_result) return head_result.error();
    const auto head = parse_chunk(*head_result);
    if (!head || record.size < chunk_head_size(head->compression) ||
        head->stored != record.size - chunk_head_size(head->compression)) {
      return file_.damaged(record.offset, "a chunk is malformed");
    }
    for (const std::uint64_t time : {head->start, head->end}) {
      if (auto time_result = time_of(file_, time, record.offset); !time_result) return time_result.error();
    }
    Block block{.offset = record.offset,
                .length = record.end() - record.offset,
                .stored = head->stored,
                .size = head->size,
                .compression = head->compression};
    auto records_result = records_of(file_, block);
    if (!records_result) return records_result.error();
    return take_block(std::move(block), *records_result);
  }

  // Records outside of chunks from `first` on, as long as there are only such.
  Result<std::uint64_t> take_run(const Record& first, std::uint64_t end) {
    std::uint64_t at = first.end();
    while (at < end && at - first.offset < kRunBytes) {
      const auto record_result = record_at(file_, at, end);
      if (!record_result || !is_of_blocks(record_result->op)) break;  // run() finds it again
      at = record_result->end();
    }
    Block block{.is_chunk = false, .offset = first.offset, .length = at - first.offset};
    auto records_result = records_of(file_, block);
    if (!records_result) return records_result.error();
    if (auto ok = step_over(take_block(std::move(block), *records_result)); !ok) return ok.error();
    return at;
  }

  // Counts a block's messages and keeps it, if it has any.
  Result<void> take_block(Block block, const Bytes& records) {
    block.start = std::numeric_limits<Time>::max();
    block.end = std::numeric_limits<Time>::min();
    last_chunk_.clear();
    auto ok = walk(file_, block, records, [&](Op op, View body, std::uint64_t offset) -> Result<void> {
      if (op != Op::kMessage) return index_.take_definition(file_, op, body, block.offset);
      const auto place_result = index_.place_of(file_, block, body, offset);
      if (!place_result) return place_result.error();
      const auto& [channel, topic, log_time] = *place_result;
      block.start = std::min(block.start, log_time);
      block.end = std::max(block.end, log_time);
      ++block.channels[channel];
      if (verifies()) last_chunk_[channel].emplace_back(log_time, offset);
      return {};
    });
    if (!ok) return ok;
    for (auto& [channel, entries] : last_chunk_) std::ranges::sort(entries);
    if (block.channels.empty()) return {};
    for (const auto& [channel, count] : block.channels) index_.counts[channel] += count;
    index_.blocks.push_back(std::move(block));
    return {};
  }

  Result<void> verify_data_end(const Record& record) const {
    auto body_result = body_of(file_, record);
    if (!body_result) return body_result.error();
    const auto wanted = Parser(*body_result).number<std::uint32_t>();
    if (wanted == 0) return {};
    std::uint32_t crc = 0;
    for (std::uint64_t at = 0; at < record.offset;) {
      const std::uint64_t count = std::min(record.offset - at, kRunBytes);
      auto piece_result = file_.read(at, count);
      if (!piece_result) return piece_result.error();
      crc = crc32_of(*piece_result, crc);
      at += count;
    }
    if (crc != wanted) {
      return file_.damaged(record.offset, fmt::format("data: got checksum {:08x}, wanted {:08x}", crc, wanted));
    }
    return {};
  }

  Result<void> verify_attachment(const Record& record) const {
    auto body_result = body_of(file_, record);
    if (!body_result) return body_result.error();
    if (body_result->size() < sizeof(std::uint32_t)) return file_.damaged(record.offset, "an attachment is malformed");
    const View data = View(*body_result).first(body_result->size() - sizeof(std::uint32_t));
    const auto wanted = Parser(View(*body_result).last(sizeof(std::uint32_t))).number<std::uint32_t>();
    if (wanted != 0 && crc32_of(data) != wanted) {
      return file_.damaged(record.offset,
                           fmt::format("attachment: got checksum {:08x}, wanted {:08x}", crc32_of(data), wanted));
    }
    return {};
  }

  // It tells of the chunk before it.
  Result<void> verify_message_index(const Record& record) const {
    auto body_result = body_of(file_, record);
    if (!body_result) return body_result.error();
    Parser from(*body_result);
    const auto channel = from.number<std::uint16_t>();
    std::vector<std::pair<Time, std::uint64_t>> got;
    Parser entries = from.part();
    while (!entries.at_end()) {
      const auto time = entries.number<Time>();
      got.emplace_back(time, entries.number<std::uint64_t>());
    }
    if (!from.ok() || !entries.ok()) return file_.damaged(record.offset, "a message index is malformed");
    std::ranges::sort(got);
    const auto wanted = last_chunk_.find(channel);
    if (wanted == last_chunk_.end() ? !got.empty() : got != wanted->second) {
      return file_.damaged(
          record.offset,
          fmt::format("message index of channel {}: it tells of other messages than the chunk has", channel));
    }
    return {};
  }

  const InputFile& file_;
  const ScanMode mode_;
  Index& index_;
  /// Log times and offsets of the last chunk's messages, by channel, sorted: they verify its message indexes.
  std::map<std::uint16_t, std::vector<std::pair<Time, std::uint64_t>>> last_chunk_;
};

}  // namespace

Result<void> scan(const InputFile& file, std::uint64_t end, ScanMode mode, Index& index) {
  index.blocks.clear();
  index.counts.clear();
  index.info.notes.clear();
  return Scan(file, mode, index).run(end);
}

}  // namespace jostle::bags::mcap
