#include "services/bags/format/mcap_format.hpp"

#include "services/bags/format/checksum.hpp"

namespace jostle::bags::mcap {
namespace {

void append_map(Appender& to, const std::map<std::string, std::string>& map) {
  to.sized<std::uint32_t>([&] {
    for (const auto& [key, value] : map) {
      to.text(key);
      to.text(value);
    }
  });
}

void append_map(Appender& to, const std::map<std::uint16_t, std::uint64_t>& map) {
  to.sized<std::uint32_t>([&] {
    for (const auto& [key, value] : map) {
      to.number(key);
      to.number(value);
    }
  });
}

std::map<std::string, std::string> parse_texts(Parser& from) {
  std::map<std::string, std::string> map;
  Parser part = from.part();
  while (!part.at_end()) {
    std::string key = part.text();
    map[std::move(key)] = part.text();
  }
  if (!part.ok()) from.fail();
  return map;
}

std::map<std::uint16_t, std::uint64_t> parse_numbers(Parser& from) {
  std::map<std::uint16_t, std::uint64_t> map;
  Parser part = from.part();
  while (!part.at_end()) {
    const auto key = part.number<std::uint16_t>();
    map[key] = part.number<std::uint64_t>();
  }
  if (!part.ok()) from.fail();
  return map;
}

template <class T>
std::optional<T> if_ok(const Parser& parser, T&& value) {
  if (!parser.ok()) return {};
  return std::forward<T>(value);
}

}  // namespace

void append_magic(Bytes& out) { Appender(out).bytes(std::as_bytes(std::span(kMagic))); }

void append_header(Bytes& out, const std::string& profile, const std::string& library) {
  Appender to(out);
  to.record(Op::kHeader, [&] {
    to.text(profile);
    to.text(library);
  });
}

void append(Bytes& out, const Schema& schema) {
  Appender to(out);
  to.record(Op::kSchema, [&] {
    to.number(schema.id);
    to.text(schema.name);
    to.text(schema.encoding);
    to.text(schema.data);
  });
}

void append(Bytes& out, const Channel& channel) {
  Appender to(out);
  to.record(Op::kChannel, [&] {
    to.number(channel.id);
    to.number(channel.schema);
    to.text(channel.topic);
    to.text(channel.encoding);
    append_map(to, channel.metadata);
  });
}

void append_message(Bytes& out, const MessageHead& head, View data) {
  // By hand: this is what is done for every message.
  std::array<std::byte, kRecordHead + kMessageHead> bytes;
  std::byte* at = bytes.data();
  const auto put = [&at](auto value) {
    std::memcpy(at, &value, sizeof value);
    at += sizeof value;
  };
  put(Op::kMessage);
  put(std::uint64_t{kMessageHead + data.size()});
  put(head.channel);
  put(head.sequence);
  put(head.log_time);
  put(head.publish_time);
  out.insert(out.end(), bytes.begin(), bytes.end());
  out.insert(out.end(), data.begin(), data.end());
}

void append(Bytes& out, const ChunkHead& chunk) {
  Appender to(out);
  to.number(static_cast<std::uint8_t>(Op::kChunk));
  to.number(std::uint64_t{chunk_head_size(chunk.compression) + chunk.stored});
  to.number(chunk.start);
  to.number(chunk.end);
  to.number(chunk.size);
  to.number(chunk.crc);
  to.text(chunk.compression);
  to.number(chunk.stored);
}

void append_message_index(Bytes& out, std::uint16_t channel,
                          const std::vector<std::pair<std::uint64_t, std::uint64_t>>& entries) {
  Appender to(out);
  to.record(Op::kMessageIndex, [&] {
    to.number(channel);
    to.sized<std::uint32_t>([&] {
      for (const auto& [time, offset] : entries) {
        to.number(time);
        to.number(offset);
      }
    });
  });
}

void append(Bytes& out, const ChunkIndex& index) {
  Appender to(out);
  to.record(Op::kChunkIndex, [&] {
    to.number(index.start);
    to.number(index.end);
    to.number(index.offset);
    to.number(index.length);
    append_map(to, index.message_indexes);
    to.number(index.message_index_length);
    to.text(index.compression);
    to.number(index.stored);
    to.number(index.size);
  });
}

void append(Bytes& out, const Statistics& statistics) {
  Appender to(out);
  to.record(Op::kStatistics, [&] {
    to.number(statistics.messages);
    to.number(statistics.schemas);
    to.number(statistics.channels);
    to.number(statistics.attachments);
    to.number(statistics.metadata);
    to.number(statistics.chunks);
    to.number(statistics.start);
    to.number(statistics.end);
    append_map(to, statistics.channel_messages);
  });
}

void append(Bytes& out, const Metadata& metadata) {
  Appender to(out);
  to.record(Op::kMetadata, [&] {
    to.text(metadata.name);
    append_map(to, metadata.metadata);
  });
}

void append(Bytes& out, const MetadataIndex& index) {
  Appender to(out);
  to.record(Op::kMetadataIndex, [&] {
    to.number(index.offset);
    to.number(index.length);
    to.text(index.name);
  });
}

void append_attachment(Bytes& out, const AttachmentHead& head, View data) {
  Appender to(out);
  to.record(Op::kAttachment, [&] {
    const std::size_t from = out.size();
    to.number(head.log_time);
    to.number(head.create_time);
    to.text(head.name);
    to.text(head.media_type);
    to.number(std::uint64_t{data.size()});
    to.bytes(data);
    to.number(crc32_of(View(out).subspan(from)));
  });
}

void append(Bytes& out, const AttachmentIndex& index) {
  Appender to(out);
  to.record(Op::kAttachmentIndex, [&] {
    to.number(index.offset);
    to.number(index.length);
    to.number(index.head.log_time);
    to.number(index.head.create_time);
    to.number(index.head.size);
    to.text(index.head.name);
    to.text(index.head.media_type);
  });
}

void append(Bytes& out, const SummaryOffset& offset) {
  Appender to(out);
  to.record(Op::kSummaryOffset, [&] {
    to.number(static_cast<std::uint8_t>(offset.group));
    to.number(offset.start);
    to.number(offset.length);
  });
}

void append_data_end(Bytes& out, std::uint32_t crc) {
  Appender to(out);
  to.record(Op::kDataEnd, [&] { to.number(crc); });
}

void append_footer(Bytes& out, std::uint64_t summary_start, std::uint64_t summary_offset_start,
                   std::uint32_t crc_before) {
  const std::size_t from = out.size();
  Appender to(out);
  to.record(Op::kFooter, [&] {
    to.number(summary_start);
    to.number(summary_offset_start);
    to.number(std::uint32_t{0});
  });
  // The checksum covers everything from the summary on up to this number.
  const std::uint32_t crc = crc32_of(View(out).subspan(from, kFooterRecord - sizeof(std::uint32_t)), crc_before);
  std::memcpy(out.data() + out.size() - sizeof crc, &crc, sizeof crc);
}

std::optional<Schema> parse_schema(View body) {
  Parser from(body);
  Schema schema;
  schema.id = from.number<std::uint16_t>();
  schema.name = from.text();
  schema.encoding = from.text();
  schema.data = from.text();
  return if_ok(from, std::move(schema));
}

std::optional<Channel> parse_channel(View body) {
  Parser from(body);
  Channel channel;
  channel.id = from.number<std::uint16_t>();
  channel.schema = from.number<std::uint16_t>();
  channel.topic = from.text();
  channel.encoding = from.text();
  channel.metadata = parse_texts(from);
  return if_ok(from, std::move(channel));
}

std::optional<MessageHead> parse_message(View body) {
  Parser from(body);
  MessageHead head;
  head.channel = from.number<std::uint16_t>();
  head.sequence = from.number<std::uint32_t>();
  head.log_time = from.number<std::uint64_t>();
  head.publish_time = from.number<std::uint64_t>();
  return if_ok(from, std::move(head));
}

std::optional<ChunkHead> parse_chunk(View body) {
  Parser from(body);
  ChunkHead chunk;
  chunk.start = from.number<std::uint64_t>();
  chunk.end = from.number<std::uint64_t>();
  chunk.size = from.number<std::uint64_t>();
  chunk.crc = from.number<std::uint32_t>();
  chunk.compression = from.text();
  chunk.stored = from.number<std::uint64_t>();
  return if_ok(from, std::move(chunk));
}

std::optional<ChunkIndex> parse_chunk_index(View body) {
  Parser from(body);
  ChunkIndex index;
  index.start = from.number<std::uint64_t>();
  index.end = from.number<std::uint64_t>();
  index.offset = from.number<std::uint64_t>();
  index.length = from.number<std::uint64_t>();
  index.message_indexes = parse_numbers(from);
  index.message_index_length = from.number<std::uint64_t>();
  index.compression = from.text();
  index.stored = from.number<std::uint64_t>();
  index.size = from.number<std::uint64_t>();
  return if_ok(from, std::move(index));
}

std::optional<Statistics> parse_statistics(View body) {
  Parser from(body);
  Statistics statistics;
  statistics.messages = from.number<std::uint64_t>();
  statistics.schemas = from.number<std::uint16_t>();
  statistics.channels = from.number<std::uint32_t>();
  statistics.attachments = from.number<std::uint32_t>();
  statistics.metadata = from.number<std::uint32_t>();
  statistics.chunks = from.number<std::uint32_t>();
  statistics.start = from.number<std::uint64_t>();
  statistics.end = from.number<std::uint64_t>();
  statistics.channel_messages = parse_numbers(from);
  return if_ok(from, std::move(statistics));
}

std::optional<Metadata> parse_metadata(View body) {
  Parser from(body);
  Metadata metadata;
  metadata.name = from.text();
  metadata.metadata = parse_texts(from);
  return if_ok(from, std::move(metadata));
}

std::optional<MetadataIndex> parse_metadata_index(View body) {
  Parser from(body);
  MetadataIndex index;
  index.offset = from.number<std::uint64_t>();
  index.length = from.number<std::uint64_t>();
  index.name = from.text();
  return if_ok(from, std::move(index));
}

std::optional<AttachmentHead> parse_attachment(View body) {
  Parser from(body);
  AttachmentHead head;
  head.log_time = from.number<std::uint64_t>();
  head.create_time = from.number<std::uint64_t>();
  head.name = from.text();
  head.media_type = from.text();
  head.size = from.number<std::uint64_t>();
  return if_ok(from, std::move(head));
}

std::optional<AttachmentIndex> parse_attachment_index(View body) {
  Parser from(body);
  AttachmentIndex index;
  index.offset = from.number<std::uint64_t>();
  index.length = from.number<std::uint64_t>();
  index.head.log_time = from.number<std::uint64_t>();
  index.head.create_time = from.number<std::uint64_t>();
  index.head.size = from.number<std::uint64_t>();
  index.head.name = from.text();
  index.head.media_type = from.text();
  return if_ok(from, std::move(index));
}

std::optional<SummaryOffset> parse_summary_offset(View body) {
  Parser from(body);
  SummaryOffset offset;
  offset.group = static_cast<Op>(from.number<std::uint8_t>());
  offset.start = from.number<std::uint64_t>();
  offset.length = from.number<std::uint64_t>();
  return if_ok(from, std::move(offset));
}

std::optional<Footer> parse_footer(View body) {
  Parser from(body);
  Footer footer;
  footer.summary_start = from.number<std::uint64_t>();
  footer.summary_offset_start = from.number<std::uint64_t>();
  footer.summary_crc = from.number<std::uint32_t>();
  return if_ok(from, std::move(footer));
}

}  // namespace jostle::bags::mcap
