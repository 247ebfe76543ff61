// rosbag2's .db3, versions 2 to 4, read.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <limits>

#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/qos_text.hpp"
#include "services/bags/format/sqlite_database.hpp"
#include "services/bags/format/sqlite_file.hpp"

namespace jostle::bags {
namespace {

constexpr std::int64_t kFarthest = std::int64_t{1} << 40;  // messages, that are looked for behind damaged pages

constexpr int kNewestVersion = 4;

// All messages behind one. By rowid, which a table has also where the name or kind of its id is damaged.
constexpr const char* kRows =
    "SELECT topic_id, timestamp, data, rowid FROM messages NOT INDEXED WHERE rowid > ? ORDER BY rowid";

class SqliteReader final : public FileReader {
 public:
  SqliteReader(Database database, const OpenOptions& options) : database_(std::move(database)), options_(options) {}

  Result<void> open() {
    if (database_.was_cut()) {
      info_.findings.lost(Part::kRecord, "cut off within a page", database_.path().string());
    }
    if (auto ok = check_version(); !ok) return ok;
    if (auto ok = read_topics(); !ok && !stepped_over(Part::kTopic, ok.error())) return ok;
    spans_.resize(ids_.size());
    if (database_.has_table("message_definitions")) {
      if (auto ok = read_definitions(); !ok && !stepped_over(Part::kSchema, ok.error())) return ok;
    }
    if (auto ok = read_notes(); !ok && !stepped_over(Part::kNote, ok.error())) return ok;
    return options_.recover ? count_one_by_one() : count();
  }

  const FileInfo& info() const override { return info_; }

  void seek(Time from, std::vector<bool> wanted) override {
    from_ = from;
    wanted_ = std::move(wanted);
    rows_.reset();
    next_stretch_ = 0;
  }

  Result<std::optional<Message>> next() override {
    while (rows_ || next_stretch_ < stretches_.size()) {
      if (!rows_) {
        if (auto ok = start_rows(stretches_[next_stretch_++]); !ok) {
          if (auto over = step_over_damage(ok.error()); !over) return over.error();
          continue;
        }
      }
      const auto row_result = rows_->step();
      if (!row_result) {
        if (auto over = step_over_damage(row_result.error()); !over) return over.error();
        continue;
      }
      if (!*row_result) {
        rows_.reset();
        continue;
      }
      // Counting has told of those that are not sound.
      if (!is_sound(*rows_)) continue;
      if (const auto topic = topics_.find(rows_->number(0)); topic != topics_.end()) {
        return std::optional(message_of(*rows_, topic->second));
      }
    }
    return std::optional<Message>();
  }

  Result<std::optional<Message>> last_at(int topic, Time time) override {
    const Span& span = spans_.at(static_cast<std::size_t>(topic));
    if (span.first > time) return std::optional<Message>();
    // The index is of times alone: where the topic's last message is known, go there at once.
    auto statement_result = database_.prepare(
        "SELECT topic_id, timestamp, data FROM messages WHERE topic_id = ? AND timestamp <= ? AND timestamp >= ? AND "
        "rowid > ? AND typeof(timestamp) = 'integer' AND typeof(data) IN ('blob', 'text') "
        "ORDER BY timestamp DESC, rowid DESC LIMIT 1");
    if (!statement_result) return statement_result.error();
    statement_result->bind(1, ids_.at(static_cast<std::size_t>(topic)));
    statement_result->bind(2, std::min(time, span.last));
    statement_result->bind(3, time >= span.last ? span.last : span.first);
    statement_result->bind(4, repeated_);
    auto row_result = statement_result->step();
    if (!row_result) return row_result.error();
    if (!*row_result) return std::optional<Message>();
    return std::optional(message_of(*statement_result, topic));
  }

  Result<Attachment> attachment(std::size_t) const override {
    return Error{Code::kInternal, "databases have no attachments"};
  }

  Result<std::vector<Finding>> verify() override {
    auto word_result = database_.value("PRAGMA integrity_check(1)");
    if (!word_result) return word_result.error();
    if (*word_result != "ok") return damaged(word_result->value_or("no answer"));
    auto rows_result = database_.value("SELECT count(*) FROM messages");
    if (!rows_result) return rows_result.error();
    Findings findings;
    findings.add_all(info_.findings.list());
    const std::uint64_t met = std::strtoull(rows_result->value_or("0").c_str(), nullptr, 10);
    const std::uint64_t taken = info_.messages + info_.repeated + info_.findings.count_lost(Part::kMessage);
    if (met != taken) {
      findings.flawed(Part::kFile, fmt::format("messages: got {} rows, wanted {} as they were counted", met, taken),
                      database_.path().string());
    }
    return findings.list();
  }

 private:
  struct Span {
    Time first = std::numeric_limits<Time>::max(), last = std::numeric_limits<Time>::min();
  };

  Error damaged(const std::string& what) const {
    return {Code::kInvalidArgument, fmt::format("{}: damaged: {}; remedy: jostle bag recover saves what is readable",
                                                database_.path().string(), what)};
  }

  bool stepped_over(Part part, const Error& error) {
    if (!options_.recover) return false;
    info_.findings.lost(part, error.message, "");
    return true;
  }

  Result<void> step_over_damage(const Error& error) {
    rows_.reset();
    if (options_.recover) return {};  // counting has told of it, and behind a stretch there is some
    next_stretch_ = stretches_.size();
    return error;
  }

  // Whether a row is a message: a database takes any kind of value anywhere.
  static bool is_sound(const Statement& row) {
    return row.is_integer(0) && row.is_integer(1) && row.number(1) >= 0 && row.is_bytes(2);
  }

  Result<void> check_version() {
    const bool has_topics = database_.has_table("topics") || options_.recover;  // without, its messages are counted
    if (!has_topics || !database_.has_table("messages")) {
      // Nothing at all may be seen of a damaged one.
      if (auto rows = database_.value("SELECT count(*) FROM sqlite_master"); !rows) return rows.error();
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: got another database, wanted a bag of rosbag2: no tables topics and messages",
                               database_.path().string())};
    }
    if (!database_.has_table("schema")) return {};
    auto version_result = database_.value("SELECT schema_version FROM schema");
    if (!version_result) return version_result.error();
    const std::string text = version_result->value_or("0");
    if (std::atoi(text.c_str()) <= kNewestVersion) return {};
    const Error later{Code::kInvalidArgument,
                      fmt::format("{}: got version {} of the schema, wanted at most {}: a later program wrote it",
                                  database_.path().string(), text, kNewestVersion)};
    if (!options_.recover) return later;
    info_.findings.flawed(Part::kFile, later.message, "");  // its tables may still be those that are known
    return {};
  }

  Result<void> read_topics() {
    // Not by the version's number: some writers of version 4 have fewer columns than it says.
    const bool has_qos = database_.has_column("topics", "offered_qos_profiles");
    auto topics_result =
        database_.prepare(fmt::format("SELECT id, name, type, serialization_format{} FROM topics ORDER BY id",
                                      has_qos ? ", offered_qos_profiles" : ""));
    if (!topics_result) return topics_result.error();
    Result<bool> row = true;
    while ((row = topics_result->step()) && *row) {
      Topic topic{.name = topics_result->text(1), .type = topics_result->text(2)};
      topic.encoding = topics_result->text(3);
      if (has_qos) topic.qos = parse_qos(topics_result->text(4));
      const std::int64_t id = topics_result->number(0);
      topics_[id] = static_cast<int>(ids_.size());
      ids_.push_back(id);
      info_.topics.push_back({.topic = std::move(topic)});
    }
    if (!row) return row.error();
    return {};
  }

  Result<void> read_definitions() {
    auto rows_result =
        database_.prepare("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions");
    if (!rows_result) return rows_result.error();
    Result<bool> row = true;
    while ((row = rows_result->step()) && *row) {
      for (TopicInfo& info : info_.topics) {
        Topic& topic = info.topic;
        if (topic.type != rows_result->text(0) || rows_result->text(1).empty()) continue;
        topic.schema = rows_result->text(1);
        topic.definition = rows_result->text(2);
        topic.has_no_fields = topic.schema == kSchemaEncoding && topic.definition.empty();
      }
    }
    if (!row) return row.error();
    return {};
  }

  Result<void> read_notes() {
    if (!database_.has_table(kNotesTable)) return {};
    auto rows_result = database_.prepare(fmt::format("SELECT name, key, value FROM {}", kNotesTable));
    if (!rows_result) return rows_result.error();
    Result<bool> row = true;
    while ((row = rows_result->step()) && *row) {
      const std::string name = rows_result->text(0);
      if (name != kRepeatedRow) {
        info_.notes[name][rows_result->text(1)] = rows_result->text(2);
      } else if (options_.skip_repeated) {
        repeated_ = std::atoll(rows_result->text(2).c_str());
      }
    }
    if (!row) return row.error();
    return {};
  }

  Result<void> count() {
    stretches_ = {{repeated_, std::numeric_limits<std::int64_t>::max()}};
    auto rows_result = database_.prepare(
        "SELECT topic_id, min(timestamp), max(timestamp), count(*), typeof(timestamp) = 'integer' AND timestamp >= 0 "
        "AND typeof(data) IN ('blob', 'text') AND typeof(topic_id) = 'integer' AS is_sound FROM messages WHERE rowid > "
        "? "
        "GROUP BY topic_id, is_sound");
    if (!rows_result) return rows_result.error();
    rows_result->bind(1, repeated_);
    Result<bool> row = true;
    while ((row = rows_result->step()) && *row) {
      const auto messages = static_cast<std::uint64_t>(rows_result->number(3));
      if (rows_result->number(4) != 0) {
        add(rows_result->number(0), messages, rows_result->number(1), rows_result->number(2));
      } else {
        lose_unsound(messages);
      }
    }
    if (!row) return row.error();
    return count_repeated();
  }

  Result<void> count_repeated() {
    if (repeated_ == 0) return {};
    auto count_result = database_.value(fmt::format("SELECT count(*) FROM messages WHERE rowid <= {}", repeated_));
    if (!count_result) return count_result.error();
    info_.repeated = std::strtoull(count_result->value_or("0").c_str(), nullptr, 10);
    return {};
  }

  // As far as the table can be read: behind pages that are damaged it goes on with the next message that is there.
  Result<void> count_one_by_one() {
    // Where the table's own description is damaged, its columns have no names to ask for; how many rows it has may be
    // known.
    if (auto rows_result = database_.prepare(kRows); !rows_result) {
      const auto count_result = database_.value("SELECT count(*) FROM messages");
      const std::uint64_t rows = count_result ? std::strtoull(count_result->value_or("0").c_str(), nullptr, 10) : 0;
      if (rows > 0) {
        info_.findings.lost(Part::kMessage, rows_result.error().message, "", rows);
      } else {
        info_.findings.lost(Part::kRecord, rows_result.error().message + ": the table of messages", "");
      }
      return {};
    }
    (void)count_repeated();  // they are left out in any case
    std::int64_t last = repeated_;
    std::int64_t leap = 1;  // over what is found and cannot be read, longer each time: a tree may lead in circles
    for (;;) {
      const std::int64_t before = last;
      const auto end = count_from(last);
      last = std::max(last, before);  // nor need its numbers ascend
      if (options_.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      if (last > before) stretches_.emplace_back(before, last);
      if (end) return {};
      const auto next = next_readable(last);
      const std::string where = fmt::format("{}, behind message {}", end.error().message, last);
      if (!next || leap > kFarthest) {
        info_.findings.lost(Part::kRecord, where + ": the rest of the table", "");
        return {};
      }
      // One that is found and cannot be read after all is passed over, too.
      const std::int64_t passed = last == before ? std::max(*next, last + leap) : std::max(*next - 1, last);
      leap = last == before ? 2 * leap : 1;
      if (passed > last) {
        info_.findings.lost(Part::kMessage, "damaged pages", where, static_cast<std::uint64_t>(passed - last));
      }
      last = passed;
    }
  }

  // Counts the messages behind one, and moves it to the last that could be read.
  Result<void> count_from(std::int64_t& last) {
    auto rows_result = database_.prepare(kRows);
    if (!rows_result) return rows_result.error();
    rows_result->bind(1, last);
    Result<bool> row = true;
    while (!options_.stop.stop_requested() && (row = rows_result->step()) && *row) {
      last = rows_result->number(3);
      if (is_sound(*rows_result)) {
        add(rows_result->number(0), 1, rows_result->number(1), rows_result->number(1));
      } else {
        lose_unsound(1);
      }
    }
    if (!row) return row.error();
    return {};
  }

  // The first message behind one that can be read, nothing if there is none: found by strides that double, and then by
  // halves, since a look at one message does not read those before it.
  std::optional<std::int64_t> next_readable(std::int64_t last) const {
    const auto look = [&](std::int64_t behind) -> Result<std::optional<std::int64_t>> {
      auto row_result =
          database_.prepare("SELECT data, rowid FROM messages NOT INDEXED WHERE rowid > ? ORDER BY rowid LIMIT 1");
      if (!row_result) return row_result.error();
      row_result->bind(1, behind);
      auto is_there = row_result->step();
      if (!is_there) return is_there.error();
      return *is_there ? std::optional(row_result->number(1)) : std::nullopt;
    };
    std::int64_t unreadable = last, stride = 1;
    if (last > std::numeric_limits<std::int64_t>::max() - 2 * kFarthest) return {};
    while (!look(unreadable + stride)) {
      unreadable += stride;
      stride *= 2;
      if (stride > kFarthest) return {};
    }
    std::int64_t readable = unreadable + stride;
    while (readable - unreadable > 1) {
      const std::int64_t middle = unreadable + (readable - unreadable) / 2;
      (look(middle) ? readable : unreadable) = middle;
    }
    const auto found = look(readable);
    return found ? *found : std::nullopt;
  }

  void lose_unsound(std::uint64_t messages) {
    info_.findings.lost(Part::kMessage,
                        "messages: got another kind of value, or a time before 1970, wanted numbers and bytes",
                        database_.path().string(), messages);
  }

  void add(std::int64_t topic_id, std::uint64_t messages, Time first, Time last) {
    const auto topic = topics_.find(topic_id);
    if (topic == topics_.end()) {
      info_.findings.lost(Part::kMessage, fmt::format("got topic {}, wanted one that the file has", topic_id),
                          database_.path().string(), messages);
      return;
    }
    info_.start = info_.messages == 0 ? first : std::min(info_.start, first);
    info_.end = info_.messages == 0 ? last : std::max(info_.end, last);
    info_.messages += messages;
    const auto index = static_cast<std::size_t>(topic->second);
    info_.topics[index].messages += messages;
    spans_[index].first = std::min(spans_[index].first, first);
    spans_[index].last = std::max(spans_[index].last, last);
  }

  // `stretch`: the messages behind its first number, up to its second.
  Result<void> start_rows(const std::pair<std::int64_t, std::int64_t>& stretch) {
    std::vector<std::int64_t> wanted;
    for (std::size_t i = 0; i < wanted_.size(); ++i) {
      if (wanted_[i]) wanted.push_back(ids_[i]);
    }
    const bool is_filtered = wanted.size() < ids_.size() && !wanted_.empty();
    auto rows_result =
        database_.prepare(fmt::format("SELECT topic_id, timestamp, data FROM messages {} WHERE timestamp >= ? AND "
                                      "rowid > ? AND rowid <= ?{} ORDER BY {}",
                                      // The index may be what is damaged.
                                      options_.recover ? "NOT INDEXED" : "",
                                      is_filtered ? fmt::format(" AND topic_id IN ({})", fmt::join(wanted, ",")) : "",
                                      options_.recover ? "rowid" : "timestamp, rowid"));
    if (!rows_result) return rows_result.error();
    rows_result->bind(1, from_);
    rows_result->bind(2, stretch.first);
    rows_result->bind(3, stretch.second);
    rows_.emplace(std::move(*rows_result));
    return {};
  }

  static Message message_of(const Statement& row, int topic) {
    const auto data = row.bytes(2);
    return {
        .topic = topic, .log_time = row.number(1), .publish_time = row.number(1), .data = {data.begin(), data.end()}};
  }

  Database database_;
  const OpenOptions options_;
  FileInfo info_;
  std::vector<std::int64_t> ids_;       // in the database, by topic
  std::map<std::int64_t, int> topics_;  // the other way round
  std::vector<Span> spans_;             // log times, by topic
  std::int64_t repeated_ = 0;           // messages up to this one are left out
  Time from_ = std::numeric_limits<Time>::min();
  std::vector<bool> wanted_;
  /// Numbers of messages that can be read one after the other: behind the first, up to the second.
  std::vector<std::pair<std::int64_t, std::int64_t>> stretches_;
  std::size_t next_stretch_ = 0;
  std::optional<Statement> rows_;  // of the stretch before
};

}  // namespace

Result<std::unique_ptr<FileReader>> open_sqlite(const std::filesystem::path& file, const OpenOptions& options) {
  auto database_result = Database::open(file, options.recover);
  if (!database_result) return database_result.error();
  auto reader = std::make_unique<SqliteReader>(std::move(*database_result), options);
  if (auto ok = reader->open(); !ok) return ok.error();
  return std::unique_ptr<FileReader>(std::move(reader));
}

const Storage& sqlite_storage() {
  static constexpr Storage kStorage{"sqlite3", ".db3", create_sqlite, open_sqlite};
  return kStorage;
}

}  // namespace jostle::bags
