#pragma once
/// \file
/// Records and blocks of records, where they lie in an MCAP file.

#include <cstdint>
#include <map>
#include <optional>
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
  /// Topics that have messages in it; how many, if a scan has counted.
  std::map<int, std::uint64_t> topics;
  bool looks_sound = true;  ///< of a run: every message looks like one
};

/// Reads the record at `offset`, whose body must lie before `end`.
Result<Record> record_at(const InputFile& file, std::uint64_t offset, std::uint64_t end);
Result<Bytes> body_of(const InputFile& file, const Record& record);

/// Returns a time that a file holds; nothing if it lies behind the year 2262, as one that was never set does.
std::optional<Time> time_of(std::uint64_t value);

/// The records of a block, and whether a chunk's checksum is right.
struct BlockRecords {
  Bytes bytes;
  std::optional<Error> problem;  ///< with the checksum
};

/// Reads a block's records, decompresses them, and checks them against the chunk's own head and checksum.
/// Error: there are none. A wrong checksum is BlockRecords::problem.
Result<BlockRecords> records_of(const InputFile& file, const Block& block);

/// Reads an attachment and checks it against its checksum.
Result<Attachment> read_attachment(const InputFile& file, const Record& record);

/// Makes the Error that says what is wrong `offset` bytes behind the beginning of a block's records.
Error damaged_in(const InputFile& file, const Block& block, std::uint64_t offset, const std::string& what);

/// The same place for a finding: file and byte.
std::string where_in(const InputFile& file, const Block& block, std::uint64_t offset);

/// Whether blocks have records of this kind.
inline bool is_of_blocks(Op op) { return op == Op::kSchema || op == Op::kChannel || op == Op::kMessage; }

/// Whether a record could be what it says it is: its kind is known, and its size fits the kind.
bool is_plausible(Op op, std::uint64_t size);

/// Calls on_record(op, body, offset of the head) for each record, up to one that cannot be: it is longer than
/// what holds it, or has no kind. Returns where that one is.
template <class OnRecord>
std::optional<std::uint64_t> walk(const Bytes& records, OnRecord on_record) {
  std::uint64_t at = 0;
  while (at < records.size()) {
    Parser rest(View(records).subspan(at));
    const Op op = static_cast<Op>(rest.number<std::uint8_t>());
    const auto size = rest.number<std::uint64_t>();
    const View body = rest.bytes(size);
    if (!rest.ok() || op == Op{}) return at;
    on_record(op, body, at);
    at += kRecordHead + size;
  }
  return {};
}

}  // namespace jostle::bags::mcap
