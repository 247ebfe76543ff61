// rosbag2's .db3, versions 2 to 4, read.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>

#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/qos_text.hpp"
#include "services/bags/format/sqlite_database.hpp"
#include "services/bags/format/sqlite_file.hpp"

namespace jostle::bags {
namespace {

constexpr int kNewestVersion = 4;

class SqliteReader final : public FileReader {
 public:
  SqliteReader(Database database, const OpenOptions& options) : database_(std::move(database)), options_(options) {}

  Result<void> open() {
    if (auto ok = check_version(); !ok) return ok;
    if (auto ok = read_topics(); !ok) return ok;
    if (auto ok = read_notes(); !ok && !stepped_over(ok.error())) return ok;
    return options_.recover ? count_one_by_one() : count();
  }

  const FileInfo& info() const override { return info_; }

  void seek(Time from, std::vector<bool> wanted) override {
    from_ = from;
    wanted_ = std::move(wanted);
    rows_.reset();
    is_at_end_ = false;
  }

  Result<std::optional<Message>> next() override {
    while (!is_at_end_) {
      if (!rows_) {
        if (auto ok = start_rows(); !ok) return ended(ok.error());
      }
      auto row_result = rows_->step();
      if (!row_result) return ended(row_result.error());
      if (!*row_result) break;
      const auto topic = topics_.find(rows_->number(0));
      if (topic == topics_.end()) {
        const Error error =
            damaged(fmt::format("messages: got one of topic {}, wanted a topic that the file has", rows_->number(0)));
        if (stepped_over(error)) continue;
        return ended(error);
      }
      return std::optional(message_of(*rows_, topic->second));
    }
    is_at_end_ = true;
    rows_.reset();
    return std::optional<Message>();
  }

  Result<std::optional<Message>> last_at(int topic, Time time) override {
    const Span& span = spans_.at(static_cast<std::size_t>(topic));
    if (span.first > time) return std::optional<Message>();
    // The index is of times alone: where the topic's last message is known, go there at once.
    auto statement_result = database_.prepare(
        "SELECT topic_id, timestamp, data FROM messages WHERE topic_id = ? AND timestamp <= ? AND timestamp >= ? AND "
        "id > ? "
        "ORDER BY timestamp DESC, id DESC LIMIT 1");
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

  Result<void> verify() override {
    auto word_result = database_.value("PRAGMA integrity_check(1)");
    if (!word_result) return word_result.error();
    if (*word_result != "ok") return damaged(word_result->value_or("no answer"));
    return {};
  }

 private:
  struct Span {
    Time first = std::numeric_limits<Time>::max(), last = std::numeric_limits<Time>::min();
  };

  Error damaged(const std::string& what) const {
    return {Code::kInvalidArgument, fmt::format("{}: damaged: {}; remedy: jostle bag recover saves what is readable",
                                                database_.path().string(), what)};
  }

  bool stepped_over(const Error& error) {
    if (!options_.recover) return false;
    info_.damage.push_back(error.message);
    return true;
  }

  Result<std::optional<Message>> ended(const Error& error) {
    is_at_end_ = true;
    rows_.reset();
    if (options_.recover) return std::optional<Message>();  // counting has told of it
    return error;
  }

  Result<void> check_version() const {
    if (!database_.has_table("topics") || !database_.has_table("messages")) {
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
    if (std::atoi(text.c_str()) > kNewestVersion) {
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: got version {} of the schema, wanted at most {}: a later program wrote it",
                               database_.path().string(), text, kNewestVersion)};
    }
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
      if (const std::string format = topics_result->text(3); format != kMessageEncoding) {
        return Error{Code::kInvalidArgument,
                     fmt::format("{}: topic {}: got messages encoded as '{}', wanted '{}'", database_.path().string(),
                                 topic.name, format, kMessageEncoding)};
      }
      if (has_qos) topic.qos = parse_qos(topics_result->text(4));
      const std::int64_t id = topics_result->number(0);
      topics_[id] = static_cast<int>(ids_.size());
      ids_.push_back(id);
      info_.topics.push_back({.topic = std::move(topic)});
    }
    if (!row) return row.error();
    spans_.resize(ids_.size());
    return database_.has_table("message_definitions") ? read_definitions() : Result<void>();
  }

  Result<void> read_definitions() {
    auto rows_result =
        database_.prepare("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions");
    if (!rows_result) return rows_result.error();
    Result<bool> row = true;
    while ((row = rows_result->step()) && *row) {
      if (rows_result->text(1) != kSchemaEncoding) continue;
      for (TopicInfo& topic : info_.topics) {
        if (topic.topic.type == rows_result->text(0)) topic.topic.definition = rows_result->text(2);
      }
    }
    if (!row && !stepped_over(row.error())) return row.error();
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
    auto rows_result = database_.prepare(
        "SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages WHERE id > ? GROUP BY topic_id");
    if (!rows_result) return rows_result.error();
    rows_result->bind(1, repeated_);
    Result<bool> row = true;
    while ((row = rows_result->step()) && *row) {
      add(rows_result->number(0), static_cast<std::uint64_t>(rows_result->number(1)), rows_result->number(2),
          rows_result->number(3));
    }
    if (!row) return row.error();
    return {};
  }

  // As far as the table can be read.
  Result<void> count_one_by_one() {
    auto rows_result =
        database_.prepare("SELECT topic_id, timestamp, data, id FROM messages NOT INDEXED WHERE id > ? ORDER BY id");
    if (!rows_result) return rows_result.error();
    rows_result->bind(1, repeated_);
    Result<bool> row = true;
    std::int64_t last = 0;
    while ((row = rows_result->step()) && *row) {
      last = rows_result->number(3);
      add(rows_result->number(0), 1, rows_result->number(1), rows_result->number(1));
    }
    if (!row) info_.damage.push_back(fmt::format("{}, behind message {}", row.error().message, last));
    return {};
  }

  void add(std::int64_t topic_id, std::uint64_t messages, Time first, Time last) {
    const auto topic = topics_.find(topic_id);
    if (topic == topics_.end()) return;  // next() says what is wrong with it
    info_.start = info_.messages == 0 ? first : std::min(info_.start, first);
    info_.end = info_.messages == 0 ? last : std::max(info_.end, last);
    info_.messages += messages;
    const auto index = static_cast<std::size_t>(topic->second);
    info_.topics[index].messages += messages;
    spans_[index].first = std::min(spans_[index].first, first);
    spans_[index].last = std::max(spans_[index].last, last);
  }

  Result<void> start_rows() {
    std::vector<std::int64_t> wanted;
    for (std::size_t i = 0; i < wanted_.size(); ++i) {
      if (wanted_[i]) wanted.push_back(ids_[i]);
    }
    const bool is_filtered = wanted.size() < ids_.size() && !wanted_.empty();
    auto rows_result = database_.prepare(
        fmt::format("SELECT topic_id, timestamp, data FROM messages {} WHERE timestamp >= ? AND id > ?{} ORDER BY {}",
                    // The index may be what is damaged.
                    options_.recover ? "NOT INDEXED" : "",
                    is_filtered ? fmt::format(" AND topic_id IN ({})", fmt::join(wanted, ",")) : "",
                    options_.recover ? "id" : "timestamp, id"));
    if (!rows_result) return rows_result.error();
    rows_result->bind(1, from_);
    rows_result->bind(2, repeated_);
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
  std::optional<Statement> rows_;
  bool is_at_end_ = false;
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
