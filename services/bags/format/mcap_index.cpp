#include "services/bags/format/mcap_index.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "services/bags/format/checksum.hpp"
#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/mcap_scan.hpp"

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

// Reads the summary's records; what is malformed makes it less than whole.
Result<Summary> read_summary(const InputFile& file, const Footer& footer, std::uint64_t footer_at,
                             Definitions& definitions) {
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
  Summary summary{.offsets_start = footer.summary_offset_start};
  for (std::uint64_t at = footer.summary_start; at < footer_at; at = summary.records.back().end()) {
    auto record_result = record_at(file, at, footer_at);
    if (!record_result) return record_result.error();
    summary.records.push_back(*record_result);
  }
  const auto body_of = [&](const Record& record) {
    return View(*bytes_result).subspan(record.body() - footer.summary_start, record.size);
  };
  const auto take = [&](auto parsed, auto& to) {
    if (parsed) {
      to.push_back(std::move(*parsed));
    } else {
      summary.is_whole = false;
    }
  };
  // Channels speak of schemas, which may stand behind them.
  for (const Op op : {Op::kSchema, Op::kChannel}) {
    for (const Record& record : summary.records) {
      if (record.op == op && !definitions.take_from_summary(op, body_of(record))) summary.is_whole = false;
    }
  }
  for (const Record& record : summary.records) {
    const View body = body_of(record);
    switch (record.op) {
      case Op::kStatistics:
        summary.statistics = parse_statistics(body);
        if (!summary.statistics) summary.is_whole = false;
        break;
      case Op::kChunkIndex:
        take(parse_chunk_index(body), summary.chunks);
        break;
      case Op::kAttachmentIndex:
        take(parse_attachment_index(body), summary.attachments);
        break;
      case Op::kMetadataIndex:
        take(parse_metadata_index(body), summary.metadata);
        break;
      case Op::kSummaryOffset:
        take(parse_summary_offset(body), summary.offsets);
        break;
      default:
        break;  // what comes from a later version
    }
  }
  return summary;
}

// Nothing for a file that has none.
Result<std::optional<Summary>> find_summary(const InputFile& file, Definitions& definitions) {
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
  if (footer->summary_start == 0) return std::optional<Summary>();
  auto summary_result = read_summary(file, *footer, footer_at, definitions);
  if (!summary_result) return summary_result.error();
  return std::optional(std::move(*summary_result));
}

bool lies_in(const InputFile& file, std::uint64_t offset, std::uint64_t length) {
  return offset <= file.size() && length <= file.size() - offset;
}

// Whether every message that the statistics count can be found by a summary alone. Where not, only a look at all
// records helps: some writers leave out channels, chunks or counts, or write messages outside of chunks.
bool says_all(const Summary& summary, const Definitions& definitions) {
  if (!summary.is_whole || !summary.statistics) return false;
  const Statistics& statistics = *summary.statistics;
  const auto is_known = [&](const auto& entry) { return definitions.topic_in_summary(entry.first) != nullptr; };
  std::uint64_t counted = 0, indexed = 0;
  for (const auto& entry : statistics.channel_messages) {
    if (entry.second > 0 && !is_known(entry)) return false;
    counted += entry.second;
  }
  for (const ChunkIndex& chunk : summary.chunks) {
    const auto messages = indexed_messages(chunk.message_indexes.size(), chunk.message_index_length);
    if (!messages || !std::ranges::all_of(chunk.message_indexes, is_known)) return false;
    if (!time_of(chunk.start) || !time_of(chunk.end)) return false;
    indexed += *messages;
  }
  return counted == statistics.messages && indexed == statistics.messages &&
         statistics.chunks == summary.chunks.size() && statistics.attachments == summary.attachments.size() &&
         statistics.metadata == summary.metadata.size();
}

Result<void> add_block(const InputFile& file, const ChunkIndex& chunk, Index& index) {
  const std::uint64_t head = kRecordHead + chunk_head_size(chunk.compression);
  if (!lies_in(file, chunk.offset, chunk.length) || chunk.length < head || chunk.stored != chunk.length - head) {
    return file.damaged(chunk.offset,
                        fmt::format("chunk index: got a chunk of {} bytes at byte {}, wanted one that lies in the file",
                                    chunk.length, chunk.offset));
  }
  if (chunk.message_indexes.empty()) return {};  // definitions alone
  Block block{.offset = chunk.offset,
              .length = chunk.length,
              .stored = chunk.stored,
              .size = chunk.size,
              .compression = chunk.compression,
              .start = *time_of(chunk.start),
              .end = *time_of(chunk.end)};
  for (const auto& [channel, offset] : chunk.message_indexes) {
    block.topics[*index.definitions.topic_in_summary(channel)] = 0;
  }
  index.blocks.push_back(std::move(block));
  return {};
}

Result<Record> record_of(const InputFile& file, Op op, std::uint64_t offset, std::uint64_t length,
                         const std::string& what) {
  if (!lies_in(file, offset, length)) {
    return file.damaged(offset, fmt::format("{}: got {} bytes, wanted them to lie in the file", what, length));
  }
  auto record_result = record_at(file, offset, offset + length);
  if (record_result && record_result->op != op) {
    return file.damaged(offset, fmt::format("got another record, wanted {}", what));
  }
  return record_result;
}

// Makes the index of what the summary says.
Result<void> believe(const InputFile& file, const Summary& summary, Index& index) {
  for (const ChunkIndex& chunk : summary.chunks) {
    if (auto ok = add_block(file, chunk, index); !ok) return ok;
  }
  for (const auto& [channel, count] : summary.statistics->channel_messages) {
    if (count == 0) continue;
    index.definitions.topics()[static_cast<std::size_t>(*index.definitions.topic_in_summary(channel))].messages +=
        count;
  }
  for (const AttachmentIndex& attachment : summary.attachments) {
    auto record_result = record_of(file, Op::kAttachment, attachment.offset, attachment.length,
                                   fmt::format("attachment '{}'", attachment.head.name));
    if (!record_result) return record_result.error();
    index.take_attachment(*record_result, attachment.head);
  }
  for (const MetadataIndex& metadata : summary.metadata) {
    auto record_result =
        record_of(file, Op::kMetadata, metadata.offset, metadata.length, fmt::format("metadata '{}'", metadata.name));
    if (!record_result) return record_result.error();
    if (auto ok = index.take_metadata(file, *record_result); !ok) return ok;
  }
  return {};
}

// In a file with chunks, messages outside of them may be something else that was damaged: no checksum covers them.
// They are taken if they look like messages of the time of the others.
void leave_out_strays(const InputFile& file, const Census& census, Index& index) {
  if (index.summary && index.summary->statistics && index.summary->statistics->messages == census.all_messages) return;
  constexpr Time kDay = 86'400'000'000'000;
  Time first = std::numeric_limits<Time>::max(), last = std::numeric_limits<Time>::min();
  for (const Block& block : index.blocks) {
    if (!block.is_chunk) continue;
    first = std::min(first, block.start);
    last = std::max(last, block.end);
  }
  if (first > last) return;
  std::erase_if(index.blocks, [&](const Block& block) {
    const bool is_near = block.start >= first - std::min(first, kDay) && block.end - last <= kDay;
    if (block.is_chunk || (block.looks_sound && is_near)) return false;
    std::uint64_t messages = 0;
    for (const auto& [topic, count] : block.topics) messages += count;
    index.info.findings.lost(Part::kMessage,
                             "outside of chunks, and of another time or form than messages have; wanted them in chunks",
                             where_in(file, block, 0), messages);
    return true;
  });
}

// A repeated chunk has one message per channel.
void leave_out_repeated(Index& index) {
  const auto chunk =
      std::ranges::find(index.blocks, index.repeated, [](const Block& block) { return std::optional(block.offset); });
  if (chunk == index.blocks.end()) return;
  for (const auto& [topic, count] : chunk->topics) {
    const std::uint64_t left_out = index.was_scanned ? count : 1;
    auto& messages = index.definitions.topics()[static_cast<std::size_t>(topic)].messages;
    messages -= std::min(messages, left_out);
    index.info.repeated += left_out;
  }
  index.blocks.erase(chunk);
}

void count_blocks(Index& index) {
  for (const Block& block : index.blocks) {
    for (const auto& [topic, count] : block.topics) {
      index.definitions.topics()[static_cast<std::size_t>(topic)].messages += count;
    }
  }
}

// What follows from all blocks and counts.
void finish(Index& index) {
  std::ranges::sort(index.blocks, {}, &Block::offset);
  index.info.topics = index.definitions.topics();
  for (const TopicInfo& topic : index.info.topics) index.info.messages += topic.messages;
  if (index.blocks.empty()) return;
  index.info.start = std::ranges::min(index.blocks, {}, &Block::start).start;
  index.info.end = std::ranges::max(index.blocks, {}, &Block::end).end;
}

}  // namespace

// Whose notes replace each other.
Result<void> Index::take_header(const InputFile& file) {
  const auto record_result = record_at(file, kMagic.size(), file.size());
  if (!record_result || record_result->op != Op::kHeader) return {};
  const auto body_result = body_of(file, *record_result);
  if (!body_result) return body_result.error();
  Parser from(*body_result);
  from.text();  // profile
  notes_replace = from.text().starts_with(kOurLibrary);
  return {};
}

Result<void> Index::take_metadata(const InputFile& file, const Record& record) {
  auto body_result = body_of(file, record);
  if (!body_result) return body_result.error();
  auto metadata = parse_metadata(*body_result);
  if (!metadata) {
    info.findings.lost(Part::kNote, "malformed", fmt::format("{}: byte {}", file.path().string(), record.offset));
    return {};
  }
  if (metadata->name == kRepeatedNote) {
    repeated = record.end();
    return {};
  }
  const auto [known, is_new] = info.notes.try_emplace(metadata->name, metadata->metadata);
  if (is_new || known->second == metadata->metadata) return {};
  std::swap(known->second, metadata->metadata);
  if (notes_replace && metadata->name == kLostNote) return {};
  info.earlier_notes.emplace_back(std::move(metadata->name), std::move(metadata->metadata));
  return {};
}

void Index::take_attachment(const Record& record, const AttachmentHead& head) {
  attachments.push_back(record);
  info.attachments.push_back({.name = head.name, .media_type = head.media_type, .bytes = head.size});
}

std::optional<Index::Place> Index::place_of(const InputFile& file, const Block& block, View body, std::uint64_t offset,
                                            Findings* findings) const {
  const auto lost = [&](const std::string& reason) {
    if (findings != nullptr) findings->lost(Part::kMessage, reason, where_in(file, block, offset));
    return std::nullopt;
  };
  const auto head = parse_message(body);
  if (!head) return lost("malformed");
  const int* topic = definitions.topic_of(head->channel, {block.offset, offset});
  if (topic == nullptr) return lost(fmt::format("got channel {}, wanted one that the file has", head->channel));
  const auto time = time_of(head->log_time);
  if (!time) {
    return lost(fmt::format("{}: got a log time behind the year 2262, wanted one before",
                            definitions.topics()[static_cast<std::size_t>(*topic)].topic.name));
  }
  return Place{.topic = *topic, .log_time = *time};
}

Result<Index> index_of(const InputFile& file, const OpenOptions& options) {
  Index index;
  const auto beginning = check_beginning(file);
  if (!beginning) {
    if (!options.recover || file.size() == 0) return beginning.error();
    index.info.findings.flawed(Part::kFile, beginning.error().message, "");
  }
  if (auto ok = index.take_header(file); !ok) return ok.error();
  index.data_end = options.recover ? file.size() : file.size() - std::min(file.size(), kTail);
  auto summary_result = find_summary(file, index.definitions);
  if (summary_result) {
    index.summary = std::move(*summary_result);
  } else {
    if (!options.recover) return summary_result.error();
    index.definitions = {};
    index.info.findings.flawed(Part::kFile, summary_result.error().message, "");
  }
  if (!options.recover && index.summary && says_all(*index.summary, index.definitions)) {
    if (auto ok = believe(file, *index.summary, index); !ok) return ok.error();
  } else {
    // What a whole summary says of channels outlives the chunks that say it, too.
    Census census;
    if (auto ok = scan(file, index.data_end, options.recover ? ScanMode::kRecover : ScanMode::kRead, index, census,
                       options.stop);
        !ok) {
      return ok.error();
    }
    if (options.recover) leave_out_strays(file, census, index);
    count_blocks(index);
  }
  // Nothing in it looks like MCAP.
  if (!beginning && index.blocks.empty()) return beginning.error();
  if (options.skip_repeated) leave_out_repeated(index);
  finish(index);
  return index;
}

}  // namespace jostle::bags::mcap
