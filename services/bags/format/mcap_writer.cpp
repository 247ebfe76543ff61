// MCAP, written: chunks of about a mebibyte, each followed by its index, and a summary of
// all at the end.

#include <fmt/format.h>

#include <limits>

#include "services/bags/format/checksum.hpp"
#include "services/bags/format/compression.hpp"
#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/mcap_format.hpp"
#include "services/bags/format/output_file.hpp"
#include "services/bags/format/qos_text.hpp"

namespace jostle::bags {
namespace {

using namespace mcap;

// Larger compresses little better and delays the one write() that closes it.
constexpr std::size_t kChunkBytes = 1 << 20;
// Kept free for notes and metadata.yaml, beside the summary itself.
constexpr std::uint64_t kRoomForNotes = 64 << 10;

class McapWriter final : public FileWriter {
 public:
  McapWriter(OutputFile file, bool compress) : file_(std::move(file)), compress_(compress) {
    chunk_.reserve(kChunkBytes + (kChunkBytes >> 3));
  }

  Result<void> begin() {
    Bytes head;
    append_magic(head);
    append_header(head, "ros2", std::string(kOurLibrary) + JOSTLE_VERSION);
    return put({head}, crc32_of(head), head.size());
  }

  Result<void> add_topic(const Topic& topic) override {
    if (channels_.size() >= std::numeric_limits<std::uint16_t>::max()) {
      return Error{Code::kInvalidArgument, fmt::format("{}: {}: got one topic more, wanted at most {} in a file",
                                                       file_.path().string(), topic.name, channels_.size())};
    }
    const std::string encoding = topic.definition.empty() && !topic.has_no_fields ? "" : topic.schema;
    const auto [schema, is_new] =
        schemas_.try_emplace({topic.type, encoding, topic.definition}, static_cast<std::uint16_t>(schemas_.size() + 1));
    if (is_new) {
      const Schema record{.id = schema->second, .name = topic.type, .encoding = encoding, .data = topic.definition};
      append(pending_, record);
      append(schema_records_, record);
    }
    Channel record{.id = static_cast<std::uint16_t>(channels_.size()),
                   .schema = schema->second,
                   .topic = topic.name,
                   .encoding = topic.encoding,
                   .metadata = topic.metadata};
    record.metadata[kQosKey] = qos_text(topic.qos);
    append(pending_, record);
    append(channel_records_, record);
    channels_.emplace_back();
    return {};
  }

  Result<void> write(int topic, const MessageView& message) override {
    if (failure_) return *failure_;
    WrittenChannel& channel = channels_.at(static_cast<std::size_t>(topic));
    const auto time = static_cast<std::uint64_t>(message.log_time);
    if (channel.index.empty()) in_chunk_.push_back(static_cast<std::uint16_t>(topic));
    channel.index.emplace_back(time, chunk_.size());
    append_message(chunk_,
                   {.channel = static_cast<std::uint16_t>(topic),
                    .sequence = message.sequence,
                    .log_time = time,
                    .publish_time = static_cast<std::uint64_t>(message.publish_time)},
                   message.data);
    chunk_start_ = std::min(chunk_start_, time);
    chunk_end_ = std::max(chunk_end_, time);
    return chunk_.size() < kChunkBytes ? Result<void>() : close_chunk();
  }

  // A note that changes is written again: of several under one name the last one counts.
  Result<void> flush(const Notes& notes) override {
    if (failure_) return *failure_;
    for (const auto& [name, note] : notes) append_metadata({.name = name, .metadata = note}, pending_);
    return close_chunk();
  }

  Result<void> attach(const Attachment& attachment) override {
    if (failure_) return *failure_;
    const AttachmentHead head{.log_time = static_cast<std::uint64_t>(attachment.log_time),
                              .create_time = static_cast<std::uint64_t>(attachment.create_time),
                              .name = attachment.name,
                              .media_type = attachment.media_type,
                              .size = attachment.data.size()};
    // What is pending goes first: an attachment may be larger than all else together.
    if (auto ok = close_chunk(); !ok) return ok;
    Bytes record;
    append_attachment(record, head, attachment.data);
    const std::uint64_t offset = file_.size();
    if (auto ok = put({record}, crc32_of(record), record.size()); !ok) return ok;
    append(attachment_records_, AttachmentIndex{.offset = offset, .length = record.size(), .head = head});
    ++statistics_.attachments;
    return {};
  }

  Result<void> add_note(const NamedNote& note) override {
    if (failure_) return *failure_;
    append_metadata({.name = note.first, .metadata = note.second}, pending_);
    return {};
  }

  Result<void> end_repeated() override {
    // In front of the chunk that it speaks of, so that it is there whenever the chunk is.
    const Metadata record{.name = kRepeatedNote, .metadata = {{"chunks", "1"}}};
    append_metadata(record, pending_);
    return flush({});
  }

  Result<void> close(const Notes& notes) override {
    if (is_closed_) return {};
    is_closed_ = true;
    // A failure that write() or flush() has told of is not told again.
    Result<void> flushed;
    if (!failure_) flushed = close_chunk();
    auto completed = write_end(notes);
    if (auto closed = file_.close(); !closed && completed) completed = closed;
    return flushed ? completed : flushed;
  }

  std::uint64_t bytes() const override { return file_.size() + pending_.size() + chunk_.size(); }
  WrittenFile written() const override {
    WrittenFile written{.start = static_cast<Time>(statistics_.start), .end = static_cast<Time>(statistics_.end)};
    for (const WrittenChannel& channel : channels_) written.messages.push_back(channel.messages);
    return written;
  }

 private:
  struct WrittenChannel {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> index;  // of the open chunk: log time, offset
    std::uint64_t messages = 0;                                  // in closed chunks
  };

  // `crc`: of all pieces, which are `size` long together.
  Result<void> put(std::initializer_list<View> pieces, std::uint32_t crc, std::size_t size) {
    const std::uint64_t room = schema_records_.size() + channel_records_.size() + index_records_.size() +
                               attachment_records_.size() + kRoomForNotes;
    auto ok = file_.append(pieces, room);
    if (!ok) {
      failure_ = ok.error();
    } else {
      crc_ = crc32_of_both(crc_, crc, size);
    }
    return ok;
  }

  void append_metadata(const Metadata& record, Bytes& to) {
    const std::uint64_t offset = file_.size() + to.size();
    const std::size_t before = to.size();
    append(to, record);
    append(metadata_records_, MetadataIndex{.offset = offset, .length = to.size() - before, .name = record.name});
    ++statistics_.metadata;
  }

  Result<void> close_chunk() {
    if (chunk_.empty()) {
      if (pending_.empty()) return {};
      auto ok = put({pending_}, crc32_of(pending_), pending_.size());
      if (ok) pending_.clear();
      return ok;
    }
    const std::uint32_t chunk_crc = crc32_of(chunk_);
    View stored = chunk_;
    std::string compression;
    if (compress_) {
      const View smaller = compressor_.compress(chunk_);
      if (!smaller.empty() && smaller.size() < chunk_.size()) {
        stored = smaller;
        compression = "zstd";
      }
    }
    const ChunkHead head{.start = chunk_start_,
                         .end = chunk_end_,
                         .size = chunk_.size(),
                         .crc = chunk_crc,
                         .compression = compression,
                         .stored = stored.size()};
    ChunkIndex index{.start = head.start,
                     .end = head.end,
                     .offset = file_.size() + pending_.size(),
                     .length = kRecordHead + chunk_head_size(compression) + stored.size(),
                     .compression = compression,
                     .stored = stored.size(),
                     .size = head.size};
    head_ = pending_;
    append(head_, head);
    tail_.clear();
    for (const std::uint16_t channel : in_chunk_) {
      index.message_indexes[channel] = index.offset + index.length + tail_.size();
      append_message_index(tail_, channel, channels_[channel].index);
    }
    index.message_index_length = tail_.size();
    const std::uint32_t stored_crc = compression.empty() ? chunk_crc : crc32_of(stored);
    const std::uint32_t crc = crc32_of(tail_, crc32_of_both(crc32_of(head_), stored_crc, stored.size()));
    auto ok = put({head_, stored, tail_}, crc, head_.size() + stored.size() + tail_.size());
    if (ok) {
      pending_.clear();
      append(index_records_, index);
      count_chunk();
    }
    for (const std::uint16_t channel : in_chunk_) channels_[channel].index.clear();
    in_chunk_.clear();
    chunk_.clear();
    chunk_start_ = std::numeric_limits<std::uint64_t>::max();
    chunk_end_ = 0;
    return ok;
  }

  void count_chunk() {
    const bool is_first = statistics_.messages == 0;
    statistics_.start = is_first ? chunk_start_ : std::min(statistics_.start, chunk_start_);
    statistics_.end = std::max(statistics_.end, chunk_end_);
    ++statistics_.chunks;
    for (const std::uint16_t channel : in_chunk_) {
      channels_[channel].messages += channels_[channel].index.size();
      statistics_.messages += channels_[channel].index.size();
    }
  }

  // Notes, end of data, summary, footer: one piece, which fits or does not.
  Result<void> write_end(const Notes& notes) {
    Bytes end = pending_;
    for (const auto& [name, note] : notes) append_metadata({.name = name, .metadata = note}, end);
    append_data_end(end, crc32_of(end, crc_));

    statistics_.schemas = static_cast<std::uint16_t>(schemas_.size());
    statistics_.channels = static_cast<std::uint32_t>(channels_.size());
    for (std::size_t i = 0; i < channels_.size(); ++i) {
      statistics_.channel_messages[static_cast<std::uint16_t>(i)] = channels_[i].messages;
    }
    Bytes statistics_record;
    append(statistics_record, statistics_);

    const std::uint64_t summary_start = file_.size() + end.size();
    const std::size_t summary_in_end = end.size();
    std::vector<SummaryOffset> groups;
    const auto add = [&](Op group, const Bytes& records) {
      if (records.empty()) return;
      groups.push_back({.group = group, .start = file_.size() + end.size(), .length = records.size()});
      Appender(end).bytes(records);
    };
    add(Op::kSchema, schema_records_);
    add(Op::kChannel, channel_records_);
    add(Op::kStatistics, statistics_record);
    add(Op::kChunkIndex, index_records_);
    add(Op::kAttachmentIndex, attachment_records_);
    add(Op::kMetadataIndex, metadata_records_);
    const std::uint64_t offsets_start = file_.size() + end.size();
    for (const SummaryOffset& group : groups) append(end, group);
    append_footer(end, summary_start, offsets_start, crc32_of(View(end).subspan(summary_in_end)));
    append_magic(end);
    return file_.append({end}, 0);
  }

  OutputFile file_;
  const bool compress_;
  Compressor compressor_;
  std::optional<Error> failure_;
  bool is_closed_ = false;

  Bytes pending_;  // goes in front of the next chunk
  Bytes chunk_;
  Bytes head_, tail_;  // of a chunk that is being closed; kept for their memory
  std::uint64_t chunk_start_ = std::numeric_limits<std::uint64_t>::max(), chunk_end_ = 0;
  std::vector<std::uint16_t> in_chunk_;  // channels with messages in it
  std::uint32_t crc_ = 0;                // of the file so far

  std::map<std::array<std::string, 3>, std::uint16_t> schemas_;  // type, encoding, definition -> id
  std::vector<WrittenChannel> channels_;                         // by id, which is the topic
  Bytes schema_records_, channel_records_, index_records_, attachment_records_, metadata_records_;  // of the summary
  Statistics statistics_;
};

}  // namespace

Result<std::unique_ptr<FileWriter>> create_mcap(const std::filesystem::path& file, const BagOptions& options) {
  auto output_result = OutputFile::create(file);
  if (!output_result) return output_result.error();
  auto writer = std::make_unique<McapWriter>(std::move(*output_result), options.compress);
  if (auto ok = writer->begin(); !ok) return ok.error();
  return std::unique_ptr<FileWriter>(std::move(writer));
}

}  // namespace jostle::bags
