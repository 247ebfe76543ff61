#pragma once
/// \file
/// An MCAP file's records as they lie in it: one by one, or a block of messages at a time. What
/// they say of lengths, sizes and times is checked before it is believed.

#include <cstdint>
#include <map>
#include <string>

#include "idl/types/result.hpp"
#include "services/bags/format/input_file.hpp"
#include "services/bags/format/mcap_format.hpp"
#include "services/bags/format/message.hpp"

namespace jostle::bags::mcap {

struct Record {
  Op op{};
  std::uint64_t offset = 0;  ///< where its head is in the file
  std::uint64_t size = 0;    ///< bytes of the body
  std::uint64_t body() const { return offset + kRecordHead; }
  std::uint64_t end() const { return body() + size; }
};

/// Messages that are read together: a chunk, or a run of records outside of chunks.
struct Block {
  bool is_chunk = true;
  std::uint64_t offset = 0, length = 0;  ///< in the file: the chunk's record, or the run
  std::uint64_t stored = 0, size = 0;    ///< bytes of a chunk's records, in the file and decompressed
  std::string compression;
  Time start = 0, end = 0;
  /// Channels that have messages in it, if knows_channels; how many, if a scan has counted.
  std::map<std::uint16_t, std::uint64_t> channels;
  bool knows_channels = true;
};

/// Reads the record at `offset`, whose body must lie before `end`.
Result<Record> record_at(const InputFile& file, std::uint64_t offset, std::uint64_t end);
Result<Bytes> body_of(const InputFile& file, const Record& record);

/// Checks a time that a file holds. `offset`: where it holds it, for the error.
Result<Time> time_of(const InputFile& file, std::uint64_t value, std::uint64_t offset);

/// Reads a block's records, decompresses them, and checks them against the chunk's own head and checksum.
Result<Bytes> records_of(const InputFile& file, const Block& block);

/// Makes the Error that says what is wrong `offset` bytes behind the beginning of a block's records.
Error damaged_in(const InputFile& file, const Block& block, std::uint64_t offset, const std::string& what);

/// Whether blocks have records of this kind.
inline bool is_of_blocks(Op op) { return op == Op::kSchema || op == Op::kChannel || op == Op::kMessage; }

/// Calls on_record(op, body, offset of the head) for each Schema, Channel and Message.
template <class OnRecord>
Result<void> walk(const InputFile& file, const Block& block, const Bytes& records, OnRecord on_record) {
  std::uint64_t at = 0;
  while (at < records.size()) {
    Parser rest(View(records).subspan(at));
    const Op op = static_cast<Op>(rest.number<std::uint8_t>());
    const auto size = rest.number<std::uint64_t>();
    const View body = rest.bytes(size);
    if (!rest.ok()) return damaged_in(file, block, at, "a record is longer than what holds it");
    if (is_of_blocks(op)) {
      if (auto ok = on_record(op, body, at); !ok) return ok;
    }
    at += kRecordHead + size;
  }
  return {};
}

}  // namespace jostle::bags::mcap
