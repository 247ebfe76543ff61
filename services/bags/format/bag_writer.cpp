#include "services/bags/format/bag_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "services/bags/format/metadata.hpp"
#include "services/bags/format/storage.hpp"
#include "services/common/process/files.hpp"

namespace jostle::bags {
namespace {

namespace fs = std::filesystem;

class FolderWriter final : public BagWriter {
 public:
  FolderWriter(fs::path folder, const BagOptions& options)
      : folder_(std::move(folder)), options_(options), storage_(storage_of(options.storage)) {
    // "bag/" and "." name their folder, too.
    const fs::path whole = fs::absolute(folder_).lexically_normal();
    name_ = (whole.has_filename() ? whole : whole.parent_path()).filename().string();
  }

  ~FolderWriter() override { (void)close(); }

  Result<int> add_topic(const Topic& topic) override {
    if (failure_) return *failure_;
    if (std::ranges::any_of(topics_, [&](const OpenTopic& other) { return other.topic.is_same_as(topic); })) {
      return Error{Code::kInvalidArgument, fmt::format("{}: {}: got the topic twice", folder_.string(), topic.name)};
    }
    if (auto ok = file_->add_topic(topic); !ok) return ok.error();
    topics_.push_back({.topic = topic});
    return static_cast<int>(topics_.size()) - 1;
  }

  Result<void> write(int topic, const MessageView& message) override {
    if (failure_) return *failure_;
    if (topic < 0 || static_cast<std::size_t>(topic) >= topics_.size()) {
      return Error{Code::kInvalidArgument, fmt::format("{}: topic: got {}, wanted one of {} that were added",
                                                       folder_.string(), topic, topics_.size())};
    }
    if (message.log_time < 0) {
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: log time: got {} ns, wanted one since 1970", folder_.string(), message.log_time)};
    }
    if (is_full(message.log_time)) {
      if (auto ok = keep_failure(begin_next_file(message.log_time)); !ok) return ok;
    }
    OpenTopic& open = topics_[static_cast<std::size_t>(topic)];
    MessageView counted = message;
    if (counted.sequence == 0) counted.sequence = open.sequence + 1;
    if (auto ok = keep_failure(file_->write(topic, counted)); !ok) return ok;
    open.sequence = counted.sequence;
    if (!file_start_) file_start_ = message.log_time;
    if (open.topic.qos.latched && may_split()) {
      open.last = Message{.topic = topic,
                          .publish_time = counted.publish_time,
                          .sequence = counted.sequence,
                          .data = {message.data.begin(), message.data.end()}};
    }
    return {};
  }

  Result<void> flush() override {
    if (failure_) return *failure_;
    auto flushed = keep_failure(file_->flush(changed_notes_));
    if (flushed) changed_notes_.clear();
    return flushed;
  }

  void set_note(const std::string& name, Note note) override {
    const auto known = notes_.find(name);
    if (known != notes_.end() && known->second == note) return;
    changed_notes_[name] = note;
    notes_[name] = std::move(note);
  }

  Result<void> attach(const Attachment& attachment) override {
    if (failure_) return *failure_;
    return file_->attach(attachment);
  }

  Result<void> add_note(const NamedNote& note) override {
    if (failure_) return *failure_;
    return file_->add_note(note);
  }

  Result<void> close() override {
    if (std::exchange(is_closed_, true)) return {};
    const bool is_begun = !entries_.empty();
    auto ended = end_file();
    failure_ = Error{Code::kInvalidArgument, fmt::format("{}: closed already", folder_.string())};
    if (!is_begun) return ended;
    auto written = common::write_text(folder_ / kMetadataFile, metadata_text(metadata()));
    return ended ? written : ended;
  }

  std::uint64_t bytes() const override { return bytes_before_ + (file_ ? file_->bytes() : 0); }
  int files() const override { return static_cast<int>(entries_.size()); }

  Result<void> begin_file() {
    const std::string name = fmt::format("{}_{}{}", name_, entries_.size(), storage_.extension);
    auto file_result = storage_.create(folder_ / name, options_);
    if (!file_result) return file_result.error();
    file_ = std::move(*file_result);
    entries_.push_back({.path = name});
    changed_notes_ = notes_;
    for (const OpenTopic& open : topics_) {
      if (auto ok = file_->add_topic(open.topic); !ok) return ok;
    }
    return {};
  }

 private:
  struct OpenTopic {
    Topic topic;
    std::uint32_t sequence = 0;   // of the last message
    std::uint64_t messages = 0;   // in files that are closed, repeated ones included
    std::optional<Message> last;  // of a latched topic
  };

  bool may_split() const { return options_.split_bytes > 0 || options_.split_time.count() > 0; }

  bool is_full(Time time) const {
    if (!file_start_) return false;  // nothing in it but what is repeated
    return (options_.split_bytes > 0 && file_->bytes() >= options_.split_bytes) ||
           (options_.split_time.count() > 0 && time - *file_start_ >= options_.split_time.count());
  }

  Result<void> keep_failure(Result<void> result) {
    if (!result) failure_ = result.error();
    return result;
  }

  Result<void> begin_next_file(Time time) {
    if (auto ok = end_file(); !ok) return ok;
    if (auto ok = begin_file(); !ok) return ok;
    bool is_any_repeated = false;
    for (std::size_t i = 0; i < topics_.size(); ++i) {
      if (!topics_[i].last) continue;
      // Logged when this file begins: it is the topic's word then, and a file spans no more
      // time than it records.
      MessageView message = topics_[i].last->view();
      message.log_time = time;
      if (auto ok = file_->write(static_cast<int>(i), message); !ok) return ok;
      is_any_repeated = true;
    }
    return is_any_repeated ? file_->end_repeated() : Result<void>();
  }

  Result<void> end_file() {
    if (!file_) return {};
    auto closed = file_->close(changed_notes_);
    const WrittenFile written = file_->written();
    MetadataEntry& entry = entries_.back();
    entry.start = written.start;
    entry.end = written.end;
    for (std::size_t i = 0; i < written.messages.size(); ++i) {
      entry.messages += written.messages[i];
      topics_[i].messages += written.messages[i];
    }
    bytes_before_ += file_->bytes();
    file_.reset();
    file_start_.reset();
    return closed;
  }

  BagMetadata metadata() const {
    BagMetadata metadata{.storage = storage_.name, .files = entries_, .notes = notes_};
    for (const OpenTopic& open : topics_) metadata.topics.push_back({.topic = open.topic, .messages = open.messages});
    return metadata;
  }

  const fs::path folder_;
  const BagOptions options_;
  const Storage& storage_;
  std::string name_;
  std::unique_ptr<FileWriter> file_;
  std::optional<Time> file_start_;  // log time of its first message that is not repeated
  std::optional<Error> failure_;    // what every further write is answered with
  bool is_closed_ = false;
  std::vector<OpenTopic> topics_;
  std::vector<MetadataEntry> entries_;
  Notes notes_;
  Notes changed_notes_;  // that the present file has not, or has older
  std::uint64_t bytes_before_ = 0;
};

}  // namespace

Result<std::unique_ptr<BagWriter>> BagWriter::create(const fs::path& folder, const BagOptions& options) {
  std::error_code problem;
  if (fs::exists(folder, problem) && (!fs::is_directory(folder, problem) || !fs::is_empty(folder, problem))) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got something that is there, wanted a new or an empty folder", folder.string())};
  }
  fs::create_directories(folder, problem);
  if (problem) return Error{Code::kIo, fmt::format("{}: cannot be made: {}", folder.string(), problem.message())};
  auto writer = std::make_unique<FolderWriter>(folder, options);
  if (auto ok = writer->begin_file(); !ok) return ok.error();
  return std::unique_ptr<BagWriter>(std::move(writer));
}

}  // namespace jostle::bags
