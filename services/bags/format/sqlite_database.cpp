#include "services/bags/format/sqlite_database.hpp"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <fstream>
#include <optional>

#include "services/common/process/files.hpp"

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

struct Pages {
  std::uint64_t size = 0, count = 0;
};

// As the file's head says, big-endian: 16 bits from byte 16 on, where 1 stands for 64 KiB, and 32 bits from byte 28 on.
// 0 if it says nothing.
Pages pages_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<unsigned char, 32> head{};
  if (!in.read(reinterpret_cast<char*>(head.data()), head.size())) return {};
  const std::uint64_t size = std::uint64_t{head[16]} << 8 | head[17];
  std::uint64_t count = 0;
  for (std::size_t i = 28; i < 32; ++i) count = count << 8 | head.at(i);
  return {size == 1 ? 65536 : size, count};
}

// A name by which sqlite reads a file as it is, without a look at journals.
std::string immutable_uri(const std::filesystem::path& file) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(file).string()) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '/' || c == '.' || c == '_';
    uri += is_plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return uri + "?immutable=1";
}

constexpr std::array kJournals{"-wal", "-journal"};

// Whether a journal beside a file holds what the file lacks.
bool has_journal(const std::filesystem::path& file) {
  for (const char* ending : kJournals) {
    std::error_code problem;
    const auto size = std::filesystem::file_size(file.string() + ending, problem);
    if (!problem && size > 0) return true;
  }
  return false;
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

Result<Database> Database::connect(const std::filesystem::path& file, int flags, bool is_whole) {
  Database database;
  database.file_ = file;
  sqlite3* raw = nullptr;
  const std::string name = is_whole ? immutable_uri(file) : file.string();
  const int code =
      sqlite3_open_v2(name.c_str(), &raw, flags | SQLITE_OPEN_NOMUTEX | (is_whole ? SQLITE_OPEN_URI : 0), nullptr);
  database.database_.reset(raw);
  if (code != SQLITE_OK) return failure(file, raw);
  sqlite3_extended_result_codes(raw, 1);
  return database;
}

Result<Database> Database::create(const std::filesystem::path& file) {
  return connect(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, false);
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
  // What lies behind the last page is no loss.
  const std::uint64_t size = std::filesystem::file_size(file, problem);
  const auto [page, count] = pages_of(file);
  const bool is_cut = page > 0 && size % page != 0 && (count == 0 || size < count * page);
  if (!is_cut) return open_as_it_is(file, recover);
  if (recover) return open_whole_pages(file, size / page * page);
  return Error{Code::kInvalidArgument, fmt::format("{}: byte {}: cut off within a page of {} bytes; remedy: jostle bag "
                                                   "recover saves what is readable",
                                                   file.string(), size, page)};
}

// A copy without the half page, which lives as long as it is open; journals beside it come along.
Result<Database> Database::open_whole_pages(const std::filesystem::path& file, std::uint64_t size) {
  auto folder_result = common::make_temporary_folder("bag");
  if (!folder_result) return folder_result.error();
  const std::filesystem::path copy = *folder_result / "copy.db3";
  std::error_code problem, ignored;
  std::filesystem::copy_file(file, copy, problem);
  if (!problem) std::filesystem::resize_file(copy, size, problem);
  for (const char* ending : kJournals) {
    std::filesystem::copy_file(file.string() + ending, copy.string() + ending, ignored);
  }
  Result<Database> database_result =
      problem ? Error{Code::kIo, fmt::format("{}: a copy of it for recovering: {}", file.string(), problem.message())}
              : open_as_it_is(copy, true);
  std::filesystem::remove_all(*folder_result, ignored);
  if (!database_result) return database_result;
  database_result->file_ = file;
  database_result->was_cut_ = true;
  return database_result;
}

Result<Database> Database::open_as_it_is(const std::filesystem::path& file, bool recover) {
  struct Way {
    int flags;
    bool is_whole;
  };
  // A journal that must be rolled back wants to write; without one there is nothing to wait for.
  constexpr std::array kWays{Way{SQLITE_OPEN_READONLY, false}, Way{SQLITE_OPEN_READWRITE, false},
                             Way{SQLITE_OPEN_READONLY, true}};
  std::optional<Error> trouble;
  for (const Way& way : kWays) {
    if (way.is_whole && has_journal(file)) break;
    auto database_result = connect(file, way.flags, way.is_whole);
    if (!database_result) return database_result;
    sqlite3* raw = database_result->database_.get();
    // What a schema holds is somebody else's: no functions of it are called.
    sqlite3_exec(raw, "PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON", nullptr, nullptr, nullptr);
    // With this sqlite takes the pages that are there for all, where else it would refuse.
    if (recover) sqlite3_exec(raw, "PRAGMA writable_schema=ON", nullptr, nullptr, nullptr);
    if (sqlite3_exec(raw, "SELECT 1 FROM sqlite_master LIMIT 1", nullptr, nullptr, nullptr) == SQLITE_OK) {
      return database_result;
    }
    trouble = failure(file, raw);
    const int code = sqlite3_errcode(raw) & 0xFF;
    if (code != SQLITE_READONLY && code != SQLITE_CANTOPEN) return *trouble;
  }
  trouble->message +=
      "; a journal beside it must be worked off first; remedy: copy both to a folder that you may "
      "write to";
  return *trouble;
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
