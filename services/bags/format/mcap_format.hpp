#pragma once
/// \file
/// MCAP's records as values: bytes to value and back.
///
/// Source  the MCAP specification, https://mcap.dev/spec: a file is magic, records, magic; a
///         record is its opcode, its length and its body; numbers are little-endian.

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace jostle::bags::mcap {

using Bytes = std::vector<std::byte>;
using View = std::span<const std::byte>;

inline constexpr std::array<unsigned char, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr std::size_t kRecordHead = 9;    ///< opcode and length
inline constexpr std::size_t kMessageHead = 22;  ///< bytes of a Message's body in front of its data
inline constexpr std::size_t kFooterRecord = kRecordHead + 20;

enum class Op : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// Puts values behind what a buffer holds.
class Appender {
 public:
  explicit Appender(Bytes& out) : out_(out) {}

  template <std::integral T>
  void number(T value) {
    const std::size_t at = out_.size();
    out_.resize(at + sizeof value);
    std::memcpy(out_.data() + at, &value, sizeof value);
  }
  void bytes(View data) { out_.insert(out_.end(), data.begin(), data.end()); }
  void text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    bytes(std::as_bytes(std::span(value)));
  }

  /// Appends a length of type T, and behind it what `content` appends.
  template <std::unsigned_integral T, class Content>
  void sized(Content&& content) {
    number(T{0});
    const std::size_t from = out_.size();
    content();
    const T length = static_cast<T>(out_.size() - from);
    std::memcpy(out_.data() + from - sizeof length, &length, sizeof length);
  }
  template <class Content>
  void record(Op op, Content&& content) {
    number(static_cast<std::uint8_t>(op));
    sized<std::uint64_t>(std::forward<Content>(content));
  }

 private:
  Bytes& out_;
};

/// Takes values off bytes that nobody vouches for. What is not there reads as 0 or empty,
/// and from then on ok() is false.
class Parser {
 public:
  explicit Parser(View data) : data_(data) {}

  bool ok() const { return ok_; }
  bool at_end() const { return !ok_ || data_.empty(); }
  std::size_t left() const { return data_.size(); }

  View bytes(std::uint64_t count) {
    if (count > data_.size()) {
      ok_ = false;
      data_ = {};
      return {};
    }
    const View taken = data_.first(count);
    data_ = data_.subspan(count);
    return taken;
  }
  template <std::integral T>
  T number() {
    T value = 0;
    if (const View taken = bytes(sizeof value); taken.size() == sizeof value) {
      std::memcpy(&value, taken.data(), sizeof value);
    }
    return value;
  }
  std::string text() {
    const View taken = bytes(number<std::uint32_t>());
    return {reinterpret_cast<const char*>(taken.data()), taken.size()};
  }
  /// Takes off a part that has its length, 32 bits, in front of it.
  Parser part() { return Parser(bytes(number<std::uint32_t>())); }
  /// Notes that a part was malformed.
  void fail() { ok_ = false; }

 private:
  View data_;
  bool ok_ = true;
};

struct Schema {
  std::uint16_t id = 0;
  std::string name, encoding, data;
  bool operator==(const Schema&) const = default;
};

struct Channel {
  std::uint16_t id = 0, schema = 0;
  std::string topic, encoding;
  std::map<std::string, std::string> metadata;
};

struct MessageHead {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time = 0, publish_time = 0;
};

/// A chunk but for its records.
struct ChunkHead {
  std::uint64_t start = 0, end = 0;  ///< log times of its messages
  std::uint64_t size = 0;            ///< bytes of the records, not compressed
  std::uint32_t crc = 0;             ///< checksum of the records, not compressed; 0: not given
  std::string compression;
  std::uint64_t stored = 0;  ///< bytes of the records as they are in the file
};

struct ChunkIndex {
  std::uint64_t start = 0, end = 0;
  std::uint64_t offset = 0, length = 0;                    ///< where the chunk's record is in the file
  std::map<std::uint16_t, std::uint64_t> message_indexes;  ///< offsets in the file, by channel
  std::uint64_t message_index_length = 0;
  std::string compression;
  std::uint64_t stored = 0, size = 0;
};

struct Statistics {
  std::uint64_t messages = 0;
  std::uint16_t schemas = 0;
  std::uint32_t channels = 0, attachments = 0, metadata = 0, chunks = 0;
  std::uint64_t start = 0, end = 0;
  std::map<std::uint16_t, std::uint64_t> channel_messages;
};

struct Metadata {
  std::string name;
  std::map<std::string, std::string> metadata;
};

struct MetadataIndex {
  std::uint64_t offset = 0, length = 0;
  std::string name;
};

/// An attachment but for its data.
struct AttachmentHead {
  std::uint64_t log_time = 0, create_time = 0;
  std::string name, media_type;
  std::uint64_t size = 0;  ///< bytes of the data
};

struct AttachmentIndex {
  std::uint64_t offset = 0, length = 0;  ///< where the attachment's record is in the file
  AttachmentHead head;
};

struct SummaryOffset {
  Op group = Op::kSchema;
  std::uint64_t start = 0, length = 0;
};

struct Footer {
  std::uint64_t summary_start = 0, summary_offset_start = 0;
  std::uint32_t summary_crc = 0;
};

// Whole records, heads included.
void append_magic(Bytes& out);
void append_header(Bytes& out, const std::string& profile, const std::string& library);
void append(Bytes& out, const Schema& schema);
void append(Bytes& out, const Channel& channel);
void append_message(Bytes& out, const MessageHead& head, View data);
/// A chunk's record up to its records, which follow.
void append(Bytes& out, const ChunkHead& chunk);
void append_message_index(Bytes& out, std::uint16_t channel,
                          const std::vector<std::pair<std::uint64_t, std::uint64_t>>& entries);
void append(Bytes& out, const ChunkIndex& index);
void append(Bytes& out, const Statistics& statistics);
void append(Bytes& out, const Metadata& metadata);
void append(Bytes& out, const MetadataIndex& index);
void append_attachment(Bytes& out, const AttachmentHead& head, View data);
void append(Bytes& out, const AttachmentIndex& index);
void append(Bytes& out, const SummaryOffset& offset);
void append_data_end(Bytes& out, std::uint32_t crc);
/// Appends a footer. `crc_before`: checksum of the summary in front of it; 0 for an empty one.
void append_footer(Bytes& out, std::uint64_t summary_start, std::uint64_t summary_offset_start,
                   std::uint32_t crc_before);

// Bodies. Nothing if malformed; fields that later versions add at the end are ignored.
std::optional<Schema> parse_schema(View body);
std::optional<Channel> parse_channel(View body);
std::optional<MessageHead> parse_message(View body);
/// `body` may end after the head.
std::optional<ChunkHead> parse_chunk(View body);
std::optional<ChunkIndex> parse_chunk_index(View body);
std::optional<Statistics> parse_statistics(View body);
std::optional<Metadata> parse_metadata(View body);
std::optional<MetadataIndex> parse_metadata_index(View body);
/// `body` may end after the head.
std::optional<AttachmentHead> parse_attachment(View body);
std::optional<AttachmentIndex> parse_attachment_index(View body);
std::optional<SummaryOffset> parse_summary_offset(View body);
std::optional<Footer> parse_footer(View body);

/// Bytes of a chunk's body in front of its records.
inline std::size_t chunk_head_size(std::string_view compression) { return 8 + 8 + 8 + 4 + 4 + compression.size() + 8; }

/// Bytes of an attachment's body in front of its data; behind them comes a checksum of 4.
inline std::size_t attachment_head_size(const AttachmentHead& head) {
  return 8 + 8 + 4 + head.name.size() + 4 + head.media_type.size() + 8;
}

/// Messages that message indexes of so many channels and bytes tell of; nothing if that cannot be.
inline std::optional<std::uint64_t> indexed_messages(std::uint64_t channels, std::uint64_t length) {
  constexpr std::uint64_t kRest = kRecordHead + 2 + 4, kEntry = 16;  // of a record beside its entries
  if (length < channels * kRest || (length - channels * kRest) % kEntry != 0) return {};
  return (length - channels * kRest) / kEntry;
}

}  // namespace jostle::bags::mcap
