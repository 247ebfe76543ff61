// What rosbag2 relies on: its tables, its queries, its metadata.yaml.

#include <gmock/gmock.h>
#include <sqlite3.h>
#include <yaml-cpp/yaml.h>

#include "services/bags/format/qos_text.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using bags::BagReader;
using bags::BagWriter;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Plain SQL, with nothing of ours in between.
class Sql {
 public:
  explicit Sql(const fs::path& file) {
    if (sqlite3_open(file.c_str(), &database_) != SQLITE_OK) throw std::runtime_error(sqlite3_errmsg(database_));
  }
  ~Sql() { sqlite3_close(database_); }
  Sql(const Sql&) = delete;
  Sql& operator=(const Sql&) = delete;

  // Rows as text, columns between bars.
  std::vector<std::string> operator()(const std::string& sql) {
    std::vector<std::string> rows;
    char* problem = nullptr;
    const auto on_row = [](void* to, int columns, char** values, char**) {
      std::string row;
      for (int i = 0; i < columns; ++i) {
        if (i > 0) row += '|';
        row += values[i] == nullptr ? "NULL" : values[i];
      }
      static_cast<std::vector<std::string>*>(to)->push_back(row);
      return 0;
    };
    if (sqlite3_exec(database_, sql.c_str(), on_row, &rows, &problem) != SQLITE_OK) throw std::runtime_error(problem);
    return rows;
  }

 private:
  sqlite3* database_ = nullptr;
};

class Rosbag2 : public ::testing::Test {
 protected:
  void write(const bags::BagOptions& options) {
    const auto writer = taken(BagWriter::create(path, options));
    const int map = taken(writer->add_topic(string_topic("/map", kLatched)));
    const int x = taken(writer->add_topic(string_topic("/x", kStream)));
    taken(writer->write(map, {.log_time = 100, .publish_time = 90, .data = cdr_of("map")}));
    for (int i = 0; i < 3; ++i) taken(writer->write(x, {.log_time = 110 + i, .publish_time = 1, .data = cdr_of("x")}));
    writer->set_note("lost", {{"/x", "1"}});
    taken(writer->close());
  }

  TempFolder folder;
  const fs::path path = folder.path() / "run";
};

TEST_F(Rosbag2, FindsItsTablesInOurDatabases) {
  write({.storage = bags::BagOptions::Storage::kSqlite});
  Sql sql(path / "run_0.db3");
  const auto columns = [&](const std::string& table) {
    return sql("SELECT name, type, pk, \"notnull\" FROM pragma_table_info('" + table + "')");
  };
  EXPECT_THAT(columns("schema"), ElementsAre("schema_version|INTEGER|1|0", "ros_distro|TEXT|0|1"));
  EXPECT_THAT(columns("metadata"), ElementsAre("id|INTEGER|1|0", "metadata_version|INTEGER|0|1", "metadata|TEXT|0|1"));
  EXPECT_THAT(columns("topics"), ElementsAre("id|INTEGER|1|0", "name|TEXT|0|1", "type|TEXT|0|1",
                                             "serialization_format|TEXT|0|1", "offered_qos_profiles|TEXT|0|1"));
  EXPECT_THAT(columns("messages"),
              ElementsAre("id|INTEGER|1|0", "topic_id|INTEGER|0|1", "timestamp|INTEGER|0|1", "data|BLOB|0|1"));
  EXPECT_THAT(sql("SELECT name FROM sqlite_master WHERE type = 'index'"), ElementsAre("timestamp_idx"));
  EXPECT_THAT(sql("SELECT schema_version, ros_distro FROM schema"), ElementsAre("3|humble"));
  // Since Iron every row of it is taken for a bag's metadata.yaml.
  EXPECT_THAT(sql("SELECT count(*) FROM metadata"), ElementsAre("0"));
  EXPECT_THAT(sql("PRAGMA journal_mode"), ElementsAre("delete"));
  EXPECT_THAT(fs::exists(path / "run_0.db3-journal"), false);
}

TEST_F(Rosbag2, FindsItsMessagesInOurDatabases) {
  write({.storage = bags::BagOptions::Storage::kSqlite});
  Sql sql(path / "run_0.db3");
  EXPECT_THAT(sql("SELECT hex(data), timestamp, topics.name, messages.id FROM messages JOIN topics ON "
                  "messages.topic_id = topics.id "
                  "WHERE (timestamp >= 0) ORDER BY messages.timestamp, messages.id LIMIT 2"),
              ElementsAre("00010000040000006D617000|100|/map|1",
                          "000100000200000078"
                          "00|110|/x|2"));
  EXPECT_THAT(sql("SELECT name, type, serialization_format, COUNT(messages.id), MIN(messages.timestamp), "
                  "MAX(messages.timestamp), "
                  "offered_qos_profiles = '" +
                  bags::qos_text(kStream) +
                  "' FROM messages JOIN topics ON topics.id = messages.topic_id "
                  "WHERE name = '/x' GROUP BY topics.name"),
              ElementsAre("/x|std_msgs/msg/String|cdr|3|110|112|1"));
}

// The conversions that rosbag2_storage/yaml.hpp makes of version 5.
TEST_F(Rosbag2, ReadsOurMetadata) {
  write({.split_time = std::chrono::nanoseconds(11)});
  const YAML::Node file = YAML::LoadFile(path / "metadata.yaml");
  const YAML::Node root = file["rosbag2_bagfile_information"];
  EXPECT_EQ(root["version"].as<int>(), 5);
  EXPECT_EQ(root["storage_identifier"].as<std::string>(), "mcap");
  EXPECT_EQ(root["duration"]["nanoseconds"].as<std::uint64_t>(), 12u);
  EXPECT_EQ(root["starting_time"]["nanoseconds_since_epoch"].as<std::uint64_t>(), 100u);
  EXPECT_EQ(root["message_count"].as<std::uint64_t>(), 5u)
      << "as a plain reader of both files counts: the map stands in each";
  const YAML::Node topic = root["topics_with_message_count"][0];
  EXPECT_EQ(topic["topic_metadata"]["name"].as<std::string>(), "/map");
  EXPECT_EQ(topic["topic_metadata"]["type"].as<std::string>(), "std_msgs/msg/String");
  EXPECT_EQ(topic["topic_metadata"]["serialization_format"].as<std::string>(), "cdr");
  EXPECT_EQ(topic["topic_metadata"]["offered_qos_profiles"].as<std::string>(), bags::qos_text(kLatched));
  EXPECT_EQ(topic["message_count"].as<std::uint64_t>(), 2u);
  EXPECT_EQ(root["compression_format"].as<std::string>(), "");
  EXPECT_EQ(root["compression_mode"].as<std::string>(), "");
  EXPECT_EQ(root["relative_file_paths"].as<std::vector<std::string>>(),
            (std::vector<std::string>{"run_0.mcap", "run_1.mcap"}));
  EXPECT_EQ(root["files"][1]["path"].as<std::string>(), "run_1.mcap");
  EXPECT_EQ(root["files"][1]["starting_time"]["nanoseconds_since_epoch"].as<std::uint64_t>(), 111u);
  EXPECT_EQ(root["files"][1]["duration"]["nanoseconds"].as<std::uint64_t>(), 1u);
  EXPECT_EQ(root["files"][1]["message_count"].as<std::uint64_t>(), 3u);
  EXPECT_EQ(file["jostle_notes"]["lost"]["/x"].as<std::string>(), "1");
}

TEST_F(Rosbag2, WroteDatabasesOfEveryVersionThatWeRead) {
  const std::string topics =
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
      "NOT NULL, offered_qos_profiles TEXT NOT NULL";
  const std::string messages =
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
      "NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
      "INSERT INTO messages VALUES (1, 5, 30, x'0001000002000000' || x'6200'), (2, 5, 20, x'00010000020000006100');";
  const std::string schema =
      "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
      "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);";
  const std::map<int, std::string> versions{
      {2, topics + "); INSERT INTO topics VALUES (5, '/x', 'std_msgs/msg/String', 'cdr', '');" + messages},
      {3, schema + "INSERT INTO schema VALUES (3, 'humble');" + topics +
              "); INSERT INTO topics VALUES (5, '/x', 'std_msgs/msg/String', 'cdr', '');" + messages},
      {4, schema + "INSERT INTO schema VALUES (4, 'jazzy');" + topics +
              ", type_description_hash TEXT NOT NULL);"
              "INSERT INTO topics VALUES (5, '/x', 'std_msgs/msg/String', 'cdr', '- history: keep_last\n  depth: 7\n  "
              "reliability: best_effort\n  durability: transient_local\n', 'RIHS01_0');"
              "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT "
              "NULL, encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);"
              "INSERT INTO message_definitions VALUES (1, 'std_msgs/msg/String', 'ros2msg', 'string data', '');" +
              messages}};
  for (const auto& [version, text] : versions) {
    SCOPED_TRACE(version);
    const fs::path file = folder.path() / (std::to_string(version) + ".db3");
    Sql{file}(text);
    const auto sut = taken(BagReader::open(file));
    EXPECT_EQ(sut->info().messages, 2u);
    EXPECT_THAT(texts_of(rest_of(*sut)), ElementsAre("a", "b"));
    EXPECT_EQ(sut->info().topics[0].topic.definition, version == 4 ? "string data" : "");
    EXPECT_EQ(sut->info().topics[0].topic.qos,
              version == 4 ? (Qos{.reliable = false, .latched = true, .depth = 7}) : Qos{});
  }
  const fs::path later = folder.path() / "5.db3";
  Sql{later}(schema + "INSERT INTO schema VALUES (5, 'z');" + topics + ");" + messages);
  EXPECT_THAT(BagReader::open(later).error().message, HasSubstr("got version 5 of the schema, wanted at most 4"));
  const fs::path other = folder.path() / "other.db3";
  Sql{other}("CREATE TABLE birds(name TEXT)");
  EXPECT_THAT(BagReader::open(other).error().message, HasSubstr("no tables topics and messages"));
}

TEST_F(Rosbag2, IsReadByItsMetadataAndRefusedWhenCompressed) {
  write({});
  const std::string text = contents(path / "metadata.yaml");
  const auto replaced = [&](const std::string& what, const std::string& with) {
    std::string changed = text;
    changed.replace(changed.find(what), what.size(), with);
    std::ofstream(path / "metadata.yaml") << changed;
  };
  replaced("- run_0.mcap", "- run/run_0.mcap");  // as early versions had it
  EXPECT_EQ(taken(BagReader::open(path))->info().messages, 4u);
  replaced("compression_mode: \"\"", "compression_mode: \"FILE\"");
  replaced("compression_format: \"\"", "compression_format: \"zstd\"");
  EXPECT_THAT(BagReader::open(path).error().message, HasSubstr("a bag that rosbag2 compressed (zstd"));
  replaced("rosbag2_bagfile_information", "something_else");
  EXPECT_THAT(BagReader::open(path).error().message, HasSubstr("metadata.yaml: got no rosbag2_bagfile_information"));
  std::ofstream(path / "metadata.yaml") << "a: [";
  EXPECT_THAT(BagReader::open(path).error().message, HasSubstr("metadata.yaml: line "));
  fs::remove(path / "metadata.yaml");
  EXPECT_EQ(taken(BagReader::open(path))->info().messages, 4u);
}

TEST(QosText, IsReadBackAndReadsWhatOthersWrite) {
  for (const Qos& qos : {kTask, kCommand, kAnswer, kLatched, kStream, kState, kCatalogue}) {
    EXPECT_EQ(bags::parse_qos(bags::qos_text(qos)), qos);
  }
  // Humble: several writers of one topic, depth unknown.
  EXPECT_EQ(bags::parse_qos("- history: 3\n  depth: 0\n  reliability: 1\n  durability: 1\n- history: 3\n  depth: 0\n  "
                            "reliability: 2\n  durability: 1\n"),
            (Qos{.reliable = false, .latched = true}));
  for (const char* text : {"", "[]", "- [", "a", "- b: c", "- depth: many"}) {
    EXPECT_EQ(bags::parse_qos(text).depth, Qos{}.depth) << text;
  }
}

}  // namespace
}  // namespace jostle::tests
