// MCAP, verified: what the summary says against what a look at all records has met.

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "services/bags/format/mcap_index.hpp"
#include "services/bags/format/mcap_scan.hpp"

namespace jostle::bags::mcap {
namespace {

class Comparison {
 public:
  Comparison(const InputFile& file, const Summary& summary, const Census& census, const Definitions& definitions,
             Findings& findings)
      : file_(file), summary_(summary), census_(census), definitions_(definitions), findings_(findings) {}

  void make() {
    if (!summary_.is_whole) flaw(Part::kRecord, "summary: a record is malformed, or a channel has a schema it lacks");
    if (summary_.statistics) compare_statistics(*summary_.statistics);
    compare_chunks();
    compare_places(summary_.attachments, census_.attachments, Part::kAttachment,
                   [](const AttachmentIndex& index) { return index.head.name; });
    compare_places(summary_.metadata, census_.metadata, Part::kNote,
                   [](const MetadataIndex& index) { return index.name; });
    compare_offsets();
  }

 private:
  void flaw(Part part, const std::string& what) { findings_.flawed(part, what, file_.path().string()); }

  void compare_count(Part part, const std::string& what, std::uint64_t said, std::uint64_t met) {
    if (said == met) return;
    flaw(part, fmt::format("{}: got {}, wanted {} as the statistics say", what, met, said));
  }

  void compare_statistics(const Statistics& said) {
    compare_count(Part::kFile, "messages", said.messages, census_.all_messages);
    compare_count(Part::kFile, "chunks", said.chunks, census_.chunks.size());
    compare_count(Part::kFile, "attachments", said.attachments, census_.attachments.size());
    compare_count(Part::kFile, "metadata", said.metadata, census_.metadata.size());
    compare_count(Part::kFile, "channels", said.channels, definitions_.channels());
    compare_count(Part::kFile, "schemas", said.schemas, definitions_.schemas());
    if (census_.all_messages > 0 && (said.start != census_.start || said.end != census_.end)) {
      flaw(Part::kFile, fmt::format("log times: got {} to {} ns, wanted {} to {} as the statistics say", census_.start,
                                    census_.end, said.start, said.end));
    }
    if (said.channel_messages.empty()) return;  // they count channels, or do not
    auto counts = said.channel_messages;
    for (const auto& [channel, met] : census_.messages) counts.try_emplace(channel, 0);
    for (const auto& [channel, count] : counts) {
      const auto met = census_.messages.find(channel);
      compare_count(Part::kTopic, name_of_channel(channel) + ": messages", count,
                    met == census_.messages.end() ? 0 : met->second);
    }
  }

  std::string name_of_channel(std::uint16_t channel) const {
    const int* topic = definitions_.topic_in_summary(channel);
    if (topic == nullptr) return fmt::format("channel {}", channel);
    return "topic " + definitions_.topics()[static_cast<std::size_t>(*topic)].topic.name;
  }

  void compare_chunks() {
    std::map<std::uint64_t, const Census::Chunk*> met;
    for (const Census::Chunk& chunk : census_.chunks) {
      met[chunk.index.offset] = &chunk;
      const bool is_right = chunk.messages == 0 || (chunk.head.start == chunk.start && chunk.head.end == chunk.end);
      if (is_right) continue;
      findings_.flawed(Part::kChunk,
                       fmt::format("got log times {} to {}, wanted {} to {} as its head says", chunk.start, chunk.end,
                                   chunk.head.start, chunk.head.end),
                       fmt::format("{}: byte {}", file_.path().string(), chunk.index.offset));
    }
    for (const ChunkIndex& said : summary_.chunks) {
      const auto chunk = met.find(said.offset);
      if (chunk == met.end() || !agrees(said, *chunk->second)) {
        flaw(Part::kChunk, fmt::format("chunk index: it tells of another chunk than there is at byte {}", said.offset));
      }
      if (chunk != met.end()) met.erase(chunk);
    }
    if (!summary_.chunks.empty() && !met.empty()) {
      flaw(Part::kChunk, fmt::format("chunk index: got none for {} chunks, wanted one for each", met.size()));
    }
  }

  static bool agrees(const ChunkIndex& said, const Census::Chunk& met) {
    return said.length == met.index.length && said.stored == met.index.stored && said.size == met.index.size &&
           said.compression == met.index.compression && said.start == met.head.start && said.end == met.head.end &&
           (said.message_indexes.empty() || (said.message_indexes == met.index.message_indexes &&
                                             said.message_index_length == met.index.message_index_length));
  }

  template <class Entry, class NameOf>
  void compare_places(const std::vector<Entry>& said, const std::vector<Entry>& met, Part part, NameOf name_of_entry) {
    if (said.empty()) return;
    std::map<std::uint64_t, const Entry*> left;
    for (const Entry& entry : met) left[entry.offset] = &entry;
    for (const Entry& entry : said) {
      const auto place = left.find(entry.offset);
      if (place == left.end() || place->second->length != entry.length ||
          name_of_entry(*place->second) != name_of_entry(entry)) {
        flaw(part,
             fmt::format("'{}': the index tells of byte {}, where it is not", name_of_entry(entry), entry.offset));
      }
      if (place != left.end()) left.erase(place);
    }
    for (const auto& [offset, entry] : left) {
      flaw(part, fmt::format("'{}' at byte {}: got no index entry, wanted one", name_of_entry(*entry), offset));
    }
  }

  void compare_offsets() {
    const auto& records = summary_.records;
    const auto is_offset = [](const Record& record) { return record.op == Op::kSummaryOffset; };
    const auto first = std::ranges::find_if(records, is_offset);
    if (first != records.end() && summary_.offsets_start != 0 && summary_.offsets_start != first->offset) {
      flaw(Part::kRecord,
           fmt::format("footer: got summary offsets at byte {}, wanted {}", summary_.offsets_start, first->offset));
    }
    std::map<Op, std::pair<std::uint64_t, std::uint64_t>> groups;  // begin and end
    for (const Record& record : records) {
      groups.try_emplace(record.op, record.offset, record.end()).first->second.second = record.end();
    }
    for (const SummaryOffset& said : summary_.offsets) {
      const auto group = groups.find(said.group);
      if (group != groups.end() && group->second == std::pair(said.start, said.start + said.length)) continue;
      flaw(Part::kRecord, fmt::format("summary offset of kind {:#04x}: it tells of byte {}, where others are",
                                      static_cast<unsigned>(said.group), said.start));
    }
  }

  const InputFile& file_;
  const Summary& summary_;
  const Census& census_;
  const Definitions& definitions_;
  Findings& findings_;
};

}  // namespace

Result<std::vector<Finding>> verify(const InputFile& file, const Index& index, const std::stop_token& stop) {
  Index found{.definitions = index.definitions.of_summary(), .notes_replace = index.notes_replace};
  Census census;
  if (auto ok = scan(file, index.data_end, ScanMode::kVerify, found, census, stop); !ok) return ok.error();
  if (index.summary) Comparison(file, *index.summary, census, found.definitions, found.info.findings).make();
  return found.info.findings.list();
}

}  // namespace jostle::bags::mcap
