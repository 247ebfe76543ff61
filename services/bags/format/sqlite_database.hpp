#pragma once
/// \file
/// sqlite3 without its pointers.

#include <sqlite3.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"

namespace jostle::bags {

/// A prepared statement. Parameters count from 1, columns from 0.
class Statement {
 public:
  void bind(int parameter, std::int64_t value) { sqlite3_bind_int64(statement_.get(), parameter, value); }
  /// Texts and bytes are not copied: they must stay where they are until the statement is reset.
  void bind(int parameter, std::string_view text) {
    sqlite3_bind_text64(statement_.get(), parameter, text.data() == nullptr ? "" : text.data(), text.size(),
                        SQLITE_STATIC, SQLITE_UTF8);
  }
  void bind(int parameter, std::span<const std::byte> bytes) {
    sqlite3_bind_blob64(statement_.get(), parameter,
                        bytes.data() == nullptr ? "" : static_cast<const void*>(bytes.data()), bytes.size(),
                        SQLITE_STATIC);
  }

  /// Whether there is a (further) row.
  Result<bool> step();
  /// Runs a statement that gives no rows.
  Result<void> run();
  void reset() { sqlite3_reset(statement_.get()); }

  bool is_integer(int column) const { return sqlite3_column_type(statement_.get(), column) == SQLITE_INTEGER; }
  /// Texts are bytes, too.
  bool is_bytes(int column) const {
    const int type = sqlite3_column_type(statement_.get(), column);
    return type == SQLITE_BLOB || type == SQLITE_TEXT;
  }
  std::int64_t number(int column) const { return sqlite3_column_int64(statement_.get(), column); }
  std::string text(int column) const;
  /// Valid until the next step.
  std::span<const std::byte> bytes(int column) const;

 private:
  friend class Database;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  Statement(std::filesystem::path file, sqlite3_stmt* statement) : file_(std::move(file)), statement_(statement) {}

  std::filesystem::path file_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

class Database {
 public:
  /// Creates a new database, to be written.
  static Result<Database> create(const std::filesystem::path& file);
  /// Opens a database that is there. Rolls back what a killed writer has left half done, as every program
  /// that opens it does. One with a journal of writes (WAL) in a folder that cannot be written to is opened if that
  /// journal has nothing that the database lacks. `recover`: also opens one whose last pages are missing;
  /// if a page is cut in two, a copy without it.
  static Result<Database> open(const std::filesystem::path& file, bool recover);

  Result<void> run(const std::string& sql);
  Result<Statement> prepare(const std::string& sql) const;
  /// The first column of the first row, if there is a row.
  Result<std::optional<std::string>> value(const std::string& sql) const;
  bool has_table(const std::string& name) const;
  bool has_column(const std::string& table, const std::string& column) const;
  bool is_in_transaction() const { return sqlite3_get_autocommit(database_.get()) == 0; }

  /// Statements must be gone by then.
  void close() { database_.reset(); }

  const std::filesystem::path& path() const { return file_; }
  bool was_cut() const { return was_cut_; }  ///< within a page, which is left out

 private:
  struct Close {
    void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
  };
  static Result<Database> open_as_it_is(const std::filesystem::path& file, bool recover);
  static Result<Database> open_whole_pages(const std::filesystem::path& file, std::uint64_t size);
  static Result<Database> connect(const std::filesystem::path& file, int flags, bool is_whole);

  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> database_;
  bool was_cut_ = false;
};

}  // namespace jostle::bags
