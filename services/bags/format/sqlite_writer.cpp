// rosbag2's .db3, version 3, written in transactions of about a mebibyte.

#include <fmt/format.h>

#include <algorithm>

#include "services/bags/format/qos_text.hpp"
#include "services/bags/format/sqlite_database.hpp"
#include "services/bags/format/sqlite_file.hpp"

namespace jostle::bags {
namespace {

constexpr std::uint64_t kTransactionBytes = 1 << 20;
// Row, its head, its entry in the index: measured, of small messages.
constexpr std::uint64_t kRowBytes = 48;

// A journal in a file is what lets others undo a half-written transaction when this process is
// killed. Waiting for the disk would only help when the machine goes down, and costs a seek
// per transaction.
constexpr const char* kPragmas = "PRAGMA journal_mode=TRUNCATE; PRAGMA synchronous=OFF; PRAGMA locking_mode=NORMAL";

constexpr const char* kTables =
    "BEGIN;"
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);"
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
    " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
    "NOT NULL);"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    "CREATE TABLE jostle_notes(name TEXT NOT NULL, key TEXT NOT NULL, value TEXT NOT NULL);"
    "INSERT INTO schema(schema_version, ros_distro) VALUES (3, 'humble');"
    "COMMIT";

class SqliteWriter final : public FileWriter {
 public:
  explicit SqliteWriter(Database database) : database_(std::move(database)) {}

  Result<void> begin() {
    if (auto ok = database_.run(kPragmas); !ok) return ok;
    if (auto ok = database_.run(kTables); !ok) return ok;
    auto insert_result = database_.prepare("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)");
    if (!insert_result) return insert_result.error();
    insert_.emplace(std::move(*insert_result));
    return {};
  }

  Result<void> add_topic(const Topic& topic) override {
    if (failure_) return *failure_;
    if (auto ok = begin_transaction(); !ok) return ok;
    auto statement_result = database_.prepare(
        "INSERT INTO topics(id, name, type, serialization_format, offered_qos_profiles) VALUES (?, ?, ?, ?, ?)");
    if (!statement_result) return statement_result.error();
    const std::string qos = qos_text(topic.qos);
    statement_result->bind(1, static_cast<std::int64_t>(open_.messages.size() + 1));
    statement_result->bind(2, topic.name);
    statement_result->bind(3, topic.type);
    statement_result->bind(4, topic.encoding);
    statement_result->bind(5, qos);
    if (auto ok = kept(statement_result->run()); !ok) return ok;
    open_.messages.push_back(0);
    return {};
  }

  Result<void> write(int topic, const MessageView& message) override {
    if (failure_) return *failure_;
    if (auto ok = begin_transaction(); !ok) return ok;
    insert_->bind(1, topic + 1);
    insert_->bind(2, message.log_time);
    insert_->bind(3, message.data);
    if (auto ok = kept(insert_->run()); !ok) return ok;
    const bool is_first = messages_ == 0;
    open_.start = is_first ? message.log_time : std::min(open_.start, message.log_time);
    open_.end = is_first ? message.log_time : std::max(open_.end, message.log_time);
    ++open_.messages[static_cast<std::size_t>(topic)];
    ++messages_;
    open_bytes_ += message.data.size() + kRowBytes;
    return open_bytes_ < kTransactionBytes ? Result<void>() : commit();
  }

  Result<void> flush(const Notes& notes) override {
    if (failure_) return *failure_;
    for (const auto& [name, note] : notes) {
      if (auto ok = kept(put_note(name, note)); !ok) return ok;
    }
    return commit();
  }

  Result<void> attach(const Attachment& attachment) override { return no_room_for("attachment " + attachment.name); }
  Result<void> add_note(const NamedNote& note) override { return no_room_for("a second note " + note.first); }

  Result<void> end_repeated() override { return flush({{kRepeatedRow, {{"messages", std::to_string(messages_)}}}}); }

  Result<void> close(const Notes& notes) override {
    if (is_closed_) return {};
    is_closed_ = true;
    // A failure that write() or flush() has told of is not told again.
    Result<void> flushed;
    if (!failure_) flushed = commit();
    auto completed = complete(notes);
    return flushed ? completed : flushed;
  }

  std::uint64_t bytes() const override { return is_closed_ ? size_on_disk() : committed_bytes_ + open_bytes_; }
  WrittenFile written() const override { return committed_; }

 private:
  Error no_room_for(const std::string& what) const {
    return {Code::kInvalidArgument,
            fmt::format("{}: got {}, for which databases have no room; remedy: MCAP", database_.path().string(), what)};
  }

  std::uint64_t size_on_disk() const {
    std::error_code ignored;
    const auto size = std::filesystem::file_size(database_.path(), ignored);
    return ignored ? 0 : size;
  }

  Result<void> begin_transaction() {
    if (database_.is_in_transaction()) return {};
    return kept(database_.run("BEGIN"));
  }

  Result<void> commit() {
    if (!database_.is_in_transaction()) return {};
    if (auto ok = kept(database_.run("COMMIT")); !ok) return ok;
    committed_ = open_;
    committed_bytes_ = size_on_disk();
    open_bytes_ = 0;
    return {};
  }

  // After a failure the database is what it was after the last transaction.
  Result<void> kept(Result<void> result) {
    if (!result) {
      failure_ = result.error();
      if (database_.is_in_transaction()) (void)database_.run("ROLLBACK");
    }
    return result;
  }

  Result<void> put_note(const std::string& name, const Note& note) {
    if (!database_.is_in_transaction()) {
      if (auto ok = database_.run("BEGIN"); !ok) return ok;
    }
    auto remove_result = database_.prepare(fmt::format("DELETE FROM {} WHERE name = ?", kNotesTable));
    if (!remove_result) return remove_result.error();
    remove_result->bind(1, name);
    if (auto ok = remove_result->run(); !ok) return ok;
    auto statement_result =
        database_.prepare(fmt::format("INSERT INTO {}(name, key, value) VALUES (?, ?, ?)", kNotesTable));
    if (!statement_result) return statement_result.error();
    for (const auto& [key, value] : note) {
      statement_result->bind(1, name);
      statement_result->bind(2, key);
      statement_result->bind(3, value);
      if (auto ok = statement_result->run(); !ok) return ok;
    }
    return {};
  }

  Result<void> complete(const Notes& notes) {
    Result<void> ok;
    for (const auto& [name, note] : notes) {
      if (ok) ok = put_note(name, note);
    }
    if (database_.is_in_transaction()) {
      if (ok) ok = database_.run("COMMIT");
      if (!ok && database_.is_in_transaction()) (void)database_.run("ROLLBACK");
    }
    // The journal goes, too.
    if (auto removed = database_.run("PRAGMA journal_mode=DELETE"); ok) ok = removed;
    insert_.reset();
    database_.close();
    return ok;
  }

  Database database_;
  std::optional<Statement> insert_;
  std::optional<Error> failure_;
  bool is_closed_ = false;
  std::uint64_t messages_ = 0;
  WrittenFile open_, committed_;  // with and without the present transaction
  std::uint64_t open_bytes_ = 0, committed_bytes_ = 0;
};

}  // namespace

Result<std::unique_ptr<FileWriter>> create_sqlite(const std::filesystem::path& file, const BagOptions&) {
  auto database_result = Database::create(file);
  if (!database_result) return database_result.error();
  auto writer = std::make_unique<SqliteWriter>(std::move(*database_result));
  if (auto ok = writer->begin(); !ok) return ok.error();
  return std::unique_ptr<FileWriter>(std::move(writer));
}

}  // namespace jostle::bags
