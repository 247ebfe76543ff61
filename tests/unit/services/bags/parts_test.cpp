// Every part of a bag is judged on its own: kept where it can be, counted and named where not.

#include <gmock/gmock.h>
#include <sqlite3.h>
#include <unistd.h>

#include <fstream>
#include <functional>

#include "services/bags/format/findings.hpp"
#include "services/bags/format/folder_reader.hpp"
#include "tests/support/mcap_builder.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
namespace mcap = bags::mcap;
using bags::Findings;
using bags::Part;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

constexpr std::uint64_t kBegin = 1'700'000'000'000'000'000, kStep = 100'000'000;

McapBuilder::Sample sample(std::uint16_t channel, int step, const std::string& text) {
  return {.channel = channel, .time = kBegin + static_cast<std::uint64_t>(step) * kStep, .data = cdr_of(text)};
}

// What a reader makes of a file.
struct Seen {
  std::vector<std::string> topics;  // one per name and type, with how many messages it says it has
  std::vector<std::string> texts;
  std::vector<std::string> findings;
  std::uint64_t lost = 0;  // messages
  double duration = 0.0;   // s
};

class Parts : public ::testing::Test {
 protected:
  fs::path save(const Bytes& bytes, const std::string& name = "bag.mcap") const {
    return folder_.write(name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }

  static Seen see(const fs::path& bag, bool recover) {
    const auto reader = taken(bags::open_bag(bag, recover));
    Seen seen{.texts = texts_of(rest_of(*reader))};
    for (const auto& topic : reader->info().topics) {
      seen.topics.push_back(topic.topic.name + " " + std::to_string(topic.messages));
    }
    Findings findings;
    findings.add_all(reader->findings());
    for (const auto& finding : findings.list()) seen.findings.push_back(finding.text());
    seen.lost = findings.count_lost(Part::kMessage);
    seen.duration = 1e-9 * static_cast<double>(reader->info().end - reader->info().start);
    return seen;
  }
  Seen read(const Bytes& bytes) const { return see(save(bytes), false); }
  Seen recover(const Bytes& bytes) const { return see(save(bytes), true); }

  // What differs, as texts.
  static std::vector<std::string> verify(const fs::path& bag) {
    const auto reader = taken(bags::open_bag(bag, false));
    std::vector<std::string> texts;
    const auto found_result = reader->verify({});
    if (!found_result) return {found_result.error().message};
    for (const auto& finding : *found_result) texts.push_back(finding.text());
    return texts;
  }
  std::vector<std::string> verify(const Bytes& bytes) const { return verify(save(bytes)); }

  TempFolder folder_;
};

using McapParts = Parts;

TEST_F(McapParts, SummariesThatDoNotSayAllAreNoReasonToMissMessages) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0, "a"), sample(1, 1, "b")}, "zstd");
  for (const McapBuilder::End& end : {McapBuilder::End{.definitions = false, .lie = {}},
                                      {.statistics = false, .lie = {}},
                                      {.chunk_indexes = false, .lie = {}},
                                      {.lie = [](auto& said) { said.channel_messages.clear(); }}}) {
    const Seen seen = read(bag.end(end));
    EXPECT_THAT(seen.topics, ElementsAre("/x 2"));
    EXPECT_THAT(seen.texts, ElementsAre("a", "b"));
  }
  EXPECT_THAT(verify(bag.end({.definitions = false, .lie = {}})), IsEmpty());
  EXPECT_THAT(verify(bag.end()), IsEmpty());
}

TEST_F(McapParts, ChunksWithoutMessageIndexesAndMessagesOutsideOfChunksAreRead) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0, "a")}, "lz4", false);
  bag.loose({}, {sample(1, 1, "loose")});
  bag.chunk({}, {sample(1, 2, "c")});
  const Bytes whole = bag.end();
  for (const Seen& seen : {read(whole), recover(whole), recover(bag.bytes)}) {
    EXPECT_THAT(seen.texts, ElementsAre("a", "loose", "c"));
  }
  EXPECT_THAT(verify(whole), IsEmpty());
}

TEST_F(McapParts, AChunkOfDefinitionsAloneHasNoTime) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {});
  bag.chunk({}, {sample(1, 0, "a"), sample(1, 1, "b")});
  for (const Bytes& bytes : {bag.end(), bag.without_summary()}) {
    EXPECT_NEAR(read(bytes).duration, 0.1, 1e-9);
    EXPECT_NEAR(recover(bytes).duration, 0.1, 1e-9);
  }
}

TEST_F(McapParts, ATopicInAnotherEncodingIsKeptAsItIs) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x"), schema_record(2, "a.Log", "jsonschema", "{}"),
             channel_record(2, 2, "/log", "json")},
            {sample(1, 0, "a"), {.channel = 2, .time = kBegin, .data = Bytes(2, std::byte{'{'})}});
  const auto reader = taken(bags::open_bag(save(bag.end()), false));
  const auto& topics = reader->info().topics;
  ASSERT_EQ(topics.size(), 2u);
  EXPECT_EQ(topics[0].topic.encoding, "json");
  EXPECT_EQ(topics[0].topic.schema, "jsonschema");
  EXPECT_FALSE(topics[0].topic.has_message_definition());
  // And written as it is.
  const fs::path copy = folder_.path() / "copy";
  const auto writer = taken(bags::BagWriter::create(copy, {}));
  for (const auto& topic : topics) taken(writer->add_topic(topic.topic));
  for (const auto& message : rest_of(*reader)) taken(writer->write(message.topic, message.view()));
  taken(writer->close());
  const auto back = taken(bags::open_bag(copy, false));
  EXPECT_EQ(back->info().topics[0].topic, topics[0].topic);
  EXPECT_EQ(rest_of(*back).size(), 2u);
}

TEST_F(McapParts, ANumberThatIsGivenAgainMeansTheLatterFromThereOn) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/a")}, {sample(1, 0, "of a")});
  bag.chunk({schema_record(1), channel_record(1, 1, "/b")}, {sample(1, 1, "of b")});
  for (const Seen& seen : {read(bag.without_summary()), recover(bag.without_summary()), recover(bag.end())}) {
    EXPECT_THAT(seen.topics, UnorderedElementsAre("/a 1", "/b 1"));
    EXPECT_THAT(seen.texts, ElementsAre("of a", "of b"));
    EXPECT_THAT(seen.findings, Contains(HasSubstr("channel 1: got /b, wanted /a as before")));
  }
  EXPECT_THAT(verify(bag.without_summary()), Contains(HasSubstr("channel 1: got /b, wanted /a as before")));
  McapBuilder types;
  types.chunk({schema_record(1), channel_record(1, 1, "/a")}, {sample(1, 0, "text")});
  types.chunk({schema_record(1, "std_msgs/msg/Int8", "ros2msg", "int8 data"), channel_record(1, 1, "/a")},
              {sample(1, 1, "number")});
  EXPECT_THAT(read(types.without_summary()).topics, ElementsAre("/a 1", "/a 1"));
  EXPECT_THAT(read(types.without_summary()).findings, Contains(HasSubstr("schema: ")));
}

TEST_F(McapParts, TwoFilesInOneAreBothRead) {
  McapBuilder first, second;
  first.chunk({schema_record(1), channel_record(1, 1, "/a")}, {sample(1, 0, "first")});
  second.chunk({schema_record(1), channel_record(1, 1, "/b")}, {sample(1, 1, "second")});
  const Seen seen = recover(first.end() + second.end());
  EXPECT_THAT(seen.texts, ElementsAre("first", "second"));
  EXPECT_THAT(seen.topics, UnorderedElementsAre("/a 1", "/b 1"));
  EXPECT_THAT(seen.findings, Contains(HasSubstr("another file follows")));
}

TEST_F(McapParts, TwoDefinitionsOfATypeAreTwoTopics) {
  McapBuilder bag;
  bag.chunk({schema_record(1, "a/msg/P", "ros2msg", "float64 x"), schema_record(2, "a/msg/P", "ros2msg", "string y"),
             channel_record(1, 1, "/p"), channel_record(2, 2, "/p")},
            {sample(1, 0, "a"), sample(2, 1, "b")});
  EXPECT_THAT(read(bag.end()).topics, ElementsAre("/p 1", "/p 1"));
  EXPECT_THAT(verify(bag.end()), IsEmpty());
}

TEST_F(McapParts, AChannelWithoutItsSchemaHasAnUnknownType) {
  McapBuilder bag;
  bag.chunk({channel_record(1, 7, "/x"), channel_record(2, 0, "/y")}, {sample(1, 0, "a"), sample(2, 1, "b")});
  for (const Seen& seen : {read(bag.end()), recover(bag.bytes)}) {
    EXPECT_THAT(seen.texts, ElementsAre("a", "b"));
    EXPECT_THAT(seen.findings, Contains(HasSubstr("/x: got schema 7, wanted one that the file has")));
  }
}

TEST_F(McapParts, OneBadMessageCostsNoOther) {
  constexpr std::uint64_t kNever = ~std::uint64_t{0};
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")},
            {sample(1, 0, "a"),
             {.channel = 1, .time = kNever, .data = cdr_of("of no time")},
             sample(1, 1, "b"),
             sample(9, 2, "of no channel"),
             sample(1, 3, "c")},
            "zstd");
  for (const Bytes& bytes : {bag.end(), bag.without_summary()}) {
    for (const Seen& seen : {read(bytes), recover(bytes)}) {
      EXPECT_THAT(seen.texts, ElementsAre("a", "b", "c"));
      EXPECT_EQ(seen.lost, 2u);
      EXPECT_THAT(seen.findings, Contains(AllOf(HasSubstr("/x: got a log time behind the year 2262"))));
      EXPECT_THAT(seen.findings, Contains(HasSubstr("got channel 9, wanted one that the file has")));
    }
    EXPECT_NEAR(read(bytes).duration, 0.3, 1e-9);
    EXPECT_THAT(verify(bytes), Contains(HasSubstr("channel 9")));
  }
}

TEST_F(McapParts, TimesOfZeroAndTimesThatFallAreTimes) {
  McapBuilder bag;
  bag.chunk(
      {schema_record(1), channel_record(1, 1, "/x")},
      {sample(1, 5, "late"), {.channel = 1, .time = 0, .data = cdr_of("before the clock")}, sample(1, 4, "early")});
  EXPECT_THAT(read(bag.end()).texts, ElementsAre("before the clock", "early", "late"));
  EXPECT_THAT(verify(bag.end()), IsEmpty());
}

TEST_F(McapParts, RecordsOfUnknownKindsArePassedOverAndSaid) {
  Bytes unknown;
  mcap::Appender(unknown).record(static_cast<mcap::Op>(0x81), [&] { mcap::Appender(unknown).text("private"); });
  McapBuilder bag;
  bag.raw(unknown).chunk({schema_record(1), channel_record(1, 1, "/x"), unknown}, {sample(1, 0, "a")});
  for (const Seen& seen : {read(bag.without_summary()), recover(bag.without_summary())}) {
    EXPECT_THAT(seen.texts, ElementsAre("a"));
    EXPECT_THAT(seen.findings, Contains(HasSubstr("1 unknown record lost")));
  }
}

TEST_F(McapParts, MessagesOfChunksThatCannotBeReadAreCounted) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0, "a")});
  const std::size_t begin = bag.bytes.size();
  bag.chunk({}, {sample(1, 1, "b"), sample(1, 2, "c")}, "zstd");
  const std::size_t middle = bag.bytes.size();
  bag.chunk({}, {sample(1, 3, "d"), sample(1, 4, "e"), sample(1, 5, "f")});
  bag.chunk({}, {sample(1, 6, "g")}, "lz4");
  Bytes damaged = bag.end();
  damaged[begin + 9 + mcap::chunk_head_size("zstd") + 2] ^= std::byte{0xFF};        // of zstd's frame
  damaged[middle + 9 + mcap::chunk_head_size("") + 31 + 8 + 1] ^= std::byte{0xFF};  // of a text
  const Seen seen = recover(damaged);
  EXPECT_THAT(seen.texts, ElementsAre("a", "g"));
  EXPECT_EQ(seen.lost, 5u);
  EXPECT_THAT(seen.findings, Contains(HasSubstr("cannot be decompressed")));
  EXPECT_THAT(seen.findings, Contains(HasSubstr("checksum")));
}

TEST_F(McapParts, ALengthThatIsWrongCostsNothingBehindIt) {
  for (const std::uint64_t length : {std::uint64_t{3}, std::uint64_t{200}, ~std::uint64_t{0}}) {
    McapBuilder bag;
    bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0, "a")});
    const std::size_t second = bag.bytes.size();
    bag.chunk({}, {sample(1, 1, "b")});
    bag.chunk({}, {sample(1, 2, "c")});
    bag.loose({}, {sample(1, 3, "d"), sample(1, 4, "e")});
    Bytes damaged = bag.without_summary();
    std::memcpy(damaged.data() + second + 1, &length, sizeof length);
    const Seen seen = recover(damaged);
    EXPECT_THAT(seen.texts, AllOf(Contains("a"), Contains("c"), Contains("d"), Contains("e"))) << length;
    EXPECT_THAT(seen.findings, Not(IsEmpty())) << length;
    std::memset(damaged.data() + second + 9 + 32, 0xFF, 8);  // and the other length
    EXPECT_THAT(recover(damaged).texts, ElementsAre("a", "c", "d", "e")) << length;
    EXPECT_THAT(recover(damaged).findings, Contains(HasSubstr("bytes passed over"))) << length;
  }
}

TEST_F(McapParts, ADamagedBeginningCostsNoMessage) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0, "a")});
  Bytes damaged = bag.end();
  damaged[0] ^= std::byte{1};
  EXPECT_THAT(recover(damaged).texts, ElementsAre("a"));
  EXPECT_FALSE(bags::open_bag(folder_.write("other.mcap", "These are no messages."), true));
}

TEST_F(McapParts, VerifyComparesWhatASummarySaysWithWhatIsThere) {
  McapBuilder bag;
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0, "a"), sample(1, 1, "b")});
  bag.attach("photo", "...").note("n", {{"k", "v"}});
  EXPECT_THAT(verify(bag.end()), IsEmpty());
  const auto lies = [&](const std::function<void(mcap::Statistics&)>& lie) { return verify(bag.end({.lie = lie})); };
  EXPECT_THAT(lies([](auto& said) { said.messages = 3; }), Contains(HasSubstr("messages: got 2, wanted 3")));
  EXPECT_THAT(lies([](auto& said) { said.messages = said.channel_messages[1] = 1; }),
              Contains(HasSubstr("topic /x: messages: got 2, wanted 1")));
  EXPECT_THAT(lies([](auto& said) { said.chunks = 2; }), Contains(HasSubstr("chunks: got 1, wanted 2")));
  EXPECT_THAT(lies([](auto& said) { said.channels = 2; }), Contains(HasSubstr("channels: got 1, wanted 2")));
  EXPECT_THAT(lies([](auto& said) { said.attachments = 0; }), Contains(HasSubstr("attachments: got 1, wanted 0")));
  EXPECT_THAT(lies([](auto& said) { said.start = 0; }), Contains(HasSubstr("log times: got 1700000000000000000")));
  McapBuilder wrong = bag;
  wrong.notes[0].name = "other";
  EXPECT_THAT(verify(wrong.end()), Contains(HasSubstr("'other': the index tells of byte")));
  // An index that hides a chunk, with statistics that fit it.
  McapBuilder hidden = bag;
  hidden.chunk({}, {sample(1, 2, "c")});
  hidden.chunk_indexes.pop_back();
  const Bytes bytes = hidden.end({.lie = [](auto& said) { said.messages = said.channel_messages[1] = 2; }});
  EXPECT_THAT(verify(bytes), Contains(HasSubstr("chunk index: got none for 1 chunks")));
}

TEST_F(McapParts, AttachmentsAndEveryNoteAreRead) {
  McapBuilder bag;
  bag.attach("photo", "one").note("n", {{"a", "1"}}).note("n", {{"a", "2"}}).note("n", {{"a", "2"}});
  bag.chunk({schema_record(1), channel_record(1, 1, "/x")}, {sample(1, 0, "a")});
  for (const bool recovers : {false, true}) {
    const auto reader = taken(bags::open_bag(save(recovers ? bag.bytes : bag.end()), recovers));
    ASSERT_EQ(reader->info().attachments.size(), 1u);
    EXPECT_EQ(reader->info().attachments[0].name, "photo");
    const auto attachment = taken(reader->attachment(0));
    EXPECT_EQ(attachment.data.size(), 3u);
    EXPECT_EQ(attachment.create_time, 2);
    EXPECT_EQ(reader->info().notes.at("n").at("a"), "2");
    ASSERT_EQ(reader->info().earlier_notes.size(), 1u);
    EXPECT_EQ(reader->info().earlier_notes[0].second.at("a"), "1");
  }
  Bytes damaged = bag.bytes;
  const std::size_t at = static_cast<std::size_t>(bag.attachments[0].offset + bag.attachments[0].length) - 5;
  damaged[at] ^= std::byte{1};
  EXPECT_THAT(recover(damaged).findings, Contains(HasSubstr("1 attachment lost")));
}

class DatabaseParts : public Parts {
 protected:
  // A bag of rosbag2's second version, and what `sql` does to it.
  fs::path database(const std::string& sql, const std::string& name = "bag.db3") const {
    const fs::path file = folder_.path() / name;
    sqlite3* raw = nullptr;
    EXPECT_EQ(sqlite3_open(file.c_str(), &raw), SQLITE_OK);
    const std::string text = std::string(
                                 "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
                                 "serialization_format TEXT "
                                 "NOT NULL, offered_qos_profiles TEXT NOT NULL);"
                                 "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data);"
                                 "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
                                 "INSERT INTO topics VALUES (1, '/x', 'std_msgs/msg/String', 'cdr', '');"
                                 "INSERT INTO messages VALUES (1, 1, 1700000000000000000, x'00010000020000006100'),"
                                 " (2, 1, 1700000000100000000, x'00010000020000006200');") +
                             sql;
    EXPECT_EQ(sqlite3_exec(raw, text.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(raw);
    sqlite3_close(raw);
    return file;
  }
};

TEST_F(DatabaseParts, OneBadRowCostsNoOther) {
  const fs::path file = database(
      "INSERT INTO messages VALUES (3, 7, 1700000000200000000, x'00'), (4, 1, -5, x'00'), (5, 1, NULL, x'00'), "
      "(6, 1, 1700000000300000000, NULL), (7, 1, 'noon', x'00'), (8, 1, 1700000000400000000, "
      "x'00010000020000006300');");
  for (const bool recovers : {false, true}) {
    const Seen seen = see(file, recovers);
    EXPECT_THAT(seen.texts, ElementsAre("a", "b", "c"));
    EXPECT_THAT(seen.topics, ElementsAre("/x 3"));
    EXPECT_EQ(seen.lost, 5u);
    EXPECT_THAT(seen.findings, Contains(HasSubstr("got topic 7, wanted one that the file has")));
    EXPECT_NEAR(seen.duration, 0.4, 1e-9);
  }
  EXPECT_THAT(verify(file), Contains(HasSubstr("4 messages lost")));
}

TEST_F(DatabaseParts, TopicsInOtherEncodingsAndUnderTwoNumbersAreRead) {
  const fs::path file = database(
      "INSERT INTO topics VALUES (2, '/log', 'a.Log', 'json', ''), (3, '/x', 'std_msgs/msg/String', 'cdr', '');"
      "INSERT INTO messages VALUES (3, 2, 1700000000200000000, x'7b7d'), "
      "(4, 3, 1700000000300000000, x'00010000020000006300');");
  const auto reader = taken(bags::open_bag(file, false));
  EXPECT_EQ(reader->info().topics[0].topic.encoding, "json");
  EXPECT_EQ(reader->info().topics[1].messages, 3u);
  EXPECT_EQ(rest_of(*reader).size(), 4u);
  EXPECT_EQ(text_of(taken(reader->last_at(1, bags::Time{1'700'000'000'500'000'000}))->data), "c");
}

TEST_F(DatabaseParts, DamagedPagesCostNothingBehindThem) {
  const fs::path file = database(
      "WITH RECURSIVE n(i) AS (SELECT 3 UNION ALL SELECT i + 1 FROM n WHERE i < 5000) INSERT INTO messages SELECT i, "
      "1, "
      "1700000000000000000 + i, x'0001000002000000' || zeroblob(100) FROM n;"
      "UPDATE messages SET data = CAST(data AS BLOB);");
  const std::uint64_t page = 4096, pages = fs::file_size(file) / page;
  std::fstream(file, std::ios::in | std::ios::out | std::ios::binary)
      .seekp(static_cast<std::streamoff>(pages / 2 * page))
      .write(std::string(page, '\xAA').data(), static_cast<std::streamsize>(page));
  const auto reader = taken(bags::open_bag(file, true));
  std::uint64_t taken_ones = 0;
  bags::Time last = 0;
  while (auto message = taken(reader->next())) {
    ++taken_ones;
    last = std::max(last, message->log_time);
  }
  Findings findings;
  findings.add_all(reader->findings());
  EXPECT_EQ(taken_ones + findings.count_lost(Part::kMessage), 5000u);
  EXPECT_GT(taken_ones, 4900u);
  EXPECT_EQ(taken_ones, reader->info().messages);
  EXPECT_EQ(last, 1'700'000'000'100'000'000);
}

TEST_F(DatabaseParts, AJournalOfWritesIsNoHindranceWhereNothingCanBeWritten) {
  const fs::path file = database(
      "PRAGMA journal_mode=WAL; INSERT INTO messages VALUES (3, 1, 1700000000200000000, "
      "x'00010000020000006300');",
      "a %20b?.db3");
  EXPECT_FALSE(fs::exists(file.string() + "-wal"));
  fs::permissions(folder_.path(), fs::perms::owner_read | fs::perms::owner_exec | fs::perms::group_read |
                                      fs::perms::group_exec | fs::perms::others_read | fs::perms::others_exec);
  constexpr uid_t kNobody = 65534;
  const bool is_root = geteuid() == 0;  // whom no permissions hinder
  ASSERT_EQ(is_root ? seteuid(kNobody) : 0, 0);
  const Seen seen = see(file, false);
  ASSERT_EQ(is_root ? seteuid(0) : 0, 0);
  fs::permissions(folder_.path(), fs::perms::owner_all);
  EXPECT_THAT(seen.texts, ElementsAre("a", "b", "c"));
}

class FolderParts : public Parts {
 protected:
  void SetUp() override {
    const auto writer = taken(bags::BagWriter::create(bag_, {.split_time = std::chrono::nanoseconds(1)}));
    const int topic = taken(writer->add_topic(string_topic("/x")));
    for (int i = 0; i < 3; ++i) {
      taken(writer->write(topic, {.log_time = bags::Time{1000} + i, .data = cdr_of(std::to_string(i))}));
    }
    taken(writer->close());
    metadata_ = contents(bag_ / "metadata.yaml");
  }
  void change_metadata(const std::string& what, const std::string& with) const {
    std::string changed = metadata_;
    for (std::size_t at = 0; (at = changed.find(what, at)) != std::string::npos; at += with.size()) {
      changed.replace(at, what.size(), with);
    }
    std::ofstream(bag_ / "metadata.yaml") << changed;
  }

  const fs::path bag_ = folder_.path() / "b";
  std::string metadata_;
};

TEST_F(FolderParts, AFileThatIsNotListedIsSaidAndRecovered) {
  change_metadata("    - b_2.mcap\n", "");
  EXPECT_THAT(see(bag_, false).texts, ElementsAre("0", "1"));
  EXPECT_THAT(see(bag_, false).findings,
              Contains(AllOf(HasSubstr("b_2.mcap: metadata.yaml does not list it"), HasSubstr("jostle bag recover"))));
  EXPECT_THAT(verify(bag_), Contains(HasSubstr("1 file lost")));
  EXPECT_THAT(see(bag_, true).texts, ElementsAre("0", "1", "2"));
}

TEST_F(FolderParts, AFileThatIsListedTwiceIsReadOnce) {
  change_metadata("    - b_1.mcap\n", "    - b_1.mcap\n    - ./b_1.mcap\n");
  EXPECT_THAT(see(bag_, false).texts, ElementsAre("0", "1", "2"));
  EXPECT_THAT(verify(bag_), Contains(HasSubstr("lists it twice")));
}

TEST_F(FolderParts, AFileOutsideOfTheFolderIsNotRead) {
  folder_.write("b_9.mcap", "");
  change_metadata("    - b_1.mcap\n", "    - ../b_9.mcap\n");
  EXPECT_THAT(bags::open_bag(bag_, false).error().message,
              AllOf(HasSubstr("got ../b_9.mcap, wanted a file in the folder"), HasSubstr("remedy")));
  EXPECT_THAT(see(bag_, true).texts, ElementsAre("0", "1", "2"));
}

TEST_F(FolderParts, AMissingOrDamagedFileCostsTheOthersNothingWhenRecovered) {
  fs::remove(bag_ / "b_1.mcap");
  EXPECT_THAT(bags::open_bag(bag_, false).error().message, HasSubstr("remedy: jostle bag recover"));
  EXPECT_THAT(see(bag_, true).texts, ElementsAre("0", "2"));
  EXPECT_THAT(see(bag_, true).findings, Contains(AllOf(HasSubstr("1 file lost"), HasSubstr("b_1.mcap"))));
  std::ofstream(bag_ / "b_1.mcap") << "something else";
  EXPECT_THAT(see(bag_, true).texts, ElementsAre("0", "2"));
}

TEST_F(FolderParts, MetadataThatCannotBeReadHasARemedy) {
  for (const char* text : {"", "a: [", "[]", "rosbag2_bagfile_information: {}"}) {
    std::ofstream(bag_ / "metadata.yaml") << text;
    EXPECT_THAT(bags::open_bag(bag_, false).error().message,
                AllOf(HasSubstr("metadata.yaml"), HasSubstr("remedy: jostle bag recover")))
        << text;
    EXPECT_THAT(see(bag_, true).texts, ElementsAre("0", "1", "2")) << text;
  }
}

TEST_F(FolderParts, VerifyComparesWhatMetadataSays) {
  EXPECT_THAT(verify(bag_), IsEmpty());
  change_metadata("message_count: 3", "message_count: 4");
  EXPECT_THAT(verify(bag_), Contains(HasSubstr("got 3 messages in the files, wanted 4 as it says")));
}

TEST(FindingsTest, CountPartsOfOneReasonAndBoundReasons) {
  Findings sut;
  sut.lost(Part::kMessage, "why", "here", 2);
  sut.lost(Part::kMessage, "why", "there");
  sut.flawed(Part::kMessage, "why", "there");
  ASSERT_EQ(sut.list().size(), 2u);
  EXPECT_EQ(sut.list()[0].text(), "3 messages lost: here: why");
  EXPECT_EQ(sut.list()[1].text(), "1 message: there: why");
  for (int i = 0; i < 10'000; ++i) sut.lost(Part::kRecord, std::to_string(i), "");
  EXPECT_LT(sut.list().size(), 1000u);
  EXPECT_EQ(sut.count_lost(Part::kRecord), 10'000u);
}

}  // namespace
}  // namespace jostle::tests
