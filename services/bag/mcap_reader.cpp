// MCAP, read: by its summary if it has one, else after a look at all of its records. What
// the file says is checked before it is believed.

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <queue>
#include <tuple>

#include "services/bag/checksum.hpp"
#include "services/bag/compression.hpp"
#include "services/bag/input_file.hpp"
#include "services/bag/mcap_file.hpp"
#include "services/bag/mcap_format.hpp"
#include "services/bag/qos_text.hpp"

namespace jostle::bag {
namespace {

using namespace mcap;

// Records outside of chunks are read in runs of about this many bytes.
constexpr std::uint64_t kRunBytes = 1 << 20;
constexpr std::uint64_t kTail = kFooterRecord + kMagic.size();

// Messages that are read together: a chunk, or a run of records outside of chunks.
struct Block {
  bool is_chunk = true;
  std::uint64_t offset = 0, length = 0;  // in the file: the chunk's record, or the run
  std::uint64_t stored = 0, size = 0;    // of a chunk's records
  std::string compression;
  Time start = 0, end = 0;
  /// Channels that have messages in it, if knows_channels; how many, if a scan has counted.
  std::map<std::uint16_t, std::uint64_t> channels;
  bool knows_channels = true;
};

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

struct Record {
  Op op{};
  std::uint64_t offset = 0;  // of the head
  std::uint64_t size = 0;    // of the body
  std::uint64_t body() const { return offset + kRecordHead; }
  std::uint64_t end() const { return body() + size; }
};

bool has_magic(View bytes) {
  return bytes.size() == kMagic.size() && std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) == 0;
}

class McapReader final : public FileReader {
 public:
  McapReader(InputFile file, const OpenOptions& options) : file_(std::move(file)), options_(options) {}

  Result<void> open() {
    if (auto ok = check_beginning(); !ok) return ok;
    auto read = open_whole();
    if (options_.recover) {
      // What a whole summary says of channels outlives the chunks that say it, too.
      if (!read) {
        forget();
        info_.damage.push_back(read.error().message);
      }
      blocks_.clear();
      recovers_ = true;
      read = scan(file_.size());
      leave_out_strays();
    }
    if (!read) return read;
    if (options_.skip_repeated && !blocks_.empty()) leave_out_repeated();
    return finish();
  }

  const FileInfo& info() const override { return info_; }

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
             (cursors_.empty() || blocks_[by_start_[next_block_]].start <= cursors_.top().log_time)) {
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
    // From the last block that begins in time backwards, until none can hold a later one.
    auto it = std::ranges::upper_bound(by_start_, time, {}, [&](std::size_t block) { return blocks_[block].start; });
    while (it != by_start_.begin()) {
      --it;
      const auto rank = static_cast<std::size_t>(it - by_start_.begin());
      if (best && latest_end_[rank] < best->log_time) break;
      const std::size_t index = *it;
      const Block& block = blocks_[index];
      if (!may_have(block, topic) || (best && block.end < best->log_time)) continue;
      if (kept_ != index) {
        auto loaded_result = load(block);
        if (!loaded_result) {
          if (!recovers_) return loaded_result.error();
          continue;
        }
        kept_block_ = std::move(*loaded_result);
        kept_ = index;
      }
      const auto& entries = kept_block_.entries;
      auto entry = std::ranges::upper_bound(entries, time, {}, &Entry::log_time);
      while (entry != entries.begin()) {
        --entry;
        if (entry->topic != topic) continue;
        // Of equal times the one written last; blocks come here in the order of their beginnings.
        if (!best || entry->log_time > best->log_time ||
            (entry->log_time == best->log_time && block.offset > best_offset_)) {
          best = message_of(kept_block_, *entry);
          best_offset_ = block.offset;
        }
        break;
      }
    }
    return best;
  }

  Result<void> verify() override {
    auto again_result = InputFile::open(file_.path());
    if (!again_result) return again_result.error();
    McapReader other(std::move(*again_result), {});
    other.verifies_ = true;
    if (auto ok = other.scan(file_.size() - kTail); !ok) return ok;
    if (options_.skip_repeated && !other.blocks_.empty()) other.leave_out_repeated();
    std::erase_if(other.counts_, [](const auto& count) { return count.second == 0; });
    auto claimed = counts_;
    std::erase_if(claimed, [](const auto& count) { return count.second == 0; });
    for (const auto& [channel, topic] : topics_) {
      const std::uint64_t got = other.counts_.contains(channel) ? other.counts_[channel] : 0;
      const std::uint64_t wanted = claimed.contains(channel) ? claimed[channel] : 0;
      if (got != wanted) {
        return damaged(file_.size(),
                       fmt::format("topic {}: got {} messages, wanted {} as the statistics say",
                                   info_.topics[static_cast<std::size_t>(topic)].topic.name, got, wanted));
      }
    }
    return {};
  }

 private:
  struct Cursor {
    Time log_time = 0;
    std::size_t block = 0, entry = 0;
    bool operator<(const Cursor& other) const {  // the top of a heap is its greatest
      return std::tie(log_time, block, entry) > std::tie(other.log_time, other.block, other.entry);
    }
  };

  Error damaged(std::uint64_t offset, const std::string& what) const { return file_.damaged(offset, what); }

  Result<void> check_beginning() const {
    const auto magic_result = file_.read(0, std::min<std::uint64_t>(file_.size(), kMagic.size()));
    if (!magic_result) return magic_result.error();
    if (has_magic(*magic_result)) return {};
    const auto* bytes = reinterpret_cast<const unsigned char*>(magic_result->data());
    if (magic_result->size() == kMagic.size() && std::equal(bytes, bytes + 5, kMagic.begin()) && bytes[5] > kMagic[5] &&
        bytes[6] == '\r' && bytes[7] == '\n') {
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: got MCAP of version {:c}, wanted 0: a later program wrote it",
                               file_.path().string(), bytes[5])};
    }
    if (magic_result->empty()) return damaged(0, "the file is empty");
    return Error{
        Code::kInvalidArgument,
        fmt::format("{}: byte 0: got something else, wanted the beginning of an MCAP file", file_.path().string())};
  }

  void forget() {
    info_ = {};
    schemas_.clear();
    topics_.clear();
    repeated_at_.reset();
  }

  // A record's head, with a body that lies before `end`.
  Result<Record> record_at(std::uint64_t offset, std::uint64_t end) const {
    if (end - offset < kRecordHead) {
      return damaged(offset, fmt::format("cut off: got {} bytes, wanted a record", end - offset));
    }
    auto head_result = file_.read(offset, kRecordHead);
    if (!head_result) return head_result.error();
    Parser head(*head_result);
    Record record{.op = static_cast<Op>(head.number<std::uint8_t>()), .offset = offset};
    record.size = head.number<std::uint64_t>();
    if (record.size > end - record.body()) {
      return damaged(offset, fmt::format("cut off: got a record of {} bytes, wanted at most {}", record.size,
                                         end - record.body()));
    }
    return record;
  }

  Result<Time> time_of(std::uint64_t value, std::uint64_t offset) const {
    if (value <= static_cast<std::uint64_t>(std::numeric_limits<Time>::max())) return static_cast<Time>(value);
    return damaged(offset, fmt::format("log time: got {} ns, wanted one before the year 2262", value));
  }

  Result<void> open_whole() {
    if (file_.size() < kMagic.size() + kTail) return damaged(file_.size(), "cut off: the file has no end");
    auto tail_result = file_.read(file_.size() - kTail, kTail);
    if (!tail_result) return tail_result.error();
    const View tail = *tail_result;
    const std::uint64_t footer_at = file_.size() - kTail;
    Parser head(tail.first(kRecordHead));
    const Op op = static_cast<Op>(head.number<std::uint8_t>());
    const auto footer = parse_footer(tail.subspan(kRecordHead, kFooterRecord - kRecordHead));
    if (!has_magic(tail.last(kMagic.size())) || op != Op::kFooter ||
        head.number<std::uint64_t>() != kFooterRecord - kRecordHead || !footer) {
      return damaged(file_.size(),
                     "cut off: the file does not end as MCAP does (its writer was killed, or the disk was full)");
    }
    if (footer->summary_start == 0) return scan(footer_at);
    return read_summary(*footer, footer_at);
  }

  Result<void> read_summary(const Footer& footer, std::uint64_t footer_at) {
    if (footer.summary_start < kMagic.size() || footer.summary_start > footer_at) {
      return damaged(footer_at, fmt::format("footer: got a summary at byte {}, wanted one before byte {}",
                                            footer.summary_start, footer_at));
    }
    const std::uint64_t with_footer = footer_at - footer.summary_start + kFooterRecord - sizeof footer.summary_crc;
    auto bytes_result = file_.read(footer.summary_start, with_footer);
    if (!bytes_result) return bytes_result.error();
    if (footer.summary_crc != 0 && crc32_of(*bytes_result) != footer.summary_crc) {
      return damaged(footer.summary_start, fmt::format("summary: got checksum {:08x}, wanted {:08x}",
                                                       crc32_of(*bytes_result), footer.summary_crc));
    }
    std::optional<Statistics> statistics;
    std::vector<MetadataIndex> metadata;
    std::uint64_t at = footer.summary_start;
    while (at < footer_at) {
      auto record_result = record_at(at, footer_at);
      if (!record_result) return record_result.error();
      const Record& record = *record_result;
      const View body = View(*bytes_result).subspan(record.body() - footer.summary_start, record.size);
      bool ok = true;
      switch (record.op) {
        case Op::kSchema:
        case Op::kChannel:
          if (auto added = take_definition(record.op, body, record.offset); !added) return added;
          break;
        case Op::kStatistics:
          statistics = parse_statistics(body);
          ok = statistics.has_value();
          break;
        case Op::kChunkIndex: {
          const auto index = parse_chunk_index(body);
          if (!index) {
            ok = false;
            break;
          }
          if (auto added = add_block(*index, record.offset); !added) return added;
          break;
        }
        case Op::kMetadataIndex: {
          auto index = parse_metadata_index(body);
          ok = index.has_value();
          if (ok) metadata.push_back(std::move(*index));
          break;
        }
        default:
          break;  // what says nothing about messages, or comes from a later version
      }
      if (!ok) return damaged(record.offset, "a record of the summary is malformed");
      at = record.end();
    }
    // Without counts, or with messages outside of chunks, only a look at all records helps.
    const bool is_complete = statistics && statistics->chunks == blocks_.size() &&
                             (statistics->messages == 0 || (!statistics->channel_messages.empty() && !blocks_.empty()));
    if (!is_complete) {
      blocks_.clear();
      return scan(footer_at);
    }
    counts_ = statistics->channel_messages;
    for (const MetadataIndex& index : metadata) {
      if (auto ok = read_metadata(index, footer_at); !ok) return ok;
    }
    return {};
  }

  Result<void> add_block(const ChunkIndex& index, std::uint64_t record_offset) {
    const std::uint64_t head = kRecordHead + chunk_head_size(index.compression);
    if (index.offset > file_.size() || index.length > file_.size() - index.offset || index.length < head ||
        index.stored != index.length - head) {
      return damaged(record_offset,
                     fmt::format("chunk index: got a chunk of {} bytes at byte {}, wanted one that lies in the file",
                                 index.length, index.offset));
    }
    const auto start_result = time_of(index.start, record_offset);
    const auto end_result = time_of(index.end, record_offset);
    if (!start_result) return start_result.error();
    if (!end_result) return end_result.error();
    Block block{.offset = index.offset,
                .length = index.length,
                .stored = index.stored,
                .size = index.size,
                .compression = index.compression,
                .start = *start_result,
                .end = *end_result,
                .knows_channels = !index.message_indexes.empty()};
    for (const auto& [channel, offset] : index.message_indexes) block.channels[channel] = 0;
    blocks_.push_back(std::move(block));
    return {};
  }

  Result<void> read_metadata(const MetadataIndex& index, std::uint64_t end) {
    if (index.offset > end || index.length > end - index.offset) {
      return damaged(index.offset, fmt::format("metadata '{}': got {} bytes, wanted them to lie in the file",
                                               index.name, index.length));
    }
    auto record_result = record_at(index.offset, end);
    if (!record_result) return record_result.error();
    if (record_result->op != Op::kMetadata) {
      return damaged(index.offset, fmt::format("got another record, wanted metadata '{}'", index.name));
    }
    return take_metadata(*record_result);
  }

  Result<void> take_metadata(const Record& record) {
    auto body_result = file_.read(record.body(), record.size);
    if (!body_result) return body_result.error();
    const auto metadata = parse_metadata(*body_result);
    if (!metadata) return damaged(record.offset, "metadata is malformed");
    if (metadata->name == kRepeatedNote) {
      repeated_at_ = record.offset;
    } else {
      info_.notes[metadata->name] = metadata->metadata;
    }
    return {};
  }

  // A Schema or a Channel. The first of an id counts; others must be the same.
  Result<void> take_definition(Op op, View body, std::uint64_t offset) {
    if (op == Op::kSchema) {
      auto schema = parse_schema(body);
      if (!schema) return damaged(offset, "a schema is malformed");
      schemas_.try_emplace(schema->id, std::move(*schema));
      return {};
    }
    auto channel = parse_channel(body);
    if (!channel) return damaged(offset, "a channel is malformed");
    if (topics_.contains(channel->id)) return {};
    if (channel->encoding != kMessageEncoding) {
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: topic {}: got messages encoded as '{}', wanted '{}'", file_.path().string(),
                               channel->topic, channel->encoding, kMessageEncoding)};
    }
    const auto schema = schemas_.find(channel->schema);
    if (channel->schema != 0 && schema == schemas_.end()) {
      return damaged(offset, fmt::format("topic {}: got schema {}, wanted one that the file has", channel->topic,
                                         channel->schema));
    }
    Topic topic{.name = channel->topic};
    if (schema != schemas_.end()) {
      topic.type = schema->second.name;
      if (schema->second.encoding == kSchemaEncoding) topic.definition = schema->second.data;
    }
    if (const auto qos = channel->metadata.find(kQosKey); qos != channel->metadata.end()) {
      topic.qos = parse_qos(qos->second);
    }
    // Several channels may be one topic: several writers, or a recording that was merged.
    const auto known = std::ranges::find_if(info_.topics, [&](const TopicInfo& other) {
      return other.topic.name == topic.name && other.topic.type == topic.type;
    });
    topics_[channel->id] = static_cast<int>(known - info_.topics.begin());
    if (known == info_.topics.end()) info_.topics.push_back({.topic = std::move(topic)});
    return {};
  }

  // All records up to `end`, the footer or the end of what is left of the file.
  Result<void> scan(std::uint64_t end) {
    counts_.clear();
    info_.notes.clear();
    std::uint64_t at = kMagic.size();
    while (at < end) {
      const auto record_result = record_at(at, end);
      if (!record_result) return stop_at(record_result.error());
      const Record& record = *record_result;
      if (record.op == Op::kFooter) return {};
      if (record.op == Op::kDataEnd) return verifies_ ? verify_data_end(record) : Result<void>();
      if (record.op == Op::kMessage || record.op == Op::kSchema || record.op == Op::kChannel) {
        auto run_end = scan_run(record, end);
        if (!run_end) return stop_at(run_end.error());
        at = *run_end;
        continue;
      }
      Result<void> taken;
      if (record.op == Op::kChunk) taken = scan_chunk(record);
      if (record.op == Op::kMetadata) taken = take_metadata(record);
      if (verifies_ && record.op == Op::kMessageIndex) taken = verify_message_index(record);
      if (verifies_ && record.op == Op::kAttachment) taken = verify_attachment(record);
      if (static_cast<std::uint8_t>(record.op) == 0) return stop_at(damaged(at, "got opcode 0, wanted a record"));
      if (!taken) {
        if (!recovers_) return taken;
        info_.damage.push_back(taken.error().message);  // its length was fine: go on behind it
      }
      at = record.end();
    }
    return stop_at(damaged(end, "cut off: the data has no end"));
  }

  Result<void> stop_at(const Error& error) {
    if (!recovers_) return error;
    info_.damage.push_back(error.message);
    return {};
  }

  Result<void> scan_chunk(const Record& record) {
    auto head_result = file_.read(record.body(), std::min<std::uint64_t>(record.size, chunk_head_size("") + 64));
    if (!head_result) return head_result.error();
    const auto head = parse_chunk(*head_result);
    if (!head || record.size < chunk_head_size(head->compression) ||
        head->stored != record.size - chunk_head_size(head->compression)) {
      return damaged(record.offset, "a chunk is malformed");
    }
    const auto start_result = time_of(head->start, record.offset);
    const auto end_result = time_of(head->end, record.offset);
    if (!start_result) return start_result.error();
    if (!end_result) return end_result.error();
    Block block{.offset = record.offset,
                .length = record.end() - record.offset,
                .stored = head->stored,
                .size = head->size,
                .compression = head->compression,
                .start = *start_result,
                .end = *end_result};
    auto records_result = records_of(block);
    if (!records_result) return records_result.error();
    return take_block(std::move(block), *records_result);
  }

  // Records outside of chunks from `first` on, as long as there are only such.
  Result<std::uint64_t> scan_run(const Record& first, std::uint64_t end) {
    std::uint64_t at = first.end();
    while (at < end && at - first.offset < kRunBytes) {
      const auto record_result = record_at(at, end);
      if (!record_result) break;  // who scans finds it again
      const Op op = record_result->op;
      if (op != Op::kMessage && op != Op::kSchema && op != Op::kChannel) break;
      at = record_result->end();
    }
    Block block{.is_chunk = false, .offset = first.offset, .length = at - first.offset};
    auto records_result = records_of(block);
    if (!records_result) return records_result.error();
    if (auto ok = take_block(std::move(block), *records_result); !ok) {
      if (!recovers_) return ok.error();
      info_.damage.push_back(ok.error().message);
    }
    return at;
  }

  Result<void> verify_data_end(const Record& record) const {
    auto body_result = file_.read(record.body(), record.size);
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
      return damaged(record.offset, fmt::format("data: got checksum {:08x}, wanted {:08x}", crc, wanted));
    }
    return {};
  }

  Result<void> verify_attachment(const Record& record) const {
    auto body_result = file_.read(record.body(), record.size);
    if (!body_result) return body_result.error();
    if (body_result->size() < sizeof(std::uint32_t)) return damaged(record.offset, "an attachment is malformed");
    const View data = View(*body_result).first(body_result->size() - sizeof(std::uint32_t));
    const auto wanted = Parser(View(*body_result).last(sizeof(std::uint32_t))).number<std::uint32_t>();
    if (wanted != 0 && crc32_of(data) != wanted) {
      return damaged(record.offset,
                     fmt::format("attachment: got checksum {:08x}, wanted {:08x}", crc32_of(data), wanted));
    }
    return {};
  }

  // It tells of the chunk before it.
  Result<void> verify_message_index(const Record& record) const {
    auto body_result = file_.read(record.body(), record.size);
    if (!body_result) return body_result.error();
    Parser from(*body_result);
    const auto channel = from.number<std::uint16_t>();
    std::vector<std::pair<std::uint64_t, std::uint64_t>> got;
    Parser entries = from.part();
    while (!entries.at_end()) {
      const auto time = entries.number<std::uint64_t>();
      got.emplace_back(time, entries.number<std::uint64_t>());
    }
    if (!from.ok() || !entries.ok()) return damaged(record.offset, "a message index is malformed");
    std::ranges::sort(got);
    const auto wanted = last_chunk_.find(channel);
    if (wanted == last_chunk_.end() ? !got.empty() : got != wanted->second) {
      return damaged(
          record.offset,
          fmt::format("message index of channel {}: it tells of other messages than the chunk has", channel));
    }
    return {};
  }

  // Counts a block's messages and keeps it, if it has any.
  Result<void> take_block(Block block, const Bytes& records) {
    Time earliest = std::numeric_limits<Time>::max(), latest = std::numeric_limits<Time>::min();
    std::map<std::uint16_t, std::uint64_t> counts;
    last_chunk_.clear();
    auto ok = walk(block, records, [&](Op op, View body, std::uint64_t offset) -> Result<void> {
      if (op != Op::kMessage) return take_definition(op, body, block.offset);
      const auto head = parse_message(body);
      if (!head) return damaged_in(block, offset, "a message is malformed");
      const auto time_result = time_of(head->log_time, block.offset);
      if (!time_result) return time_result.error();
      if (!topics_.contains(head->channel)) {
        return damaged_in(block, offset,
                          fmt::format("got a message of channel {}, wanted one that the file has", head->channel));
      }
      earliest = std::min(earliest, *time_result);
      latest = std::max(latest, *time_result);
      ++counts[head->channel];
      if (verifies_) last_chunk_[head->channel].emplace_back(head->log_time, offset);
      return {};
    });
    if (!ok) return ok;
    for (auto& [channel, entries] : last_chunk_) std::ranges::sort(entries);
    if (counts.empty()) return {};
    block.start = earliest;
    block.end = latest;
    block.knows_channels = true;
    for (const auto& [channel, count] : counts) counts_[channel] += count;
    block.channels = std::move(counts);
    blocks_.push_back(std::move(block));
    return {};
  }

  Error damaged_in(const Block& block, std::uint64_t offset, const std::string& what) const {
    if (!block.is_chunk) return damaged(block.offset + offset, what);
    return damaged(block.offset, fmt::format("chunk: byte {} of its records: {}", offset, what));
  }

  // A block's records, decompressed; checked against the chunk's own head and checksum.
  Result<Bytes> records_of(const Block& block) const {
    if (!block.is_chunk) return file_.read(block.offset, block.length);
    auto bytes_result = file_.read(block.offset, block.length);
    if (!bytes_result) return bytes_result;
    Parser head(View(*bytes_result).first(kRecordHead));
    const Op op = static_cast<Op>(head.number<std::uint8_t>());
    const auto length = head.number<std::uint64_t>();
    const auto chunk = parse_chunk(View(*bytes_result).subspan(kRecordHead));
    if (op != Op::kChunk || length != block.length - kRecordHead || !chunk || chunk->stored != block.stored ||
        chunk->size != block.size || chunk->compression != block.compression) {
      return damaged(block.offset, "got other bytes, wanted the chunk that the index tells of");
    }
    if (!is_known_compression(chunk->compression)) {
      return Error{Code::kInvalidArgument, fmt::format("{}: byte {}: got compression '{}', wanted zstd, lz4 or none",
                                                       file_.path().string(), block.offset, chunk->compression)};
    }
    const View stored = View(*bytes_result).last(static_cast<std::size_t>(chunk->stored));
    auto records = decompress(chunk->compression, stored, chunk->size);
    if (!records) {
      return damaged(block.offset, fmt::format("chunk: cannot be decompressed ({}, {} bytes to {})", chunk->compression,
                                               chunk->stored, chunk->size));
    }
    if (chunk->crc != 0 && crc32_of(*records) != chunk->crc) {
      return damaged(block.offset,
                     fmt::format("chunk: got checksum {:08x}, wanted {:08x}", crc32_of(*records), chunk->crc));
    }
    return std::move(*records);
  }

  // Calls on_record(op, body, offset of the head) for each Schema, Channel and Message.
  template <class OnRecord>
  Result<void> walk(const Block& block, const Bytes& records, OnRecord on_record) const {
    std::uint64_t at = 0;
    while (at < records.size()) {
      Parser rest(View(records).subspan(at));
      const Op op = static_cast<Op>(rest.number<std::uint8_t>());
      const auto size = rest.number<std::uint64_t>();
      const View body = rest.bytes(size);
      if (!rest.ok()) return damaged_in(block, at, "a record is longer than what holds it");
      if (op == Op::kSchema || op == Op::kChannel || op == Op::kMessage) {
        if (auto ok = on_record(op, body, at); !ok) return ok;
      }
      at += kRecordHead + size;
    }
    return {};
  }

  Result<Loaded> load(const Block& block) const {
    auto records_result = records_of(block);
    if (!records_result) return records_result.error();
    Loaded loaded;
    auto ok = walk(block, *records_result, [&](Op op, View body, std::uint64_t offset) -> Result<void> {
      if (op != Op::kMessage) return {};
      const auto head = parse_message(body);
      if (!head) return damaged_in(block, offset, "a message is malformed");
      const auto topic = topics_.find(head->channel);
      if (topic == topics_.end()) {
        return damaged_in(block, offset,
                          fmt::format("got a message of channel {}, wanted one that the file has", head->channel));
      }
      const auto time_result = time_of(head->log_time, block.offset);
      if (!time_result) return time_result.error();
      if (*time_result < block.start || *time_result > block.end) {
        return damaged_in(block, offset,
                          fmt::format("got log time {}, wanted one of {} to {} as the chunk says", *time_result,
                                      block.start, block.end));
      }
      loaded.entries.push_back(
          {.log_time = *time_result, .offset = offset + kRecordHead, .size = body.size(), .topic = topic->second});
      return {};
    });
    if (!ok) return ok.error();
    std::ranges::stable_sort(loaded.entries, {}, &Entry::log_time);
    loaded.records = std::move(*records_result);
    return loaded;
  }

  Message message_of(const Loaded& loaded, const Entry& entry) const {
    const View body = View(loaded.records).subspan(entry.offset, entry.size);
    const auto head = *parse_message(body);
    const View data = body.subspan(kMessageHead);
    return {.topic = entry.topic,
            .log_time = entry.log_time,
            .publish_time = static_cast<Time>(head.publish_time),
            .sequence = head.sequence,
            .data = Bytes(data.begin(), data.end())};
  }

  bool may_have(const Block& block, int topic) const {
    if (!block.knows_channels) return true;
    return std::ranges::any_of(block.channels, [&](const auto& channel) {
      const auto known = topics_.find(channel.first);
      return known == topics_.end() || known->second == topic;  // unknown: load() says what is wrong
    });
  }

  bool may_have_wanted(const Block& block) const {
    if (wanted_.empty() || !block.knows_channels) return true;
    return std::ranges::any_of(block.channels, [&](const auto& channel) {
      const auto known = topics_.find(channel.first);
      return known == topics_.end() || wanted_[static_cast<std::size_t>(known->second)];
    });
  }

  // Loads a block for next(), unless nothing in it is wanted.
  Result<void> take_up(std::size_t index) {
    const Block& block = blocks_[index];
    if (block.end < from_ || !may_have_wanted(block)) return {};
    auto loaded_result = load(block);
    if (!loaded_result) {
      if (!recovers_) return loaded_result.error();
      info_.damage.push_back(loaded_result.error().message);
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
    while (entry < entries.size() && !wanted_.empty() && !wanted_[static_cast<std::size_t>(entries[entry].topic)]) {
      ++entry;
    }
    if (entry == entries.size()) return false;
    cursors_.push({.log_time = entries[entry].log_time, .block = index, .entry = entry});
    return true;
  }

  // Files with chunks have all messages in them, under checksums: what looks like one outside
  // is something else that was damaged.
  void leave_out_strays() {
    if (std::ranges::none_of(blocks_, &Block::is_chunk)) return;
    for (const Block& block : blocks_) {
      if (block.is_chunk) continue;
      for (const auto& [channel, count] : block.channels) counts_[channel] -= count;
    }
    std::erase_if(blocks_, [](const Block& block) { return !block.is_chunk; });
  }

  // The first chunk, if the file says that it repeats others.
  void leave_out_repeated() {
    if (!repeated_at_) return;
    const auto first = std::ranges::min_element(blocks_, {}, &Block::offset);
    for (const auto& [channel, unused] : first->channels) {
      if (const auto count = counts_.find(channel); count != counts_.end() && count->second > 0) --count->second;
    }
    blocks_.erase(first);
  }

  Result<void> finish() {
    // A chunk without messages has no times.
    std::erase_if(blocks_,
                  [](const Block& block) { return block.is_chunk && block.knows_channels && block.channels.empty(); });
    std::ranges::sort(blocks_, {}, &Block::offset);
    by_start_.resize(blocks_.size());
    for (std::size_t i = 0; i < by_start_.size(); ++i) by_start_[i] = i;
    std::ranges::stable_sort(by_start_, {}, [&](std::size_t block) { return blocks_[block].start; });
    Time latest = std::numeric_limits<Time>::min();
    for (const std::size_t block : by_start_) latest_end_.push_back(latest = std::max(latest, blocks_[block].end));
    for (const auto& [channel, count] : counts_) {
      info_.messages += count;
      if (const auto topic = topics_.find(channel); topic != topics_.end()) {
        info_.topics[static_cast<std::size_t>(topic->second)].messages += count;
      }
    }
    if (!blocks_.empty()) {
      info_.start = blocks_[by_start_.front()].start;
      info_.end = latest;
    }
    return {};
  }

  InputFile file_;
  const OpenOptions options_;
  bool recovers_ = false;  // steps over damage
  bool verifies_ = false;  // scan() looks at what reading does not need, too
  FileInfo info_;
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, int> topics_;  // by channel
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::optional<std::uint64_t> repeated_at_;
  /// Of the chunk that verify() saw last: log times and offsets by channel, sorted.
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> last_chunk_;

  std::vector<Block> blocks_;          // as they lie in the file
  std::vector<std::size_t> by_start_;  // blocks in the order of their beginnings
  std::vector<Time> latest_end_;       // of by_start_ up to each

  Time from_ = std::numeric_limits<Time>::min();
  std::vector<bool> wanted_;
  std::size_t next_block_ = 0;            // of by_start_
  std::priority_queue<Cursor> cursors_;   // the next message of every loaded block
  std::map<std::size_t, Loaded> loaded_;  // by block

  std::size_t kept_ = std::numeric_limits<std::size_t>::max();  // block that last_at() has at hand
  Loaded kept_block_;
  std::uint64_t best_offset_ = 0;
};

}  // namespace

Result<std::unique_ptr<FileReader>> open_mcap(const std::filesystem::path& file, const OpenOptions& options) {
  auto input_result = InputFile::open(file);
  if (!input_result) return input_result.error();
  auto reader = std::make_unique<McapReader>(std::move(*input_result), options);
  if (auto ok = reader->open(); !ok) return ok.error();
  return std::unique_ptr<FileReader>(std::move(reader));
}

const Storage& mcap_storage() {
  static constexpr Storage kStorage{"mcap", ".mcap", create_mcap, open_mcap};
  return kStorage;
}

}  // namespace jostle::bag
