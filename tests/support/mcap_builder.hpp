#pragma once
/// \file
/// MCAP files as other tools write them: every part as a test wants it, with checksums and indexes that fit.

#include <lz4frame.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "services/bags/format/checksum.hpp"
#include "services/bags/format/compression.hpp"
#include "services/bags/format/mcap_format.hpp"
#include "tests/support/bags.hpp"

namespace jostle::tests {

inline Bytes lz4_of(const Bytes& data) {
  Bytes out(LZ4F_compressFrameBound(data.size(), nullptr));
  out.resize(LZ4F_compressFrame(out.data(), out.size(), data.data(), data.size(), nullptr));
  return out;
}

inline Bytes zstd_of(const Bytes& data) {
  bags::Compressor compressor;
  const auto smaller = compressor.compress(data);
  return {smaller.begin(), smaller.end()};
}

/// A Schema's record.
inline Bytes schema_record(std::uint16_t id, const std::string& name = "std_msgs/msg/String",
                           const std::string& encoding = "ros2msg", const std::string& text = "string data\n") {
  Bytes bytes;
  bags::mcap::append(bytes, bags::mcap::Schema{.id = id, .name = name, .encoding = encoding, .data = text});
  return bytes;
}

inline Bytes channel_record(std::uint16_t id, std::uint16_t schema, const std::string& topic,
                            const std::string& encoding = "cdr") {
  Bytes bytes;
  bags::mcap::append(
      bytes, bags::mcap::Channel{.id = id, .schema = schema, .topic = topic, .encoding = encoding, .metadata = {}});
  return bytes;
}

inline Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

class McapBuilder {
 public:
  struct Sample {
    std::uint16_t channel = 1;
    std::uint64_t time = 0;
    Bytes data;
  };

  explicit McapBuilder(const std::string& library = "another tool") {
    bags::mcap::append_magic(bytes);
    bags::mcap::append_header(bytes, "ros2", library);
  }

  /// Definitions are records; they also go into the summary.
  McapBuilder& chunk(const std::vector<Bytes>& definitions, const std::vector<Sample>& samples,
                     const std::string& compression = "", bool indexed = true) {
    Bytes records;
    for (const Bytes& definition : definitions) records = records + defined(definition);
    std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> entries;
    std::uint64_t start = 0, end = 0;
    for (const Sample& sample : samples) {
      entries[sample.channel].emplace_back(sample.time, records.size());
      start = entries.size() == 1 && entries.begin()->second.size() == 1 ? sample.time : std::min(start, sample.time);
      end = std::max(end, sample.time);
      append_sample(records, sample);
    }
    return chunk_of(records, start, end, entries, compression, indexed);
  }

  /// Messages outside of chunks.
  McapBuilder& loose(const std::vector<Bytes>& definitions, const std::vector<Sample>& samples) {
    for (const Bytes& definition : definitions) bytes = bytes + defined(definition);
    for (const Sample& sample : samples) append_sample(bytes, sample);
    return *this;
  }

  McapBuilder& attach(const std::string& name, const std::string& text) {
    const auto view = std::as_bytes(std::span(text));
    const bags::mcap::AttachmentHead head{
        .log_time = 1, .create_time = 2, .name = name, .media_type = "text/plain", .size = text.size()};
    const std::uint64_t offset = bytes.size();
    bags::mcap::append_attachment(bytes, head, view);
    attachments.push_back({.offset = offset, .length = bytes.size() - offset, .head = head});
    return *this;
  }

  McapBuilder& note(const std::string& name, const std::map<std::string, std::string>& values) {
    const std::uint64_t offset = bytes.size();
    bags::mcap::append(bytes, bags::mcap::Metadata{.name = name, .metadata = values});
    notes.push_back({.offset = offset, .length = bytes.size() - offset, .name = name});
    return *this;
  }

  McapBuilder& raw(const Bytes& more) {
    bytes = bytes + more;
    return *this;
  }

  struct End {
    bool definitions = true, statistics = true, chunk_indexes = true;
    std::function<void(bags::mcap::Statistics&)> lie;
  };
  Bytes end(const End& options) const {
    Bytes out = bytes;
    bags::mcap::append_data_end(out, 0);
    const std::size_t start = out.size();
    if (options.definitions) {
      for (const Bytes& definition : definitions_) out = out + definition;
    }
    bags::mcap::Statistics said = statistics();
    if (options.lie) options.lie(said);
    if (options.statistics) bags::mcap::append(out, said);
    for (const auto& index : chunk_indexes) {
      if (options.chunk_indexes) bags::mcap::append(out, index);
    }
    for (const auto& index : attachments) bags::mcap::append(out, index);
    for (const auto& index : notes) bags::mcap::append(out, index);
    const Bytes summary(out.begin() + static_cast<std::ptrdiff_t>(start), out.end());
    bags::mcap::append_footer(out, start, 0, bags::crc32_of(summary));
    bags::mcap::append_magic(out);
    return out;
  }
  Bytes end() const { return end({}); }
  Bytes without_summary() const {
    Bytes out = bytes;
    bags::mcap::append_data_end(out, 0);
    bags::mcap::append_footer(out, 0, 0, 0);
    bags::mcap::append_magic(out);
    return out;
  }

  Bytes bytes;
  std::vector<bags::mcap::ChunkIndex> chunk_indexes;
  std::vector<bags::mcap::AttachmentIndex> attachments;
  std::vector<bags::mcap::MetadataIndex> notes;

 private:
  const Bytes& defined(const Bytes& definition) {
    if (std::ranges::find(definitions_, definition) == definitions_.end()) definitions_.push_back(definition);
    return definition;
  }

  void append_sample(Bytes& to, const Sample& sample) {
    bags::mcap::append_message(
        to, {.channel = sample.channel, .sequence = 1, .log_time = sample.time, .publish_time = sample.time},
        sample.data);
    first_ = messages_ == 0 ? sample.time : std::min(first_, sample.time);
    last_ = std::max(last_, sample.time);
    ++messages_;
    ++counts_[sample.channel];
  }

  McapBuilder& chunk_of(const Bytes& records, std::uint64_t start, std::uint64_t end,
                        const std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>>& entries,
                        const std::string& compression, bool indexed) {
    const Bytes stored = compression == "lz4" ? lz4_of(records) : compression == "zstd" ? zstd_of(records) : records;
    bags::mcap::ChunkIndex index{.start = start,
                                 .end = end,
                                 .offset = bytes.size(),
                                 .compression = compression,
                                 .stored = stored.size(),
                                 .size = records.size()};
    bags::mcap::append(bytes, bags::mcap::ChunkHead{.start = start,
                                                    .end = end,
                                                    .size = records.size(),
                                                    .crc = bags::crc32_of(records),
                                                    .compression = compression,
                                                    .stored = stored.size()});
    bytes = bytes + stored;
    index.length = bytes.size() - index.offset;
    const std::size_t behind = bytes.size();
    for (const auto& [channel, list] : entries) {
      if (!indexed) continue;
      index.message_indexes[channel] = bytes.size();
      bags::mcap::append_message_index(bytes, channel, list);
    }
    index.message_index_length = bytes.size() - behind;
    chunk_indexes.push_back(std::move(index));
    return *this;
  }

  bags::mcap::Statistics statistics() const {
    bags::mcap::Statistics said{.messages = messages_,
                                .attachments = static_cast<std::uint32_t>(attachments.size()),
                                .metadata = static_cast<std::uint32_t>(notes.size()),
                                .chunks = static_cast<std::uint32_t>(chunk_indexes.size()),
                                .start = first_,
                                .end = last_,
                                .channel_messages = counts_};
    for (const Bytes& definition : definitions_) {
      if (definition[0] == static_cast<std::byte>(bags::mcap::Op::kSchema)) ++said.schemas;
      if (definition[0] == static_cast<std::byte>(bags::mcap::Op::kChannel)) ++said.channels;
    }
    return said;
  }

  std::vector<Bytes> definitions_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::uint64_t messages_ = 0, first_ = 0, last_ = 0;
};

}  // namespace jostle::tests
