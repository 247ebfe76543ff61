#include "services/bags/format/bag_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "services/bags/format/folder_reader.hpp"
#include "services/bags/format/metadata.hpp"
#include "services/bags/format/storage.hpp"

namespace jostle::bags {
namespace {

namespace fs = std::filesystem;

// NAME_2 comes before NAME_10.
std::pair<std::uint64_t, std::string> file_rank(const fs::path& file) {
  const std::string stem = file.stem().string();
  const std::size_t digits = stem.find_last_not_of("0123456789") + 1;
  std::uint64_t number = 0;
  for (std::size_t i = digits; i < stem.size(); ++i) number = number * 10 + static_cast<std::uint64_t>(stem[i] - '0');
  return {number, stem};
}

// What a folder without metadata.yaml holds: its writer was killed, or it was lost.
Result<std::vector<fs::path>> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code problem;
  for (fs::directory_iterator it(folder, problem), end; !problem && it != end; it.increment(problem)) {
    if (storage_of(it->path()) != nullptr) files.push_back(it->path());
  }
  if (problem) return Error{Code::kIo, fmt::format("{}: cannot be read: {}", folder.string(), problem.message())};
  if (files.empty()) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got a folder without .mcap or .db3 files, wanted a bag", folder.string())};
  }
  std::ranges::sort(files, {}, file_rank);
  return files;
}

Result<std::vector<fs::path>> files_of(const fs::path& path, bool recover) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return Error{Code::kNotFound, fmt::format("{}: not there", path.string())};
  if (!fs::is_directory(path, ignored)) return std::vector{path};
  auto metadata_result = read_metadata(path);
  if (metadata_result) return std::move(metadata_result->files);
  if (!recover && metadata_result.error().code != Code::kNotFound) return metadata_result.error();
  return files_in(path);
}

class FolderReader final : public CheckedReader {
 public:
  Result<void> open(const fs::path& path, bool recover) {
    info_.path = path;
    const auto files_result = files_of(path, recover);
    if (!files_result) return files_result.error();
    for (const fs::path& file : *files_result) {
      if (auto ok = open_file(file, recover); !ok) {
        if (!recover) return ok;
        damage_.push_back(ok.error().message);
      }
    }
    if (files_.empty()) return Error{Code::kInvalidArgument, damage_.front()};
    gather();
    seek(std::numeric_limits<Time>::min(), {});
    return {};
  }

  const BagInfo& info() const override { return info_; }

  void seek(Time from, std::vector<int> topics) override {
    next_file_ = 0;
    from_ = from;
    wanted_.assign(info_.topics.size(), topics.empty());
    for (const int topic : topics) wanted_.at(static_cast<std::size_t>(topic)) = true;
    for (File& file : files_) file.pending.reset();
    taken_ = nullptr;
  }

  Result<std::optional<Message>> next() override {
    // Behind the message that was given out last. Not then: what is wrong with the next one
    // is no reason to keep that one back.
    if (File* taken = std::exchange(taken_, nullptr)) {
      if (auto ok = advance(*taken); !ok) return ok.error();
    }
    // A file that begins no later than the message at hand may hold an earlier one.
    File* first = earliest();
    while (next_file_ < files_.size() &&
           (first == nullptr || by_start_[next_file_]->reader->info().start <= first->pending->log_time)) {
      File& file = *by_start_[next_file_++];
      if (file.reader->info().messages == 0 || file.reader->info().end < from_) continue;
      std::vector<bool> wanted;
      for (const int topic : file.topics) wanted.push_back(wanted_[static_cast<std::size_t>(topic)]);
      if (std::ranges::find(wanted, true) == wanted.end()) continue;
      file.reader->seek(from_, std::move(wanted));
      if (auto ok = advance(file); !ok) return ok.error();
      first = earliest();
    }
    if (first == nullptr) return std::optional<Message>();
    Message message = std::move(*first->pending);
    first->pending.reset();
    taken_ = first;
    return std::optional(std::move(message));
  }

  Result<std::optional<Message>> last_at(int topic, Time time) override {
    std::optional<Message> best;
    for (auto file = files_.rbegin(); file != files_.rend(); ++file) {
      const FileInfo& info = file->reader->info();
      if (info.messages == 0 || info.start > time || (best && info.end <= best->log_time)) continue;
      const auto own = std::ranges::find(file->topics, topic);
      if (own == file->topics.end()) continue;
      auto message_result = file->reader->last_at(static_cast<int>(own - file->topics.begin()), time);
      if (!message_result) return message_result;
      if (*message_result && (!best || (*message_result)->log_time > best->log_time)) {
        best = std::move(**message_result);
        best->topic = topic;
      }
    }
    return best;
  }

  Result<void> verify(const std::function<bool(const fs::path&)>& go_on) override {
    for (const File& file : files_) {
      if (go_on && !go_on(file.path)) return Error{Code::kCancelled, "interrupted"};
      if (auto ok = file.reader->verify(); !ok) return ok;
    }
    return {};
  }

  std::vector<std::string> damage() const override {
    std::vector<std::string> all = damage_;
    for (const File& file : files_) std::ranges::copy(file.reader->info().damage, std::back_inserter(all));
    // Who asks is doing what the remedy says.
    for (std::string& where : all) where.resize(std::min(where.find("; remedy: "), where.size()));
    return all;
  }

 private:
  struct File {
    fs::path path;
    std::unique_ptr<FileReader> reader;
    std::vector<int> topics;         // index in info_ by the file's own
    std::optional<Message> pending;  // what it gives out next
  };

  Result<void> open_file(const fs::path& path, bool recover) {
    const Storage* storage = storage_of(path);
    if (storage == nullptr) {
      return Error{Code::kInvalidArgument, fmt::format("{}: got another ending, wanted .mcap or .db3", path.string())};
    }
    // The first one's are not given out yet: nobody has seen what it repeats.
    auto reader_result = storage->open(path, {.skip_repeated = !files_.empty(), .recover = recover});
    if (!reader_result) return reader_result.error();
    info_.storage = storage->name;
    files_.push_back({.path = path, .reader = std::move(*reader_result)});
    return {};
  }

  void gather() {
    std::map<std::pair<std::string, std::string>, TopicInfo> topics;
    for (const File& file : files_) {
      for (const TopicInfo& topic : file.reader->info().topics) {
        auto [known, is_new] = topics.try_emplace({topic.topic.name, topic.topic.type}, topic);
        if (is_new) continue;
        known->second.messages += topic.messages;
        if (known->second.topic.definition.empty()) known->second.topic.definition = topic.topic.definition;
      }
    }
    std::map<std::pair<std::string, std::string>, int> indices;
    for (auto& [key, topic] : topics) {
      indices[key] = static_cast<int>(info_.topics.size());
      info_.topics.push_back(std::move(topic));
    }
    std::error_code ignored;
    for (File& file : files_) {
      const FileInfo& info = file.reader->info();
      for (const TopicInfo& topic : info.topics) file.topics.push_back(indices[{topic.topic.name, topic.topic.type}]);
      if (info.messages > 0) {
        info_.start = info_.messages == 0 ? info.start : std::min(info_.start, info.start);
        info_.end = info_.messages == 0 ? info.end : std::max(info_.end, info.end);
      }
      info_.messages += info.messages;
      info_.files.push_back(file.path);
      info_.bytes += fs::file_size(file.path, ignored);
      for (const auto& [name, note] : info.notes) info_.notes[name] = note;  // later files know more
      by_start_.push_back(&file);
    }
    std::ranges::stable_sort(by_start_, {}, [](const File* file) { return file->reader->info().start; });
  }

  Result<void> advance(File& file) {
    file.pending.reset();
    auto message_result = file.reader->next();
    if (!message_result) return message_result.error();
    if (!*message_result) return {};
    file.pending = std::move(**message_result);
    file.pending->topic = file.topics[static_cast<std::size_t>(file.pending->topic)];
    return {};
  }

  // The file whose next message is earliest; at equal times the earlier file.
  File* earliest() {
    File* first = nullptr;
    for (File& file : files_) {
      if (file.pending && (first == nullptr || file.pending->log_time < first->pending->log_time)) first = &file;
    }
    return first;
  }

  BagInfo info_;
  std::vector<File> files_;  // in the order they were written
  std::vector<File*> by_start_;
  std::size_t next_file_ = 0;  // of by_start_
  File* taken_ = nullptr;      // gave out the last message
  Time from_ = 0;
  std::vector<bool> wanted_;
  std::vector<std::string> damage_;
};

}  // namespace

std::optional<int> BagReader::find_topic(const std::string& name) const {
  const auto& topics = info().topics;
  const auto topic =
      std::ranges::find(topics, name, [](const TopicInfo& other) -> const std::string& { return other.topic.name; });
  if (topic == topics.end()) return {};
  return static_cast<int>(topic - topics.begin());
}

Result<std::unique_ptr<CheckedReader>> open_bag(const fs::path& path, bool recover) {
  auto reader = std::make_unique<FolderReader>();
  if (auto ok = reader->open(path, recover); !ok) return ok.error();
  return std::unique_ptr<CheckedReader>(std::move(reader));
}

Result<std::unique_ptr<BagReader>> BagReader::open(const fs::path& path) {
  auto reader_result = open_bag(path, false);
  if (!reader_result) return reader_result.error();
  return std::unique_ptr<BagReader>(std::move(*reader_result));
}

}  // namespace jostle::bags
