#include "services/bags/format/mcap_index.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "services/bags/format/checksum.hpp"
#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/mcap_scan.hpp"
#include "services/bags/format/qos_text.hpp"

namespace jostle::bags::mcap {
namespace {

constexpr std::uint64_t kTail = kFooterRecord + kMagic.size();

bool has_magic(View bytes) {
  return bytes.size() == kMagic.size() && std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) == 0;
}

Result<void> check_beginning(const InputFile& file) {
  const auto magic_result = file.read(0, std::min<std::uint64_t>(file.size(), kMagic.size()));
  if (!magic_result) return magic_result.error();
  if (has_magic(*magic_result)) return {};
  const auto* bytes = reinterpret_cast<const unsigned char*>(magic_result->data());
  if (magic_result->size() == kMagic.size() && std::equal(bytes, bytes + 5, kMagic.begin()) && bytes[5] > kMagic[5] &&
      bytes[6] == '\r' && bytes[7] == '\n') {
    return Error{Code::kInvalidArgument, fmt::format("{}: got MCAP of version {:c}, wanted 0: a later program wrote it",
                                                     file.path().string(), bytes[5])};
  }
  if (magic_result->empty()) return file.damaged(0, "the file is empty");
  return Error{
      Code::kInvalidArgument,
      fmt::format("{}: byte 0: got something else, wanted the beginning of an MCAP file", file.path().string())};
}

Result<void> add_block(const InputFile& file, const ChunkIndex& chunk, std::uint64_t record_offset, Index& index) {
  const std::uint64_t head = kRecordHead + chunk_head_size(chunk.compression);
  if (chunk.offset > file.size() || chunk.length > file.size() - chunk.offset || chunk.length < head ||
      chunk.stored != chunk.length - head) {
    return file.damaged(record_offset,
                        fmt::format("chunk index: got a chunk of {} bytes at byte {}, wanted one that lies in the file",
                                    chunk.length, chunk.offset));
  }
  const auto start_result = time_of(file, chunk.start, record_offset);
  const auto end_result = time_of(file, chunk.end, record_offset);
  if (!start_result) return start_result.error();
  if (!end_result) return end_result.error();
  Block block{.offset = chunk.offset,
              .length = chunk.length,
              .stored = chunk.stored,
              .size = chunk.size,
              .compression = chunk.compression,
              .start = *start_result,
              .end = *end_result,
              .knows_channels = !chunk.message_indexes.empty()};
  for (const auto& [channel, offset] : chunk.message_indexes) block.channels[channel] = 0;
  index.blocks.push_back(std::move(block));
  return {};
}

Result<void> read_metadata(const InputFile& file, const MetadataIndex& metadata, std::uint64_t end, Index& index) {
  if (metadata.offset > end || metadata.length > end - metadata.offset) {
    return file.damaged(metadata.offset, fmt::format("metadata '{}': got {} bytes, wanted them to lie in the file",
                                                     metadata.name, metadata.length));
  }
  auto record_result = record_at(file, metadata.offset, end);
  if (!record_result) return record_result.error();
  if (record_result->op != Op::kMetadata) {
    return file.damaged(metadata.offset, fmt::format("got another record, wanted metadata '{}'", metadata.name));
  }
  return index.take_metadata(file, *record_result);
}

Result<void> read_summary(const InputFile& file, const Footer& footer, std::uint64_t footer_at, Index& index) {
  if (footer.summary_start < kMagic.size() || footer.summary_start > footer_at) {
    return file.damaged(footer_at, fmt::format("footer: got a summary at byte {}, wanted one before byte {}",
                                               footer.summary_start, footer_at));
  }
  const std::uint64_t with_footer = footer_at - footer.summary_start + kFooterRecord - sizeof footer.summary_crc;
  auto bytes_result = file.read(footer.summary_start, with_footer);
  if (!bytes_result) return bytes_result.error();
  if (footer.summary_crc != 0 && crc32_of(*bytes_result) != footer.summary_crc) {
    return file.damaged(footer.summary_start, fmt::format("summary: got checksum {:08x}, wanted {:08x}",
                                                          crc32_of(*bytes_result), footer.summary_crc));
  }
  std::optional<Statistics> statistics;
  std::vector<MetadataIndex> metadata;
  std::uint64_t at = footer.summary_start;
  while (at < footer_at) {
    auto record_result = record_at(file, at, footer_at);
    if (!record_result) return record_result.error();
    const Record& record = *record_result;
    const View body = View(*bytes_result).subspan(record.body() - footer.summary_start, record.size);
    bool ok = true;
    switch (record.op) {
      case Op::kSchema:
      case Op::kChannel:
        if (auto added = index.take_definition(file, record.op, body, record.offset); !added) return added;
        break;
      case Op::kStatistics:
        statistics = parse_statistics(body);
        ok = statistics.has_value();
        break;
      case Op::kChunkIndex: {
        const auto chunk = parse_chunk_index(body);
        ok = chunk.has_value();
        if (!ok) break;
        if (auto added = add_block(file, *chunk, record.offset, index); !added) return added;
        break;
      }
      case Op::kMetadataIndex: {
        auto entry = parse_metadata_index(body);
        ok = entry.has_value();
        if (ok) metadata.push_back(std::move(*entry));
        break;
      }
      default:
        break;  // what says nothing about messages, or comes from a later version
    }
    if (!ok) return file.damaged(record.offset, "a record of the summary is malformed");
    at = record.end();
  }
  // Without counts, or with messages outside of chunks, only a look at all records helps.
  const bool is_complete =
      statistics && statistics->chunks == index.blocks.size() &&
      (statistics->messages == 0 || (!statistics->channel_messages.empty() && !index.blocks.empty()));
  if (!is_complete) return scan(file, footer_at, ScanMode::kRead, index);
  index.counts = std::move(statistics->channel_messages);
  for (const MetadataIndex& entry : metadata) {
    if (auto ok = read_metadata(file, entry, footer_at, index); !ok) return ok;
  }
  return {};
}

Result<void> read_whole(const InputFile& file, Index& index) {
  if (file.size() < kMagic.size() + kTail) return file.damaged(file.size(), "cut off: the file has no end");
  const std::uint64_t footer_at = file.size() - kTail;
  auto tail_result = file.read(footer_at, kTail);
  if (!tail_result) return tail_result.error();
  const View tail = *tail_result;
  Parser head(tail.first(kRecordHead));
  const Op op = static_cast<Op>(head.number<std::uint8_t>());
  const auto footer = parse_footer(tail.subspan(kRecordHead, kFooterRecord - kRecordHead));
  if (!has_magic(tail.last(kMagic.size())) || op != Op::kFooter ||
      head.number<std::uint64_t>() != kFooterRecord - kRecordHead || !footer) {
    return file.damaged(file.size(),
                        "cut off: the file does not end as MCAP does (its writer was killed, or the disk was full)");
  }
  if (footer->summary_start == 0) return scan(file, footer_at, ScanMode::kRead, index);
  return read_summary(file, *footer, footer_at, index);
}

// Files with chunks have all messages in them, under checksums: what looks like one outside
// is something else that was damaged.
void leave_out_strays(Index& index) {
  if (std::ranges::none_of(index.blocks, &Block::is_chunk)) return;
  for (const Block& block : index.blocks) {
    if (block.is_chunk) continue;
    for (const auto& [channel, count] : block.channels) index.counts[channel] -= count;
  }
  std::erase_if(index.blocks, [](const Block& block) { return !block.is_chunk; });
}

// One message per channel; if damage has not taken it already.
void leave_out_repeated(Index& index) {
  const auto chunk =
      std::ranges::find(index.blocks, index.repeated, [](const Block& block) { return std::optional(block.offset); });
  if (chunk == index.blocks.end()) return;
  for (const auto& [channel, unused] : chunk->channels) {
    if (const auto count = index.counts.find(channel); count != index.counts.end() && count->second > 0) {
      --count->second;
    }
  }
  index.blocks.erase(chunk);
}

// What follows from all blocks and counts.
void finish(Index& index) {
  std::ranges::sort(index.blocks, {}, &Block::offset);
  for (const auto& [channel, count] : index.counts) {
    index.info.messages += count;
    if (const auto topic = index.topics.find(channel); topic != index.topics.end()) {
      index.info.topics[static_cast<std::size_t>(topic->second)].messages += count;
    }
  }
  if (index.blocks.empty()) return;
  index.info.start = std::ranges::min(index.blocks, {}, &Block::start).start;
  index.info.end = std::ranges::max(index.blocks, {}, &Block::end).end;
}

}  // namespace

Result<void> Index::take_definition(const InputFile& file, Op op, View body, std::uint64_t offset) {
  if (op == Op::kSchema) {
    auto schema = parse_schema(body);
    if (!schema) return file.damaged(offset, "a schema is malformed");
    schemas.try_emplace(schema->id, std::move(*schema));
    return {};
  }
  auto channel = parse_channel(body);
  if (!channel) return file.damaged(offset, "a channel is malformed");
  if (topics.contains(channel->id)) return {};
  if (channel->encoding != kMessageEncoding) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: topic {}: got messages encoded as '{}', wanted '{}'", file.path().string(),
                             channel->topic, channel->encoding, kMessageEncoding)};
  }
  const auto schema = schemas.find(channel->schema);
  if (channel->schema != 0 && schema == schemas.end()) {
    return file.damaged(
        offset, fmt::format("topic {}: got schema {}, wanted one that the file has", channel->topic, channel->schema));
  }
  Topic topic{.name = channel->topic};
  if (schema != schemas.end()) {
    topic.type = schema->second.name;
    if (schema->second.encoding == kSchemaEncoding) topic.definition = schema->second.data;
  }
  if (const auto qos = channel->metadata.find(kQosKey); qos != channel->metadata.end()) {
    topic.qos = parse_qos(qos->second);
  }
  // Several channels may be one topic: several writers, or a recording that was merged.
  const auto known = std::ranges::find_if(info.topics, [&](const TopicInfo& other) {
    return other.topic.name == topic.name && other.topic.type == topic.type;
  });
  topics[channel->id] = static_cast<int>(known - info.topics.begin());
  if (known == info.topics.end()) info.topics.push_back({.topic = std::move(topic)});
  return {};
}

Result<void> Index::take_metadata(const InputFile& file, const Record& record) {
  auto body_result = body_of(file, record);
  if (!body_result) return body_result.error();
  const auto metadata = parse_metadata(*body_result);
  if (!metadata) return file.damaged(record.offset, "metadata is malformed");
  if (metadata->name == kRepeatedNote) {
    repeated = record.end();
  } else {
    info.notes[metadata->name] = metadata->metadata;
  }
  return {};
}

Result<Place> Index::place_of(const InputFile& file, const Block& block, View body, std::uint64_t offset) const {
  const auto head = parse_message(body);
  if (!head) return damaged_in(file, block, offset, "a message is malformed");
  const auto time_result = time_of(file, head->log_time, block.offset);
  if (!time_result) return time_result.error();
  const auto topic = topics.find(head->channel);
  if (topic == topics.end()) {
    return damaged_in(file, block, offset,
                      fmt::format("got a message of channel {}, wanted one that the file has", head->channel));
  }
  return Place{.channel = head->channel, .topic = topic->second, .log_time = *time_result};
}

std::uint64_t Index::count_of(std::uint16_t channel) const {
  const auto count = counts.find(channel);
  return count == counts.end() ? 0 : count->second;
}

Result<Index> index_of(const InputFile& file, const OpenOptions& options) {
  if (auto ok = check_beginning(file); !ok) return ok.error();
  Index index;
  auto read = read_whole(file, index);
  if (options.recover) {
    // What a whole summary says of channels outlives the chunks that say it, too.
    if (!read) {
      index = {};
      index.info.damage.push_back(read.error().message);
    }
    read = scan(file, file.size(), ScanMode::kRecover, index);
    leave_out_strays(index);
  }
  if (!read) return read.error();
  if (options.skip_repeated) leave_out_repeated(index);
  finish(index);
  return index;
}

Result<void> verify(const InputFile& file, const Index& index, const OpenOptions& options) {
  Index found;
  if (auto ok = scan(file, file.size() - std::min(file.size(), kTail), ScanMode::kVerify, found); !ok) return ok;
  if (options.skip_repeated) leave_out_repeated(found);
  for (const auto& [channel, topic] : index.topics) {
    const std::uint64_t got = found.count_of(channel), wanted = index.count_of(channel);
    if (got != wanted) {
      return file.damaged(file.size(),
                          fmt::format("topic {}: got {} messages, wanted {} as the statistics say",
                                      index.info.topics[static_cast<std::size_t>(topic)].topic.name, got, wanted));
    }
  }
  return {};
}

}  // namespace jostle::bags::mcap
