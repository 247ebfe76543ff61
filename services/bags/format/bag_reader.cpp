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

struct BagFiles {
  std::vector<fs::path> files;
  std::optional<std::uint64_t> messages;  // as metadata.yaml says
  Findings findings;
};

// The files that metadata.yaml lists; to recover, those that it does not list, too.
Result<BagFiles> files_of(const fs::path& path, bool recover) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return Error{Code::kNotFound, fmt::format("{}: not there", path.string())};
  if (!fs::is_directory(path, ignored)) return BagFiles{.files = {path}};
  BagFiles bag;
  auto metadata_result = read_metadata(path);
  if (!metadata_result && metadata_result.error().code != Code::kNotFound) {
    if (!recover) return metadata_result.error();
    bag.findings.flawed(Part::kFile, metadata_result.error().message, "");
  }
  auto there_result = files_in(path);
  if (!metadata_result) {
    if (!there_result) return there_result.error();
    bag.files = std::move(*there_result);
    return bag;
  }
  bag.messages = metadata_result->messages;
  const auto is_listed = [&](const fs::path& file) {
    return std::ranges::any_of(
        bag.files, [&](const fs::path& other) { return other == file || fs::equivalent(other, file, ignored); });
  };
  for (fs::path& file : metadata_result->files) {
    if (is_listed(file)) {
      bag.findings.flawed(Part::kFile, "metadata.yaml lists it twice", file.string());
    } else {
      bag.files.push_back(std::move(file));
    }
  }
  if (!there_result) return bag;
  for (const fs::path& file : *there_result) {
    if (is_listed(file)) continue;
    if (recover) {
      bag.findings.flawed(Part::kFile, "metadata.yaml does not list it", file.string());
      bag.files.push_back(file);
    } else {
      bag.findings.lost(
          Part::kFile,
          fmt::format("{}: metadata.yaml does not list it; remedy: jostle bag recover takes it, too", file.string()),
          "");
    }
  }
  if (recover) std::ranges::sort(bag.files, {}, file_rank);
  return bag;
}

class FolderReader final : public CheckedReader {
 public:
  Result<void> open(const fs::path& path, bool recover, const std::stop_token& stop) {
    info_.path = path;
    auto files_result = files_of(path, recover);
    if (!files_result) return files_result.error();
    findings_ = std::move(files_result->findings);
    said_messages_ = files_result->messages;
    for (const fs::path& file : files_result->files) {
      if (auto ok = open_file(file, recover, stop); !ok) {
        if (ok.error().code == Code::kCancelled) return ok;
        if (!recover) return with_remedy(ok.error(), files_result->files.size());
        findings_.lost(Part::kFile, ok.error().message, "");
      }
    }
    if (files_.empty()) return Error{Code::kInvalidArgument, findings_.list().back().what};
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
    std::optional<Message> best;  // of files from the last backwards
    for (auto file = files_.rbegin(); file != files_.rend(); ++file) {
      const FileInfo& info = file->reader->info();
      if (info.messages == 0 || info.start > time || (best && info.end <= best->log_time)) continue;
      // A database may have a topic under several numbers.
      for (std::size_t own = 0; own < file->topics.size(); ++own) {
        if (file->topics[own] != topic) continue;
        auto message_result = file->reader->last_at(static_cast<int>(own), time);
        if (!message_result) return message_result;
        if (*message_result && (!best || (*message_result)->log_time > best->log_time)) {
          best = std::move(**message_result);
          best->topic = topic;
        }
      }
    }
    return best;
  }

  std::vector<Finding> findings() const override {
    std::vector<Finding> all = findings_.list();
    for (const File& file : files_) std::ranges::copy(file.reader->info().findings.list(), std::back_inserter(all));
    return all;
  }

  std::uint64_t repeated() const override {
    std::uint64_t messages = 0;
    for (const File& file : files_) messages += file.reader->info().repeated;
    return messages;
  }

  Result<Attachment> attachment(std::size_t index) const override {
    for (const File& file : files_) {
      const std::size_t here = file.reader->info().attachments.size();
      if (index < here) return file.reader->attachment(index);
      index -= here;
    }
    return Error{Code::kInternal, "no such attachment"};
  }

  Result<std::vector<Finding>> verify(const std::function<bool(const fs::path&)>& go_on) override {
    std::vector<Finding> all = findings_.list();
    std::uint64_t met = 0;
    for (const File& file : files_) {
      if (go_on && !go_on(file.path)) return Error{Code::kCancelled, "interrupted"};
      auto found_result = file.reader->verify();
      if (!found_result) return found_result.error();
      for (const Finding& finding : *found_result) {
        if (finding.part == Part::kMessage && finding.is_lost) met += finding.count;
      }
      std::ranges::move(*found_result, std::back_inserter(all));
    }
    met += info_.messages + repeated();
    if (said_messages_ && *said_messages_ != met) {
      all.push_back({.part = Part::kFile,
                     .what = fmt::format("{}: got {} messages in the files, wanted {} as it says",
                                         (info_.path / kMetadataFile).string(), met, *said_messages_),
                     .is_lost = false});
    }
    return all;
  }

 private:
  struct File {
    fs::path path;
    std::unique_ptr<FileReader> reader;
    std::vector<int> topics;         // index in info_ by the file's own
    std::optional<Message> pending;  // what it gives out next
  };

  // One file less costs the others only here.
  static Error with_remedy(Error error, std::size_t files) {
    if (files > 1 && error.message.find("; remedy: ") == std::string::npos) {
      error.message += "; remedy: jostle bag recover takes the other files";
    }
    return error;
  }

  Result<void> open_file(const fs::path& path, bool recover, const std::stop_token& stop) {
    const Storage* storage = storage_of(path);
    if (storage == nullptr) {
      return Error{Code::kInvalidArgument, fmt::format("{}: got another ending, wanted .mcap or .db3", path.string())};
    }
    // The first one's are not given out yet: nobody has seen what it repeats.
    auto reader_result = storage->open(path, {.skip_repeated = !files_.empty(), .recover = recover, .stop = stop});
    if (!reader_result) return reader_result.error();
    // A folder may have both kinds; MCAP has room for all that either holds.
    if (info_.storage != mcap_storage().name) info_.storage = storage->name;
    files_.push_back({.path = path, .reader = std::move(*reader_result)});
    return {};
  }

  // The bag's topics in the order of their names; those of files that are the same are one. Definitions that one
  // file has and another lacks, as databases do, are no difference.
  void gather() {
    std::vector<const TopicInfo*> all;
    for (const File& file : files_) {
      for (const TopicInfo& topic : file.reader->info().topics) all.push_back(&topic);
    }
    std::map<std::pair<std::string, std::string>, std::vector<TopicInfo>> topics;
    const auto same_in = [](std::vector<TopicInfo>& known, const Topic& topic) {
      return std::ranges::find_if(known, [&](const TopicInfo& other) {
        if (other.topic.is_same_as(topic)) return true;
        const bool is_told = has_definition(other.topic) && has_definition(topic);
        return !is_told && other.topic.encoding == topic.encoding;
      });
    };
    for (const TopicInfo* topic : all) {
      auto& known = topics[{topic->topic.name, topic->topic.type}];
      const auto same = same_in(known, topic->topic);
      if (same == known.end()) {
        known.push_back(*topic);
        continue;
      }
      same->messages += topic->messages;
      if (!has_definition(same->topic) && has_definition(topic->topic)) same->topic = topic->topic;
    }
    std::map<std::pair<std::string, std::string>, int> first;  // index of the first of a name and type
    for (const auto& [key, known] : topics) {
      first[key] = static_cast<int>(info_.topics.size());
      for (const TopicInfo& topic : known) info_.topics.push_back(topic);
    }
    const auto index_of = [&](const Topic& topic) {
      const std::pair key(topic.name, topic.type);
      auto& known = topics[key];
      return first[key] + static_cast<int>(same_in(known, topic) - known.begin());
    };
    std::error_code ignored;
    for (File& file : files_) {
      const FileInfo& info = file.reader->info();
      for (const TopicInfo& topic : info.topics) file.topics.push_back(index_of(topic.topic));
      if (info.messages > 0) {
        info_.start = info_.messages == 0 ? info.start : std::min(info_.start, info.start);
        info_.end = info_.messages == 0 ? info.end : std::max(info_.end, info.end);
      }
      info_.messages += info.messages;
      info_.files.push_back(file.path);
      info_.bytes += fs::file_size(file.path, ignored);
      std::ranges::copy(info.attachments, std::back_inserter(info_.attachments));
      std::ranges::copy(info.earlier_notes, std::back_inserter(info_.earlier_notes));
      for (const auto& [name, note] : info.notes) add_note(name, note);
      by_start_.push_back(&file);
    }
    std::ranges::stable_sort(by_start_, {}, [](const File* file) { return file->reader->info().start; });
  }

  static bool has_definition(const Topic& topic) { return !topic.definition.empty() || topic.has_no_fields; }

  // Later files know more.
  void add_note(const std::string& name, const Note& note) {
    const auto [known, is_new] = info_.notes.try_emplace(name, note);
    if (is_new || known->second == note) return;
    if (name != kLostNote) info_.earlier_notes.emplace_back(name, known->second);
    known->second = note;
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
  Findings findings_;                           // of the folder
  std::optional<std::uint64_t> said_messages_;  // in all files, as metadata.yaml says
};

}  // namespace

std::optional<int> BagReader::find_topic(const std::string& name) const {
  const auto& topics = info().topics;
  const auto topic =
      std::ranges::find(topics, name, [](const TopicInfo& other) -> const std::string& { return other.topic.name; });
  if (topic == topics.end()) return {};
  return static_cast<int>(topic - topics.begin());
}

Result<std::unique_ptr<CheckedReader>> open_bag(const fs::path& path, bool recover, std::stop_token stop) {
  auto reader = std::make_unique<FolderReader>();
  if (auto ok = reader->open(path, recover, stop); !ok) return ok.error();
  return std::unique_ptr<CheckedReader>(std::move(reader));
}

Result<std::unique_ptr<BagReader>> BagReader::open(const fs::path& path) {
  auto reader_result = open_bag(path, false, {});
  if (!reader_result) return reader_result.error();
  return std::unique_ptr<BagReader>(std::move(*reader_result));
}

}  // namespace jostle::bags
