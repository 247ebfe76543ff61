#include "services/bags/format/mcap_scan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "services/bags/format/checksum.hpp"
#include "services/bags/format/compression.hpp"
#include "services/bags/format/mcap_file.hpp"

namespace jostle::bags::mcap {
namespace {

// Records outside of chunks are read in runs of about this many bytes, and searched for in windows of it.
constexpr std::uint64_t kRunBytes = 1 << 20;
// So much of a record is read for its head; no name in it is nearly as long.
constexpr std::uint64_t kHeadBytes = 64 << 10;
constexpr std::uint64_t kDay = 86'400'000'000'000;  // ns

class Scan {
 public:
  Scan(const InputFile& file, std::uint64_t end, ScanMode mode, Index& index, Census& census)
      : file_(file), end_(end), mode_(mode), index_(index), census_(census) {}

  Result<void> run(const std::stop_token& stop) {
    std::uint64_t at = kMagic.size();
    while (at < end_) {
      if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      auto next_result = take_next(at);
      if (!next_result && recovers()) next_result = search(at, next_result.error());
      if (!next_result) return next_result.error();
      at = *next_result;
    }
    if (is_ended_ || recovers()) return {};
    return file_.damaged(end_, "cut off: the data has no end");
  }

 private:
  bool verifies() const { return mode_ == ScanMode::kVerify; }
  bool recovers() const { return mode_ == ScanMode::kRecover; }
  std::string where(std::uint64_t offset) const { return fmt::format("{}: byte {}", file_.path().string(), offset); }

  // Takes the record or the run at a place; returns where it ends. Error: there is none, or it cannot be believed.
  Result<std::uint64_t> take_next(std::uint64_t at) {
    auto record_result = record_at(file_, at, end_);
    if (!record_result && recovers() && is_chunk(at)) record_result = Record{.op = Op::kChunk, .offset = at};
    if (!record_result) return record_result.error();
    const Record& record = *record_result;
    if (record.op == Op::kChunk) has_chunks_ = true;
    if (is_of_blocks(record.op)) return take_run(record);
    if (static_cast<std::uint8_t>(record.op) == 0) return file_.damaged(at, "got opcode 0, wanted a record");
    if (recovers() && record.op == Op::kChunk && !chunk_at(record)) return take_odd_chunk(record);
    // Whatever is wrong in it, if its length is right it goes on behind it.
    const bool is_known = record.op <= Op::kDataEnd;
    if (recovers() && (is_known ? !is_plausible(record.op, record.size) : !goes_on(record.end()))) {
      return file_.damaged(at, "got a record whose length does not fit its kind");
    }
    if (record.op == Op::kFooter) return take_footer(record);
    if (!is_known) {
      index_.info.findings.lost(Part::kUnknownRecord, fmt::format("of kind {:#04x}", static_cast<unsigned>(record.op)),
                                where(at));
      return record.end();
    }
    if (auto ok = take(record); !ok) return ok.error();
    return record.end();
  }

  bool is_chunk(std::uint64_t at) const {
    const auto byte_result = file_.read(at, 1);
    return byte_result && byte_result->front() == static_cast<std::byte>(Op::kChunk);
  }

  // A chunk whose record and head disagree: one of the two lengths may be right.
  Result<std::uint64_t> take_odd_chunk(Record record) {
    const Error malformed = file_.damaged(record.offset, "a chunk is malformed");
    if (const auto head = chunk_head(record)) {
      const std::uint64_t body = chunk_head_size(head->compression) + head->stored;
      if (record.body() <= end_ && head->stored <= end_ && body <= end_ - record.body() &&
          goes_on(record.body() + body)) {
        record.size = body;
        if (auto ok = take_chunk(record); !ok) return ok.error();
        index_.info.findings.flawed(Part::kChunk, "got another length of its record than its head has",
                                    where(record.offset));
        return record.end();
      }
    }
    if (record.size == 0 || !goes_on(record.end())) return malformed;
    lose_chunk(malformed);
    is_unread_ = true;
    return record.end();
  }

  Result<void> take(const Record& record) {
    switch (record.op) {
      case Op::kChunk:
        return take_chunk(record);
      case Op::kMetadata:
        census_metadata(record);
        return index_.take_metadata(file_, record);
      case Op::kMessageIndex:
        return take_message_index(record);
      case Op::kAttachment:
        return take_attachment(record);
      case Op::kDataEnd:
        is_ended_ = true;
        return verifies() ? verify_data_end(record) : Result<void>();
      default:
        return {};
    }
  }

  // Files that were put together have another one behind the footer.
  Result<std::uint64_t> take_footer(const Record& record) {
    const std::uint64_t behind = record.end() + kMagic.size();
    if (behind >= file_.size()) return end_;
    index_.info.findings.flawed(Part::kFile, "another file follows, wanted one", where(behind));
    const bool has_magic = behind + kMagic.size() <= end_ && is_magic(behind);
    return has_magic ? behind + kMagic.size() : behind;
  }

  bool is_magic(std::uint64_t at) const {
    const auto bytes_result = file_.read(at, kMagic.size());
    return bytes_result && std::ranges::equal(*bytes_result, std::as_bytes(std::span(kMagic)));
  }

  // Whether a place looks like the beginning of a record, or ends the file.
  bool goes_on(std::uint64_t at) const {
    if (at == end_) return true;
    const auto record_result = record_at(file_, at, end_);
    return record_result && is_plausible(record_result->op, record_result->size);
  }

  // Whether there is a record: a chunk that is what it says, or one that two others follow. In a file with chunks
  // messages are not looked for: those of a damaged chunk are not to be believed one by one.
  bool begins_again(std::uint64_t at) const {
    const auto record_result = record_at(file_, at, end_);
    if (!record_result || !is_plausible(record_result->op, record_result->size)) return false;
    if (is_of_blocks(record_result->op) && has_chunks_) return false;
    if (record_result->op == Op::kChunk) return chunk_at(*record_result).has_value();
    const auto next_result =
        record_result->end() == end_ ? record_result : record_at(file_, record_result->end(), end_);
    return next_result && is_plausible(next_result->op, next_result->size) && goes_on(next_result->end());
  }

  // Looks for the next record behind what cannot be read; returns where it is, or the end.
  Result<std::uint64_t> search(std::uint64_t from, const Error& why) {
    std::uint64_t found = end_;
    constexpr std::uint64_t kOverlap = kRecordHead - 1;
    for (std::uint64_t at = from + 1; found == end_ && at + kRecordHead <= end_; at += kRunBytes) {
      const auto window_result = file_.read(at, std::min(kRunBytes + kOverlap, end_ - at));
      if (!window_result) return window_result.error();
      const View window = *window_result;
      for (std::size_t i = 0; i + kRecordHead <= window.size(); ++i) {
        // Kind and the upper bytes of a length that is no longer than any file: most places are none.
        const bool may_be = window[i] != std::byte{0} && window[i] <= static_cast<std::byte>(Op::kDataEnd) &&
                            window[i + 8] == std::byte{0} && window[i + 7] == std::byte{0};
        if (!may_be || !begins_again(at + i)) continue;
        found = at + i;
        break;
      }
    }
    std::string reason = why.message;
    reason.resize(std::min(reason.find("; remedy: "), reason.size()));
    index_.info.findings.lost(Part::kRecord, fmt::format("{}: {} bytes passed over", reason, found - from), "");
    return found;
  }

  std::optional<ChunkHead> chunk_head(const Record& record) const {
    if (record.body() > end_) return {};
    const auto bytes_result =
        file_.read(record.body(), std::min<std::uint64_t>(end_ - record.body(), chunk_head_size("") + 64));
    if (!bytes_result) return {};
    return parse_chunk(*bytes_result);
  }

  // The head of a chunk that agrees with its record.
  std::optional<ChunkHead> chunk_at(const Record& record) const {
    auto head = chunk_head(record);
    if (!head || record.size < chunk_head_size(head->compression) ||
        head->stored != record.size - chunk_head_size(head->compression)) {
      return {};
    }
    return head;
  }

  Result<void> take_chunk(const Record& record) {
    auto head = chunk_at(record);
    if (!head) return file_.damaged(record.offset, "a chunk is malformed");
    Block block{.offset = record.offset,
                .length = record.end() - record.offset,
                .stored = head->stored,
                .size = head->size,
                .compression = head->compression};
    census_.chunks.push_back({.index = {.offset = block.offset,
                                        .length = block.length,
                                        .compression = block.compression,
                                        .stored = block.stored,
                                        .size = block.size},
                              .head = std::move(*head)});
    in_chunk_.clear();
    is_unread_ = false;
    auto records_result = records_of(file_, block);
    if (records_result && !records_result->problem) return take_block(std::move(block), records_result->bytes);
    if (!recovers()) return records_result ? *records_result->problem : records_result.error();
    lose_chunk(records_result ? *records_result->problem : records_result.error());
    if (records_result) {
      lose_messages_of(records_result->bytes);
    } else {
      is_unread_ = true;  // its message indexes count what was in it
    }
    return {};
  }

  void lose_chunk(const Error& why) {
    std::string reason = why.message;
    reason.resize(std::min(reason.find("; remedy: "), reason.size()));
    index_.info.findings.lost(Part::kChunk, reason, "");
  }

  void lose_messages(std::uint64_t count) {
    if (count > 0) index_.info.findings.lost(Part::kMessage, "in chunks that cannot be read", "", count);
  }

  // Nobody vouches for them: they are counted.
  void lose_messages_of(const Bytes& records) {
    std::uint64_t messages = 0;
    walk(records, [&](Op op, View, std::uint64_t) { messages += op == Op::kMessage ? 1 : 0; });
    lose_messages(messages);
  }

  // Records outside of chunks from `first` on, as long as there are only such.
  Result<std::uint64_t> take_run(const Record& first) {
    std::uint64_t at = first.end();
    while (at < end_ && at - first.offset < kRunBytes) {
      const auto record_result = record_at(file_, at, end_);
      if (!record_result || !is_of_blocks(record_result->op)) break;  // run() finds it again
      at = record_result->end();
    }
    Block block{.is_chunk = false, .offset = first.offset, .length = at - first.offset};
    auto records_result = records_of(file_, block);
    if (!records_result) return records_result.error();
    if (auto ok = take_block(std::move(block), records_result->bytes); !ok) return ok.error();
    return at;
  }

  // Counts a block's messages and keeps it, if it has any.
  Result<void> take_block(Block block, const Bytes& records) {
    block.start = std::numeric_limits<Time>::max();
    block.end = std::numeric_limits<Time>::min();
    Findings& findings = index_.info.findings;
    const auto broken = walk(records, [&](Op op, View body, std::uint64_t offset) {
      if (op == Op::kMessage) return take_message(block, body, offset);
      if (op == Op::kSchema || op == Op::kChannel) {
        return index_.definitions.take(op, body, {block.offset, offset}, where_in(file_, block, offset), findings);
      }
      const Part part = op > Op::kDataEnd ? Part::kUnknownRecord : Part::kRecord;
      findings.lost(
          part,
          fmt::format("of kind {:#04x} in a chunk, wanted schemas, channels and messages", static_cast<unsigned>(op)),
          where_in(file_, block, offset));
    });
    if (broken) {
      const std::string what = "a record is longer than what holds it";
      if (!recovers()) return damaged_in(file_, block, *broken, what);
      findings.lost(Part::kRecord, fmt::format("{}: {} bytes passed over", what, records.size() - *broken),
                    where_in(file_, block, *broken));
    }
    for (auto& [channel, entries] : in_chunk_) std::ranges::sort(entries);
    if (!block.topics.empty()) index_.blocks.push_back(std::move(block));
    return {};
  }

  void take_message(Block& block, View body, std::uint64_t offset) {
    if (const auto head = parse_message(body)) count(block, *head, offset);
    const auto place = index_.place_of(file_, block, body, offset, &index_.info.findings);
    if (!place) return;
    block.start = std::min(block.start, place->log_time);
    block.end = std::max(block.end, place->log_time);
    ++block.topics[place->topic];
    if (block.is_chunk) return;
    const std::string& encoding = index_.definitions.topics()[static_cast<std::size_t>(place->topic)].topic.encoding;
    const View data = body.subspan(kMessageHead);
    const bool is_cdr = data.size() >= 4 && data[0] == std::byte{0} && data[1] <= std::byte{0x0B};
    const auto head = *parse_message(body);
    const std::uint64_t apart = std::max(head.log_time, head.publish_time) - std::min(head.log_time, head.publish_time);
    if ((encoding == kMessageEncoding && !is_cdr) || apart > kDay) block.looks_sound = false;
  }

  void count(const Block& block, const MessageHead& head, std::uint64_t offset) {
    const bool is_first = census_.all_messages == 0;
    ++census_.all_messages;
    ++census_.messages[head.channel];
    census_.start = is_first ? head.log_time : std::min(census_.start, head.log_time);
    census_.end = std::max(census_.end, head.log_time);
    if (!block.is_chunk) return;
    Census::Chunk& chunk = census_.chunks.back();
    chunk.start = chunk.messages == 0 ? head.log_time : std::min(chunk.start, head.log_time);
    chunk.end = std::max(chunk.end, head.log_time);
    ++chunk.messages;
    if (verifies()) in_chunk_[head.channel].emplace_back(head.log_time, offset);
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

  void census_metadata(const Record& record) {
    const auto bytes_result = file_.read(record.body(), std::min(record.size, kHeadBytes));
    census_.metadata.push_back({.offset = record.offset,
                                .length = record.end() - record.offset,
                                .name = bytes_result ? Parser(*bytes_result).text() : ""});
  }

  Result<void> take_attachment(const Record& record) {
    auto head_result = file_.read(record.body(), std::min(record.size, kHeadBytes));
    if (!head_result) return head_result.error();
    auto head = parse_attachment(*head_result);
    if (!head || record.size != attachment_head_size(*head) + head->size + sizeof(std::uint32_t)) {
      index_.info.findings.lost(Part::kAttachment, "malformed", where(record.offset));
      return {};
    }
    census_.attachments.push_back({.offset = record.offset, .length = record.end() - record.offset, .head = *head});
    if (mode_ != ScanMode::kRead) {
      auto attachment_result = read_attachment(file_, record);
      if (!attachment_result && verifies()) return attachment_result.error();
      if (!attachment_result) {
        index_.info.findings.lost(Part::kAttachment, attachment_result.error().message, "");
        return {};
      }
    }
    index_.take_attachment(record, *head);
    return {};
  }

  // It tells of the chunk before it.
  Result<void> take_message_index(const Record& record) {
    auto body_result = body_of(file_, record);
    if (!body_result) return body_result.error();
    Parser from(*body_result);
    const auto channel = from.number<std::uint16_t>();
    std::vector<std::pair<std::uint64_t, std::uint64_t>> got;
    Parser entries = from.part();
    while (!entries.at_end()) {
      const auto time = entries.number<std::uint64_t>();
      got.emplace_back(time, entries.number<std::uint64_t>());
    }
    const bool is_whole = from.ok() && entries.ok();
    if (is_unread_ && is_whole) lose_messages(got.size());
    if (!verifies()) return {};
    if (!is_whole) return file_.damaged(record.offset, "a message index is malformed");
    if (!census_.chunks.empty()) {
      ChunkIndex& chunk = census_.chunks.back().index;
      chunk.message_indexes[channel] = record.offset;
      chunk.message_index_length += record.end() - record.offset;
    }
    std::ranges::sort(got);
    const auto wanted = in_chunk_.find(channel);
    if (wanted == in_chunk_.end() ? !got.empty() : got != wanted->second) {
      return file_.damaged(
          record.offset,
          fmt::format("message index of channel {}: it tells of other messages than the chunk has", channel));
    }
    return {};
  }

  const InputFile& file_;
  const std::uint64_t end_;
  const ScanMode mode_;
  Index& index_;
  Census& census_;
  bool has_chunks_ = false;
  bool is_ended_ = false;   // the data, as it should
  bool is_unread_ = false;  // the last chunk
  /// Log times and offsets of the last chunk's messages, by channel, sorted: they verify its message indexes.
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> in_chunk_;
};

}  // namespace

Result<void> scan(const InputFile& file, std::uint64_t end, ScanMode mode, Index& index, Census& census,
                  const std::stop_token& stop) {
  index.was_scanned = true;
  return Scan(file, end, mode, index, census).run(stop);
}

}  // namespace jostle::bags::mcap
