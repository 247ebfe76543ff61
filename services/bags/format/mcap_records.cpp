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

Result<Time> time_of(const InputFile& file, std::uint64_t value, std::uint64_t offset) {
  if (value <= static_cast<std::uint64_t>(std::numeric_limits<Time>::max())) return static_cast<Time>(value);
  return file.damaged(offset, fmt::format("log time: got {} ns, wanted one before the year 2262", value));
}

Result<Bytes> records_of(const InputFile& file, const Block& block) {
  auto bytes_result = file.read(block.offset, block.length);
  if (!bytes_result || !block.is_chunk) return bytes_result;
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
  if (chunk->crc != 0 && crc32_of(*records) != chunk->crc) {
    return file.damaged(block.offset,
                        fmt::format("chunk: got checksum {:08x}, wanted {:08x}", crc32_of(*records), chunk->crc));
  }
  return std::move(*records);
}

Error damaged_in(const InputFile& file, const Block& block, std::uint64_t offset, const std::string& what) {
  if (!block.is_chunk) return file.damaged(block.offset + offset, what);
  return file.damaged(block.offset, fmt::format("chunk: byte {} of its records: {}", offset, what));
}

}  // namespace jostle::bags::mcap
