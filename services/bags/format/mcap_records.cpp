#include "services/bags/format/mcap_records.hpp"

#include <fmt/format.h>

#include <limits>

#include "services/bags/format/checksum.hpp"
#include "services/bags/format/compression.hpp"

namespace jostle::bags::mcap {

Result<Record> record_at(const InputFile& file, std::uint64_t offset, std::uint64_t end) {
  if (end - offset < kRecordHead) {
    return file.damaged(offset, fmt::format("cut off: got {} bytes, wanted a record", end - offset));
  }
  auto head_result = file.read(offset, kRecordHead);
  if (!head_result) return head_result.error();
  Parser head(*head_result);
  Record record{.op = static_cast<Op>(head.number<std::uint8_t>()), .offset = offset};
  record.size = head.number<std::uint64_t>();
  if (record.size > end - record.body()) {
    return file.damaged(
        offset, fmt::format("cut off: got a record of {} bytes, wanted at most {}", record.size, end - record.body()));
  }
  return record;
}

Result<Bytes> body_of(const InputFile& file, const Record& record) { return file.read(record.body(), record.size); }

std::optional<Time> time_of(std::uint64_t value) {
  if (value > static_cast<std::uint64_t>(std::numeric_limits<Time>::max())) return {};
  return static_cast<Time>(value);
}

Result<BlockRecords> records_of(const InputFile& file, const Block& block) {
  auto bytes_result = file.read(block.offset, block.length);
  if (!bytes_result) return bytes_result.error();
  if (!block.is_chunk) return BlockRecords{.bytes = std::move(*bytes_result)};
  Parser head(View(*bytes_result).first(kRecordHead));
  const Op op = static_cast<Op>(head.number<std::uint8_t>());
  const auto length = head.number<std::uint64_t>();
  const auto chunk = parse_chunk(View(*bytes_result).subspan(kRecordHead));
  if (op != Op::kChunk || length != block.length - kRecordHead || !chunk || chunk->stored != block.stored ||
      chunk->size != block.size || chunk->compression != block.compression) {
    return file.damaged(block.offset, "got other bytes, wanted the chunk that the index tells of");
  }
  if (!is_known_compression(chunk->compression)) {
    return Error{Code::kInvalidArgument, fmt::format("{}: byte {}: got compression '{}', wanted zstd, lz4 or none",
                                                     file.path().string(), block.offset, chunk->compression)};
  }
  const View stored = View(*bytes_result).last(static_cast<std::size_t>(chunk->stored));
  auto records = decompress(chunk->compression, stored, chunk->size);
  if (!records) {
    return file.damaged(block.offset, fmt::format("chunk: cannot be decompressed ({}, {} bytes to {})",
                                                  chunk->compression, chunk->stored, chunk->size));
  }
  BlockRecords result{.bytes = std::move(*records)};
  if (const std::uint32_t crc = crc32_of(result.bytes); chunk->crc != 0 && crc != chunk->crc) {
    result.problem =
        file.damaged(block.offset, fmt::format("chunk: got checksum {:08x}, wanted {:08x}", crc, chunk->crc));
  }
  return result;
}

Result<Attachment> read_attachment(const InputFile& file, const Record& record) {
  auto body_result = body_of(file, record);
  if (!body_result) return body_result.error();
  const View body = *body_result;
  const auto head = parse_attachment(body);
  constexpr std::size_t kCrc = sizeof(std::uint32_t);
  if (!head || body.size() != attachment_head_size(*head) + head->size + kCrc) {
    return file.damaged(record.offset, "an attachment is malformed");
  }
  const auto wanted = Parser(body.last(kCrc)).number<std::uint32_t>();
  if (const std::uint32_t crc = crc32_of(body.first(body.size() - kCrc)); wanted != 0 && crc != wanted) {
    return file.damaged(record.offset, fmt::format("attachment: got checksum {:08x}, wanted {:08x}", crc, wanted));
  }
  const View data = body.subspan(attachment_head_size(*head), static_cast<std::size_t>(head->size));
  return Attachment{.name = head->name,
                    .media_type = head->media_type,
                    .log_time = static_cast<Time>(head->log_time),
                    .create_time = static_cast<Time>(head->create_time),
                    .data = {data.begin(), data.end()}};
}

Error damaged_in(const InputFile& file, const Block& block, std::uint64_t offset, const std::string& what) {
  if (!block.is_chunk) return file.damaged(block.offset + offset, what);
  return file.damaged(block.offset, fmt::format("chunk: byte {} of its records: {}", offset, what));
}

std::string where_in(const InputFile& file, const Block& block, std::uint64_t offset) {
  if (!block.is_chunk) return fmt::format("{}: byte {}", file.path().string(), block.offset + offset);
  return fmt::format("{}: byte {}: chunk: byte {} of its records", file.path().string(), block.offset, offset);
}

bool is_plausible(Op op, std::uint64_t size) {
  switch (op) {
    case Op::kHeader:
    case Op::kMetadata:
      return size >= 8;
    case Op::kFooter:
      return size == 20;
    case Op::kSchema:
      return size >= 14;
    case Op::kChannel:
      return size >= 16;
    case Op::kMessage:
      return size >= kMessageHead;
    case Op::kChunk:
      return size >= chunk_head_size("");
    case Op::kMessageIndex:
      return size >= 6 && (size - 6) % 16 == 0;
    case Op::kChunkIndex:
      return size >= 64;
    case Op::kAttachment:
      return size >= 36;
    case Op::kAttachmentIndex:
      return size >= 48;
    case Op::kStatistics:
      return size >= 46;
    case Op::kMetadataIndex:
      return size >= 20;
    case Op::kSummaryOffset:
      return size == 17;
    case Op::kDataEnd:
      return size == 4;
  }
  return false;
}

}  // namespace jostle::bags::mcap
