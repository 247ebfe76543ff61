#include "tests/fuzz/bags/bags.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "services/bags/format/bag_writer.hpp"
#include "services/bags/format/compression.hpp"
#include "tests/support/mcap_builder.hpp"

namespace jostle::fuzz {
namespace {

namespace fs = std::filesystem;
namespace mcap = bags::mcap;
using tests::Bytes;
using tests::McapBuilder;
using tests::operator+;

constexpr std::uint64_t kBegin = 1'700'000'000'000'000'000;

std::string text_of(const Bytes& bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }
Bytes bytes_of(const std::string& text) {
  const auto view = std::as_bytes(std::span(text));
  return {view.begin(), view.end()};
}

std::string contents(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

Files files_of(const fs::path& folder) {
  Files files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    files.emplace_back(entry.path().filename(), contents(entry.path()));
  }
  std::ranges::sort(files);
  return files;
}

Files written(const fs::path& folder, const bags::BagOptions& options) {
  {
    const auto writer = tests::taken(bags::BagWriter::create(folder, options));
    const int map = tests::taken(writer->add_topic(tests::string_topic("/map", kLatched)));
    const int x = tests::taken(writer->add_topic(tests::string_topic("/x")));
    for (int i = 0; i < 12; ++i) {
      const auto time = static_cast<bags::Time>(kBegin) + i * 1'000'000;
      tests::taken(
          writer->write(i % 5 == 0 ? map : x,
                        {.log_time = time, .publish_time = time, .data = tests::cdr_of("text " + std::to_string(i))}));
      if (i % 4 == 3) tests::taken(writer->flush());
    }
    writer->set_note("record", {{"host", "here"}});
    tests::taken(writer->close());
  }
  return files_of(folder);
}

// Everything that other writers do and ours does not.
McapBuilder foreign() {
  using tests::channel_record;
  using tests::schema_record;
  McapBuilder bag;
  const auto sample = [](std::uint16_t channel, int step) {
    return McapBuilder::Sample{.channel = channel,
                               .time = kBegin + static_cast<std::uint64_t>(step) * 1'000'000,
                               .data = tests::cdr_of("text " + std::to_string(step))};
  };
  bag.note("n", {{"a", "1"}}).attach("photo", "three").note("n", {{"a", "2"}});
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0), sample(1, 1)}, "lz4");
  bag.chunk({schema_record(2, "a/msg/E", "ros2msg", ""), channel_record(2, 2, "/e")}, {}, "zstd");
  bag.chunk({schema_record(3, "a.Log", "jsonschema", "{}"), channel_record(3, 3, "/log", "json")},
            {sample(3, 2), sample(2, 3), sample(1, 2)}, "zstd");
  bag.chunk({schema_record(4, "std_msgs/msg/String", "ros2msg", "string data\nuint8 more\n"),
             channel_record(4, 4, "/x"), channel_record(5, 0, "/raw")},
            {sample(4, 5), sample(5, 4), sample(1, 6)});
  return bag;
}

// Records one after the other, as far as they go.
struct Range {
  std::size_t from = 0, to = 0;
  std::size_t size() const { return to - from; }
};
std::vector<Range> records_of(const std::string& bytes, std::size_t at) {
  std::vector<Range> records;
  while (at + 9 <= bytes.size()) {
    std::uint64_t size = 0;
    std::memcpy(&size, bytes.data() + at + 1, sizeof size);
    if (size > bytes.size() - at - 9) break;
    records.push_back({at, at + 9 + static_cast<std::size_t>(size)});
    at = records.back().to;
  }
  return records;
}

template <class T>
void put(std::string& bytes, std::size_t at, T value) {
  if (at + sizeof value <= bytes.size()) std::memcpy(bytes.data() + at, &value, sizeof value);
}

// Numbers that programs stumble over.
std::uint64_t awkward(Dice& dice) {
  switch (dice(8)) {
    case 0:
      return 0;
    case 1:
      return ~std::uint64_t{0};
    case 2:
      return std::uint64_t{1} << 63;
    case 3:
      return (std::uint64_t{1} << 63) - 1;
    case 4:
      return dice(64);
    case 5:
      return std::uint64_t{1} << dice(64);
    case 6:
      return 0xFFFF;
    default:
      return dice.any();
  }
}

std::string change_bytes(std::string& bytes, Dice& dice) {
  const std::size_t at = dice(bytes.size());
  switch (dice(6)) {
    case 0:
      for (std::size_t i = dice(8) + 1; i > 0 && !bytes.empty(); --i) {
        bytes[dice(bytes.size())] ^= static_cast<char>(1u << dice(8));
      }
      return "bits";
    case 1:
      bytes.resize(at);
      return "cut off";
    case 2:
      for (std::size_t i = at; i < std::min(bytes.size(), at + dice(64)); ++i) bytes[i] = static_cast<char>(dice.any());
      return "noise";
    case 3:
      bytes.erase(at, dice(200));
      return "bytes gone";
    case 4:
      bytes.insert(at, bytes.substr(dice(bytes.size()), dice(200)));
      return "bytes repeated";
    default:
      put(bytes, at, awkward(dice));
      return "a number";
  }
}

// One change of a row of records: order, kind, length, numbers.
void change_records(std::string& bytes, std::size_t begin, Dice& dice) {
  const auto records = records_of(bytes, begin);
  if (records.empty()) return;
  const Range one = records[dice(records.size())], other = records[dice(records.size())];
  const std::string text = bytes.substr(one.from, one.size());
  switch (dice(8)) {
    case 0:
      bytes.erase(one.from, one.size());
      break;
    case 1:
      bytes.insert(other.from, text);
      break;
    case 2: {  // one goes where the other is
      bytes.erase(one.from, one.size());
      bytes.insert(std::min(other.from, bytes.size()), text);
      break;
    }
    case 3:
      bytes[one.from] = static_cast<char>(dice(3) == 0 ? dice(256) : dice(16));
      break;
    case 4:
      put(bytes, one.from + 1, awkward(dice));
      break;
    case 5: {  // a length that is a little wrong
      std::uint64_t size = one.size() - 9;
      put(bytes, one.from + 1, size + dice(64) - 32);
      break;
    }
    case 6:
      put(bytes, one.from + 9 + dice(one.size()), static_cast<std::uint16_t>(dice(8)));
      break;
    default:
      put(bytes, one.from + 9 + dice(std::min<std::size_t>(one.size(), 24)), awkward(dice));
      break;
  }
}

// Changes what is in a chunk, and packs it again with a checksum and lengths that fit.
void change_chunk(std::string& bytes, Dice& dice) {
  std::vector<Range> chunks;
  for (const Range& record : records_of(bytes, 8)) {
    if (bytes[record.from] == static_cast<char>(mcap::Op::kChunk)) chunks.push_back(record);
  }
  if (chunks.empty()) return;
  const Range chunk = chunks[dice(chunks.size())];
  const Bytes body = bytes_of(bytes.substr(chunk.from + 9, chunk.size() - 9));
  auto head = mcap::parse_chunk(body);
  if (!head || head->stored > body.size()) return;
  const auto unpacked = bags::decompress(head->compression, mcap::View(body).last(head->stored), head->size);
  if (!unpacked) return;
  std::string records = text_of(*unpacked);
  for (std::size_t i = dice(3) + 1; i > 0; --i) {
    dice.one_in(4) ? void(change_bytes(records, dice)) : change_records(records, 0, dice);
  }
  const Bytes raw = bytes_of(records);
  constexpr std::array kWays{"", "lz4", "zstd"};
  head->compression = kWays.at(dice(kWays.size()));
  const Bytes stored = head->compression == "lz4"    ? tests::lz4_of(raw)
                       : head->compression == "zstd" ? tests::zstd_of(raw)
                                                     : raw;
  head->size = raw.size();
  head->stored = stored.size();
  head->crc = dice.one_in(8) ? 0 : bags::crc32_of(raw);
  Bytes record;
  mcap::append(record, *head);
  bytes.replace(chunk.from, chunk.size(), text_of(record + stored));
}

// Changes the summary, and makes its checksum right again.
void change_summary(std::string& bytes, Dice& dice) {
  constexpr std::size_t kTail = 29 + 8;
  if (bytes.size() < kTail) return;
  const std::size_t footer = bytes.size() - kTail;
  std::uint64_t start = 0;
  std::memcpy(&start, bytes.data() + footer + 9, sizeof start);
  if (start < 8 || start > footer) return;
  std::string summary = bytes.substr(static_cast<std::size_t>(start), footer - static_cast<std::size_t>(start));
  for (std::size_t i = dice(2) + 1; i > 0; --i) {
    dice.one_in(3) ? void(change_bytes(summary, dice)) : change_records(summary, 0, dice);
  }
  bytes.resize(static_cast<std::size_t>(start));
  Bytes end = bytes_of(summary);
  mcap::append_footer(end, start, dice.one_in(4) ? awkward(dice) : 0, bags::crc32_of(bytes_of(summary)));
  mcap::append_magic(end);
  bytes += text_of(end);
}

std::string change_mcap(std::string& bytes, Dice& dice) {
  switch (dice(5)) {
    case 0:
      return change_bytes(bytes, dice);
    case 1:
      change_records(bytes, 8, dice);
      return "records";
    case 2:
    case 3:
      change_chunk(bytes, dice);
      return "a chunk";
    default:
      change_summary(bytes, dice);
      return "the summary";
  }
}

std::string change_rows(std::string& bytes, Dice& dice, const fs::path& scratch) {
  constexpr std::array kChanges{
      "UPDATE messages SET topic_id = {0} WHERE id = {1}",
      "UPDATE messages SET timestamp = {0} WHERE id = {1}",
      "UPDATE messages SET timestamp = 'text' WHERE id = {1}",
      "UPDATE messages SET data = 'text' WHERE id = {1}",
      "UPDATE messages SET data = zeroblob({1}) WHERE id % 3 = 0",
      "DELETE FROM messages WHERE id = {1}",
      "DELETE FROM topics WHERE id = 1",
      "UPDATE topics SET id = {0}",
      "UPDATE topics SET serialization_format = 'json' WHERE id = 2",
      "UPDATE topics SET name = '', type = ''",
      "INSERT INTO topics SELECT id + 10, name, type, serialization_format, offered_qos_profiles FROM topics",
      "UPDATE schema SET schema_version = {1}",
      "DROP TABLE schema",
      "DROP TABLE topics",
      "DROP INDEX timestamp_idx",
      "INSERT INTO jostle_notes VALUES ('jostle.repeated', 'messages', '{0}')",
      "INSERT INTO messages SELECT id + {1}, topic_id, timestamp, data FROM messages",
      "CREATE TABLE message_definitions(topic_type, encoding, encoded_message_definition)"};
  const fs::path file = scratch / "rows.db3";
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
  const std::string sql =
      fmt::format(fmt::runtime(kChanges.at(dice(kChanges.size()))), static_cast<std::int64_t>(awkward(dice)), dice(16));
  sqlite3* database = nullptr;
  if (sqlite3_open(file.c_str(), &database) == SQLITE_OK) {
    sqlite3_exec(database, ("PRAGMA synchronous=OFF;" + sql).c_str(), nullptr, nullptr, nullptr);
  }
  sqlite3_close(database);
  bytes = contents(file);
  fs::remove(file);
  return sql;
}

std::string change_database(std::string& bytes, Dice& dice, const fs::path& scratch) {
  constexpr std::size_t kPage = 4096;
  switch (dice(5)) {
    case 0:
      return change_bytes(bytes, dice);
    case 1:
      bytes.resize(dice(bytes.size() / kPage + 1) * kPage);
      return "pages cut off";
    case 2: {
      const std::size_t at = dice(bytes.size() / kPage + 1) * kPage;
      for (std::size_t i = at; i < std::min(bytes.size(), at + kPage); ++i) bytes[i] = static_cast<char>(dice.any());
      return "a page of noise";
    }
    default:
      return change_rows(bytes, dice, scratch);
  }
}

std::string change_files(Files& bag, Dice& dice) {
  const std::size_t one = dice(bag.size()), other = dice(bag.size());
  switch (dice(4)) {
    case 0:
      bag.erase(bag.begin() + static_cast<std::ptrdiff_t>(one));
      return "a file gone";
    case 1:
      bag[one].second = bag[other].second;
      return "a file twice";
    case 2:
      bag[one].second += bag[other].second;
      return "a file behind another";
    default:
      // A name of its own, also where there is one more already.
      bag.emplace_back("more" + std::to_string(bag.size()) + fs::path(bag[one].first).extension().string(),
                       bag[one].second);
      return "a file more";
  }
}

}  // namespace

std::vector<Files> seed_bags(const fs::path& scratch) {
  using Storage = bags::BagOptions::Storage;
  std::vector<Files> seeds;
  constexpr std::chrono::nanoseconds kPart{4'000'000};
  int number = 0;
  for (const bags::BagOptions& options : {bags::BagOptions{.storage = Storage::kMcap},
                                          {.storage = Storage::kMcap, .compress = false, .split_time = kPart},
                                          {.storage = Storage::kSqlite},
                                          {.storage = Storage::kSqlite, .split_time = kPart}}) {
    Files bag = written(scratch / std::to_string(number++) / "bag", options);
    if (bag.size() > 2) seeds.push_back(bag);
    std::erase_if(bag, [](const auto& file) { return file.first == "metadata.yaml"; });
    bag.resize(1);
    seeds.push_back(std::move(bag));
  }
  seeds.push_back({{"other.mcap", text_of(foreign().end())}});
  seeds.push_back({{"unindexed.mcap", text_of(foreign().without_summary())}});
  McapBuilder loose;
  loose.loose({tests::schema_record(1), tests::channel_record(1, 1, "/x")},
              {{.channel = 1, .time = kBegin, .data = tests::cdr_of("a")},
               {.channel = 1, .time = kBegin + 1, .data = tests::cdr_of("b")}});
  seeds.push_back({{"loose.mcap", text_of(loose.end())}});
  return seeds;
}

std::string mutate(Files& bag, Dice& dice, const fs::path& scratch) {
  std::string done;
  for (std::size_t i = dice(3) + 1; i > 0; --i) {
    if (bag.empty()) break;
    done += done.empty() ? "" : ", ";
    if (bag.size() > 1 && dice.one_in(4)) {
      done += change_files(bag, dice);
      continue;
    }
    auto& [name, bytes] = bag[dice(bag.size())];
    if (name.ends_with(".mcap")) {
      done += change_mcap(bytes, dice);
    } else if (name.ends_with(".db3")) {
      done += change_database(bytes, dice, scratch);
    } else {
      done += change_bytes(bytes, dice);
    }
  }
  return done;
}

}  // namespace jostle::fuzz
