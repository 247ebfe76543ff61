// Nothing of services/bags is used here: a fault of theirs would hide itself.

#include "tests/fuzz/bags/walker.hpp"

#include <lz4frame.h>
#include <sqlite3.h>
#include <zstd.h>

#include <cstring>
#include <optional>
#include <string_view>

namespace jostle::fuzz {
namespace {

constexpr std::size_t kHead = 9, kMagic = 8;
constexpr std::string_view kMagicBytes("\x89MCAP0\r\n", kMagic);

template <class T>
T number(std::string_view bytes, std::size_t at) {
  T value{};
  if (at + sizeof value <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// Nothing for a chunk that is not `size` bytes in the end.
std::optional<std::string> unpacked(std::string_view how, std::string_view stored, std::uint64_t size) {
  constexpr std::uint64_t kMost = 64 << 20;  // the largest chunk that is made here is far smaller
  if (how.empty()) return stored.size() == size ? std::optional(std::string(stored)) : std::nullopt;
  if (size > kMost) return {};
  std::string out(size, '\0');
  if (how == "zstd") {
    // An empty text may be no frames at all.
    const std::size_t got = ZSTD_decompress(out.data(), out.size(), stored.data(), stored.size());
    return ZSTD_isError(got) == 0 && got == size ? std::optional(out) : std::nullopt;
  }
  if (how != "lz4") return {};
  LZ4F_dctx* context = nullptr;
  LZ4F_createDecompressionContext(&context, LZ4F_VERSION);
  std::size_t filled = 0, left = 1;
  while (!stored.empty()) {
    std::size_t given = out.size() - filled, taken = stored.size();
    left = LZ4F_decompress(context, out.data() + filled, &given, stored.data(), &taken, nullptr);
    if (LZ4F_isError(left) != 0 || (given == 0 && taken == 0)) break;
    filled += given;
    stored.remove_prefix(taken);
  }
  const bool is_whole = LZ4F_isError(left) == 0 && left == 0 && stored.empty() && filled == size;
  LZ4F_freeDecompressionContext(context);
  return is_whole || (size == 0 && filled == 0 && stored.empty()) ? std::optional(out) : std::nullopt;
}

std::uint64_t messages_in(std::string_view records) {
  std::uint64_t messages = 0;
  while (records.size() >= kHead && records[0] != 0) {
    const auto size = number<std::uint64_t>(records, 1);
    if (size > records.size() - kHead) break;
    if (records[0] == 5) ++messages;
    records.remove_prefix(kHead + static_cast<std::size_t>(size));
  }
  return messages;
}

struct Chunk {
  bool fits = false;  // its parts are as long as its record
  std::optional<std::string> records;
};

Chunk chunk_of(std::string_view body) {
  constexpr std::size_t kFixed = 8 + 8 + 8 + 4;
  const auto name = number<std::uint32_t>(body, kFixed);
  const std::size_t head = kFixed + 4 + std::size_t{name} + 8;
  if (body.size() < kFixed + 4 + 8 || head > body.size() || name > 64) return {};
  const auto stored = number<std::uint64_t>(body, head - 8);
  if (stored != body.size() - head) return {};
  return {true, unpacked(body.substr(kFixed + 4, name), body.substr(head), number<std::uint64_t>(body, 16))};
}

// Sizes that records of the kinds have at least; kinds 3 to 5 may be of any.
bool is_of_its_size(int kind, std::uint64_t size) {
  switch (kind) {
    case 1:
    case 12:
      return size >= 8;
    case 2:
      return size == 20;
    case 6:
      return size >= 40;
    case 7:
      return size >= 6 && (size - 6) % 16 == 0;
    case 8:
      return size >= 64;
    case 9:
      return size >= 36;
    case 10:
      return size >= 48;
    case 11:
      return size >= 46;
    case 13:
      return size >= 20;
    case 14:
      return size == 17;
    case 15:
      return size == 4;
    default:
      return kind >= 3 && kind <= 5;
  }
}

}  // namespace

Met walk_mcap(const std::string& bytes) {
  Met met;
  const std::string_view file(bytes);
  if (!file.starts_with(kMagicBytes)) return {0, false};
  std::size_t at = kMagic;
  bool counts_by_index = false;
  while (at < file.size()) {
    const std::size_t left = file.size() - at;
    const int kind = static_cast<unsigned char>(file[at]);
    const auto size = number<std::uint64_t>(file, at + 1);
    if (left < kHead || size > left - kHead || !is_of_its_size(kind, size)) return {met.messages, false};
    const std::string_view body = file.substr(at + kHead, static_cast<std::size_t>(size));
    at += kHead + static_cast<std::size_t>(size);
    if (kind == 5) ++met.messages;
    if (kind == 6) {
      const Chunk chunk = chunk_of(body);
      if (!chunk.fits) return {met.messages, false};
      counts_by_index = !chunk.records;
      if (chunk.records) met.messages += messages_in(*chunk.records);
    }
    if (kind == 7 && counts_by_index && number<std::uint32_t>(body, 2) == size - 6) met.messages += (size - 6) / 16;
    if (kind != 2) continue;
    at += kMagic;
    if (at < file.size() && file.substr(at, kMagic) == kMagicBytes) at += kMagic;
  }
  return met;
}

Met count_database(const std::filesystem::path& file) {
  Met met{0, false};
  sqlite3* database = nullptr;
  if (sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READONLY, nullptr) == SQLITE_OK) {
    const auto first_number = [](void* to, int, char** values, char**) {
      *static_cast<std::string*>(to) = values[0] == nullptr ? "" : values[0];
      return 0;
    };
    std::string word, count;
    const bool is_sound =
        sqlite3_exec(database, "PRAGMA integrity_check(1)", first_number, &word, nullptr) == SQLITE_OK &&
        word == "ok" &&
        sqlite3_exec(database, "SELECT count(*) FROM messages", first_number, &count, nullptr) == SQLITE_OK;
    if (is_sound) met = {std::strtoull(count.c_str(), nullptr, 10), true};
  }
  sqlite3_close(database);
  return met;
}

}  // namespace jostle::fuzz
