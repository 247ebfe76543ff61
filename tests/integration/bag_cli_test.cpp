// jostle bag as a user types it.

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "services/bags/format/definitions.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/program_process.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using bags::BagOptions;
using bags::BagReader;
using bags::BagWriter;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr bags::Time kBegin = 1'700'000'000'000'000'000;
constexpr bags::Time kSecond = 1'000'000'000;

// CDR of a geometry_msgs/msg/Point.
Bytes point(double x, double y, double z) {
  Bytes bytes(28);
  bytes[1] = std::byte{1};
  for (const auto& [at, value] : {std::pair{4, x}, {12, y}, {20, z}}) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
  }
  return bytes;
}

constexpr int kNoises = 20'000;

class BagCli : public ::testing::TestWithParam<BagOptions::Storage> {
 protected:
  int run(std::vector<std::string> arguments) {
    program = std::make_unique<ProgramProcess>("jostle_bag", std::move(arguments), folder);
    return program->wait(60s).value_or(-1);
  }

  // Ten seconds: a text every second, a point every half, and one thing that nobody can decode.
  void write_bag() {
    const auto writer = taken(BagWriter::create(path, {.storage = GetParam()}));
    const int text = taken(writer->add_topic(string_topic("/robot/text", kLatched)));
    bags::Topic points{.name = "/robot/point",
                       .type = "geometry_msgs/msg/Point",
                       .qos = kStream,
                       .definition = bags::definition_of("geometry_msgs/msg/Point").value()};
    const int where = taken(writer->add_topic(points));
    const int other = taken(writer->add_topic({.name = "/other", .type = "some_msgs/msg/Other"}));
    for (int i = 0; i <= 20; ++i) {
      const bags::Time time = kBegin + i * kSecond / 2;
      if (i % 2 == 0) {
        taken(writer->write(
            text, {.log_time = time, .publish_time = time, .data = cdr_of("a \"text\", " + std::to_string(i / 2))}));
      }
      taken(writer->write(where, {.log_time = time,
                                  .publish_time = time,
                                  .data = point(i, 0.25, i == 4 ? std::numeric_limits<double>::infinity() : -1)}));
      if (i % 5 == 0) taken(writer->flush());
    }
    taken(writer->write(other, {.log_time = kBegin + 1, .publish_time = kBegin + 1, .data = noise(10, 1)}));
    writer->set_note("lost", {{"/robot/point", "3"}});
    writer->set_note("record", {{"command", "jostle record"}});
    taken(writer->close());
  }

  // Messages that can be told apart and do not compress.
  void write_noise() {
    const auto writer = taken(BagWriter::create(path, {.storage = GetParam()}));
    const int topic = taken(writer->add_topic({.name = "/x", .type = "some_msgs/msg/Noise"}));
    writer->set_note("lost", {{"/x", "0"}});
    for (int i = 0; i < kNoises; ++i) {
      taken(writer->write(topic, {.log_time = kBegin + i, .data = noise(100, static_cast<std::uint64_t>(i))}));
      if (i % 1000 == 0) taken(writer->flush());
    }
    taken(writer->close());
  }
  // What is there is what was written, and not all of it.
  void expect_noise(const fs::path& saved, std::uint64_t least) {
    const auto back = taken(BagReader::open(saved));
    EXPECT_GT(back->info().messages, least);
    EXPECT_LT(back->info().messages, static_cast<std::uint64_t>(kNoises));
    EXPECT_EQ(back->info().notes.at("recovered").at("from"), path);
    for (const bags::Message& message : rest_of(*back)) {
      ASSERT_EQ(message.data, noise(100, static_cast<std::uint64_t>(message.log_time - kBegin)));
    }
  }

  fs::path file() const {
    return fs::path(path) / (GetParam() == BagOptions::Storage::kMcap ? "run_0.mcap" : "run_0.db3");
  }

  TempFolder folder;
  std::string path = folder.path() / "run";
  std::unique_ptr<ProgramProcess> program;
};

TEST_P(BagCli, InfoShowsTopicsCountsLossesAndNotes) {
  write_bag();
  ASSERT_EQ(run({"info", path}), 0) << program->err();
  for (const char* words : {"messages  33", "duration  10.000 s", "2023-11-14 22:13:20.000000 UTC", "/robot/text",
                            "best effort", "reliable, latched", "command: jostle record"}) {
    EXPECT_THAT(program->out(), HasSubstr(words));
  }
  EXPECT_THAT(program->out(), ::testing::ContainsRegex("/robot/point +geometry_msgs/msg/Point +21 +2.1 +3 "));
  ASSERT_EQ(run({"info", path, "--json"}), 0);
  const auto info = nlohmann::json::parse(program->out());
  EXPECT_EQ(info["messages"], 33);
  EXPECT_EQ(info["duration_s"], 10.0);
  EXPECT_EQ(info["topics"][1]["name"], "/robot/point");
  EXPECT_EQ(info["topics"][1]["lost"], 3);
  EXPECT_EQ(info["topics"][2]["lost"], 0);
  EXPECT_EQ(info["notes"]["record"]["command"], "jostle record");
}

TEST_P(BagCli, VerifyTellsGoodFromDamaged) {
  write_bag();
  ASSERT_EQ(run({"verify", path}), 0) << program->err();
  EXPECT_THAT(program->out(), HasSubstr("ok: 33 messages of 3 topics in 1 file\n"));
  EXPECT_THAT(program->out(), HasSubstr("not decoded: /other"));
  fs::resize_file(file(), fs::file_size(file()) / 2);
  EXPECT_EQ(run({"verify", path}), 1);
  EXPECT_THAT(program->err(), HasSubstr(file().string()));
  EXPECT_THAT(program->err(), HasSubstr("jostle bag recover"));
  EXPECT_EQ(run({"verify", path + "-not"}), 2);
}

TEST_P(BagCli, RecoverSavesWhatIsReadable) {
  write_bag();
  ASSERT_EQ(run({"recover", path}), 0) << program->err();
  EXPECT_THAT(program->out(), HasSubstr("nothing is damaged"));
  EXPECT_THAT(program->out(), HasSubstr(path + "-recovered: 33 messages of 3 topics"));
  EXPECT_EQ(run({"recover", path}), 2) << "it must not overwrite";
  EXPECT_THAT(program->err(), HasSubstr(path + "-recovered"));
  ASSERT_EQ(run({"verify", path + "-recovered"}), 0) << program->err();
}

TEST_P(BagCli, RecoverSavesWhatLiesBeforeAndBehindDamage) {
  write_noise();
  {
    std::fstream damaged(file(), std::ios::in | std::ios::out | std::ios::binary);
    damaged.seekp(static_cast<std::streamoff>(fs::file_size(file()) / 2 / 4096 * 4096));
    damaged << std::string(4096, '\xAA');
  }
  ASSERT_EQ(run({"verify", path}), 1);
  const std::string saved = folder.path() / "saved";
  ASSERT_EQ(run({"recover", path, "--output", saved}), 1) << program->err();
  EXPECT_THAT(program->out(), HasSubstr("; lost: "));
  EXPECT_THAT(program->out(), AllOf(HasSubstr("damaged: "), HasSubstr(file().string() + ": ")));
  ASSERT_EQ(run({"verify", saved}), 0) << program->err();
  expect_noise(saved, kNoises / 3);
  EXPECT_TRUE(taken(BagReader::open(saved))->info().notes.contains("lost"));
}

TEST_P(BagCli, RecoverSavesWhatAFileThatWasCutOffHas) {
  write_noise();
  const auto size = fs::file_size(file()) * 7 / 8;
  if (GetParam() == BagOptions::Storage::kSqlite) {
    // sqlite would fill a page that is cut in two up with zeros.
    fs::resize_file(file(), size / 4096 * 4096 + 100);
    EXPECT_EQ(run({"verify", path}), 1);
    EXPECT_THAT(program->err(), HasSubstr("remedy: jostle bag recover"));
    EXPECT_EQ(run({"recover", path}), 1);
    EXPECT_THAT(program->out(), HasSubstr("cut off within a page"));
    expect_noise(path + "-recovered", kNoises / 3);
  }
  fs::resize_file(file(), size / 4096 * 4096);
  const std::string saved = folder.path() / "saved";
  ASSERT_EQ(run({"recover", path, "-o", saved}), 1) << program->err();
  EXPECT_THAT(program->out(), AllOf(HasSubstr("damaged: "), HasSubstr(file().string() + ": ")));
  ASSERT_EQ(run({"verify", saved}), 0) << program->err();
  expect_noise(saved, kNoises / 3);
}

TEST_P(BagCli, ExportsTables) {
  write_bag();
  const std::string tables = folder.path() / "tables";
  ASSERT_EQ(run({"export", path, "--csv", "-o", tables}), 0) << program->err();
  EXPECT_THAT(program->err(), HasSubstr("left out: /other: got no definition of some_msgs/msg/Other"));
  EXPECT_THAT(contents(tables + "/robot_text.csv"),
              StartsWith("time_s,log_time_ns,publish_time_ns,data\r\n"
                         "0.000000000,1700000000000000000,1700000000000000000,\"a \"\"text\"\", 0\"\r\n"));
  EXPECT_THAT(contents(tables + "/robot_point.csv"),
              HasSubstr("2.000000000,1700000002000000000,1700000002000000000,4.0,0.25,inf\r\n"));
  EXPECT_EQ(run({"export", path, "--csv", "--topic", "/robot/p*", "--from", "1", "--to", "2"}), 0) << program->err();
  EXPECT_THAT(program->out(), StartsWith("time_s,log_time_ns,publish_time_ns,x,y,z\r\n1.000000000,"));
  EXPECT_EQ(std::ranges::count(program->out(), '\n'), 4);
  EXPECT_EQ(run({"export", path, "--csv"}), 2);
  EXPECT_THAT(program->err(), HasSubstr("got 2 topics, wanted one"));
}

TEST_P(BagCli, ExportsJsonLineByLine) {
  write_bag();
  ASSERT_EQ(run({"export", path, "--json", "--topic", "/robot/*"}), 0) << program->err();
  std::istringstream lines(program->out());
  std::string line;
  std::vector<nlohmann::json> objects;
  while (std::getline(lines, line)) objects.push_back(nlohmann::json::parse(line));
  ASSERT_EQ(objects.size(), 32u);
  EXPECT_EQ(objects[0]["topic"], "/robot/text");
  EXPECT_EQ(objects[0]["message"]["data"], "a \"text\", 0");
  EXPECT_EQ(objects[1]["message"]["y"], 0.25);
  const std::string file_name = folder.path() / "all.jsonl";
  EXPECT_EQ(run({"export", path, "--json", "-o", file_name}), 0);
  EXPECT_EQ(run({"export", path, "--json", "-o", file_name}), 1) << "it must not overwrite";
  EXPECT_EQ(run({"export", path, "--json", "--topic", "/no/such"}), 2);
  EXPECT_EQ(run({"export", path}), 2);
}

TEST_P(BagCli, ExportsWhatDecodesAndCountsWhatDoesNot) {
  {
    const auto writer = taken(BagWriter::create(path, {.storage = GetParam()}));
    const int text = taken(writer->add_topic(string_topic("/robot/status")));
    const int other = taken(writer->add_topic(string_topic("/robot_status")));
    taken(writer->write(text, {.log_time = kBegin, .data = noise(3, 1)}));
    taken(writer->write(text, {.log_time = kBegin + 1, .data = cdr_of("good")}));
    taken(writer->write(other, {.log_time = kBegin + 2, .data = cdr_of("good, too")}));
    taken(writer->close());
  }
  EXPECT_EQ(run({"export", path, "--json"}), 1);
  EXPECT_EQ(std::ranges::count(program->out(), '\n'), 2);
  EXPECT_THAT(program->err(), HasSubstr("1 message lost: /robot/status: message of log time"));
  // Two topics that want one name of a file.
  const std::string tables = folder.path() / "tables";
  EXPECT_EQ(run({"export", path, "--csv", "-o", tables}), 1) << program->err();
  EXPECT_THAT(contents(tables + "/robot_status.csv"), HasSubstr(",good\r\n"));
  EXPECT_THAT(contents(tables + "/robot_status_2.csv"), HasSubstr(",\"good, too\"\r\n"));
  EXPECT_EQ(run({"verify", path}), 1);
  EXPECT_THAT(program->err(), HasSubstr("cannot be decoded"));
  EXPECT_THAT(program->out(), HasSubstr("not ok: 3 messages"));
}

TEST_P(BagCli, ExportRefusesTimesThatAreNoneAndFoldersThatHoldSomethingElse) {
  write_bag();
  const auto expect_refused = [&](std::vector<std::string> arguments, int code, const std::string& words) {
    arguments.insert(arguments.begin(), {"export", path, "--json", "--topic", "/robot/text"});
    EXPECT_EQ(run(arguments), code) << words;
    EXPECT_THAT(program->err(), HasSubstr(words));
    EXPECT_THAT(program->out(), IsEmpty());
  };
  expect_refused({"--from", "5", "--to", "4"}, 2, "--to: got 4 s, wanted at least the 5 s of --from");
  expect_refused({"--from", "11"}, 2, "--from: got 11 s, wanted at most 10 s, where the last message is");
  expect_refused({"--to", "nan"}, 2, "--to: got 'nan', wanted a finite number");
  EXPECT_EQ(run({"export", path, "--csv", "-o", path}), 2);
  EXPECT_THAT(program->err(), HasSubstr("wanted a new or an empty folder"));
  EXPECT_FALSE(fs::exists(path + "/robot_text.csv"));
  EXPECT_EQ(run({"export", path, "--json", "--topic", "/robot/text", "-o", "/dev/null"}), 0) << program->err();
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_P(BagCli, LeavesNothingBehindWhenInterrupted) {
  {
    const auto writer = taken(BagWriter::create(path, {.storage = GetParam()}));
    const int topic = taken(writer->add_topic(string_topic("/x")));
    const Bytes data = cdr_of("x");
    for (int i = 0; i < 300'000; ++i) taken(writer->write(topic, {.log_time = kBegin + i, .data = data}));
    taken(writer->close());
  }
  const fs::path tables = folder.path() / "tables", saved = folder.path() / "run-recovered";
  for (const auto& [arguments, made] :
       {std::pair<std::vector<std::string>, fs::path>{{"export", path, "--csv", "-o", tables}, tables / "x.csv"},
        {{"recover", path}, saved}}) {
    ProgramProcess sut("jostle_bag", arguments, folder);
    ASSERT_TRUE(soon(30s, [&] { return fs::exists(made) || sut.code(); }));
    sut.signal(SIGINT);
    EXPECT_EQ(sut.wait(30s), 130) << sut.err();
    EXPECT_FALSE(fs::exists(made.filename() == "x.csv" ? tables : saved));
  }
}

// Recorded before robots said their limits: their states are left out, and observations are drawn.
TEST(BagPlot, DrawsARunAndSaysWhatItLacks) {
  TempFolder folder;
  const std::string bags = JOSTLE_SOURCE_DIR "/tests/data/bags/", picture = folder.path() / "grasp.png";
  const auto plot = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "plot");
    auto program = std::make_unique<ProgramProcess>("jostle_bag", std::move(arguments), folder);
    program->wait(60s);
    return program;
  };
  const auto drawn = plot({bags + "grasp", "-o", picture});
  EXPECT_EQ(drawn->code(), 0) << drawn->err();
  EXPECT_THAT(contents(picture), StartsWith("\x89PNG"));
  EXPECT_EQ(plot({bags + "grasp", "-o", folder.path() / "x.bmp"})->code(), 2);
  const auto other = plot({bags + "grasp", "--goal", "other"});
  EXPECT_EQ(other->code(), 2);
  EXPECT_THAT(other->err(), HasSubstr("--goal: got 'other', wanted one of this bag"));
}

INSTANTIATE_TEST_SUITE_P(Mcap, BagCli, ::testing::Values(BagOptions::Storage::kMcap));
INSTANTIATE_TEST_SUITE_P(Sqlite, BagCli, ::testing::Values(BagOptions::Storage::kSqlite));

}  // namespace
}  // namespace jostle::tests
