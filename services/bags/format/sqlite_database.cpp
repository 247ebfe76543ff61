#include "services/bags/format/sqlite_database.hpp"

#include <fmt/format.h>

#include <array>
#include <fstream>

namespace jostle::bags {
namespace {

// What sqlite said last, as ours.
Error failure(const std::filesystem::path& file, sqlite3* database) {
  const int code = sqlite3_extended_errcode(database);
  const std::string what = sqlite3_errmsg(database);
  switch (code & 0xFF) {
    case SQLITE_CORRUPT:
      return {Code::kInvalidArgument,
              fmt::format("{}: damaged: {}; remedy: jostle bag recover saves what is readable", file.string(), what)};
    case SQLITE_NOTADB:
      return {Code::kInvalidArgument,
              fmt::format("{}: byte 0: got something else, wanted a database of sqlite3", file.string())};
    case SQLITE_ERROR:  // no such table, no such column
      return {Code::kInvalidArgument,
              fmt::format("{}: got another database, wanted a bag of rosbag2: {}", file.string(), what)};
    default:
      return {Code::kIo, fmt::format("{}: {}", file.string(), what)};
  }
}

// As the file's head says: 16 bits from byte 16 on, big-endian, where 1 stands for 64 KiB. 0 if it says nothing.
std::uint64_t page_size(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<unsigned char, 18> head{};
  if (!in.read(reinterpret_cast<char*>(head.data()), head.size())) return 0;
  const std::uint64_t size = std::uint64_t{head[16]} << 8 | head[17];
  return size == 1 ? 65536 : size;
}

}  // namespace

Result<bool> Statement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return failure(file_, sqlite3_db_handle(statement_.get()));
}

Result<void> Statement::run() {
  const auto stepped = step();
  // Resetting tells the same failure once more.
  reset();
  if (!stepped) return stepped.error();
  return {};
}

std::string Statement::text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  return text == nullptr ? ""
                         : std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column)));
}

std::span<const std::byte> Statement::bytes(int column) const {
  const auto* bytes = static_cast<const std::byte*>(sqlite3_column_blob(statement_.get(), column));
  return {bytes, bytes == nullptr ? 0 : static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

Result<Database> Database::connect(const std::filesystem::path& file, int flags) {
  Database database;
  database.file_ = file;
  sqlite3* raw = nullptr;
  const int code = sqlite3_open_v2(file.c_str(), &raw, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  database.database_.reset(raw);
  if (code != SQLITE_OK) return failure(file, raw);
  sqlite3_extended_result_codes(raw, 1);
  return database;
}

Result<Database> Database::create(const std::filesystem::path& file) {
  return connect(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
}

Result<Database> Database::open(const std::filesystem::path& file, bool recover) {
  std::error_code problem;
  if (!std::filesystem::exists(file, problem)) {
    return Error{Code::kNotFound, fmt::format("{}: cannot be opened: not there", file.string())};
  }
  if (std::filesystem::file_size(file, problem) == 0 && !problem) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: byte 0: the file is empty, wanted a database of sqlite3", file.string())};
  }
  // sqlite would fill a page that is cut in two up with zeros, and take them for data.
  const std::uint64_t size = std::filesystem::file_size(file, problem), page = page_size(file);
  if (page > 0 && size % page != 0) {
    return Error{Code::kInvalidArgument, fmt::format("{}: byte {}: cut off within a page of {} bytes; remedy: truncate "
                                                     "--size={} a copy of it, and jostle bag recover that",
                                                     file.string(), size, page, size / page * page)};
  }
  for (const int flags : {SQLITE_OPEN_READONLY, SQLITE_OPEN_READWRITE}) {
    auto database_result = connect(file, flags);
    if (!database_result) return database_result;
    sqlite3* raw = database_result->database_.get();
    // What a schema holds is somebody else's: no functions of it are called.
    sqlite3_exec(raw, "PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON", nullptr, nullptr, nullptr);
    // With this sqlite takes the pages that are there for all, where else it would refuse.
    if (recover) sqlite3_exec(raw, "PRAGMA writable_schema=ON", nullptr, nullptr, nullptr);
    if (sqlite3_exec(raw, "SELECT 1 FROM sqlite_master LIMIT 1", nullptr, nullptr, nullptr) == SQLITE_OK) {
      return database_result;
    }
    // A journal that must be rolled back wants to write.
    const int code = sqlite3_errcode(raw) & 0xFF;
    const bool may_help = code == SQLITE_READONLY || code == SQLITE_CANTOPEN;
    if (!may_help || flags == SQLITE_OPEN_READWRITE) return failure(file, raw);
  }
  return Error{Code::kInternal, "unreachable"};
}

Result<void> Database::run(const std::string& sql) {
  if (sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    return failure(file_, database_.get());
  }
  return {};
}

Result<Statement> Database::prepare(const std::string& sql) const {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(database_.get(), sql.c_str(), static_cast<int>(sql.size()), &raw, nullptr) != SQLITE_OK) {
    return failure(file_, database_.get());
  }
  return Statement(file_, raw);
}

Result<std::optional<std::string>> Database::value(const std::string& sql) const {
  auto statement_result = prepare(sql);
  if (!statement_result) return statement_result.error();
  auto row_result = statement_result->step();
  if (!row_result) return row_result.error();
  if (!*row_result) return std::optional<std::string>();
  return std::optional(statement_result->text(0));
}

bool Database::has_table(const std::string& name) const {
  const auto found = value(fmt::format("SELECT name FROM sqlite_master WHERE type = 'table' AND name = '{}'", name));
  return found && found.value();
}

bool Database::has_column(const std::string& table, const std::string& column) const {
  const auto found = value(fmt::format("SELECT name FROM pragma_table_info('{}') WHERE name = '{}'", table, column));
  return found && found.value();
}

}  // namespace jostle::bags
