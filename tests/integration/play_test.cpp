// jostle play, as a process, into the subscribers of this one.

#include <gmock/gmock.h>

#include <fmt/format.h>

#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "services/wire/dds/cdr.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/raw_subscriber.hpp"
#include "tests/support/terminal_process.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Le;
using ::testing::Not;
using ::testing::StartsWith;

constexpr std::chrono::seconds kPatience{60};
constexpr bags::Time kBegin = 1'700'000'000'000'000'000;

constexpr Qos kAsksForKept{.latched = true, .depth = 10};

class Play : public ::testing::Test {
 protected:
  // Makes a bag of the topics given; messages are (topic, offset, text).
  struct Entry {
    int topic;
    std::chrono::nanoseconds offset;
    std::string text;
  };
  void write_bag(const std::vector<bags::Topic>& topics, const std::vector<Entry>& entries,
                 const bags::BagOptions& options = {}) {
    auto writer = taken(bags::BagWriter::create(bag, options));
    for (const bags::Topic& topic : topics) taken(writer->add_topic(topic));
    for (const auto& [topic, offset, text] : entries) {
      const auto data = cdr_of(text);
      const bags::Time time = kBegin + offset.count();
      taken(writer->write(topic, {.log_time = time, .publish_time = time, .data = data}));
    }
    taken(writer->close());
  }

  // A scene that changes at 0 and 2 s, a state at 0, 0.5, 1, … 3 s, notes right behind each.
  void write_run() {
    std::vector<Entry> entries;
    for (int i = 0; i <= 6; ++i) {
      const auto time = i * 500ms;
      if (i % 4 == 0) entries.push_back({0, time, "scene" + std::to_string(i / 4)});
      entries.push_back({1, time, "state" + std::to_string(i)});
      entries.push_back({2, time + 1ms, "note" + std::to_string(i)});
    }
    // Known as a state by its name: its type is never looked into.
    write_bag({string_topic("/task/run", kLatched),
               {.name = "/robot/status", .type = "jostle_msgs/msg/RobotStatus", .qos = kState},
               string_topic("/notes")},
              entries);
  }

  // Until it publishes.
  void start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), bag.string());
    arguments.insert(arguments.end(), {"--domain", std::to_string(domain)});
    player = std::make_unique<ProgramProcess>("jostle_play", arguments, folder);
  }
  void start_and_wait(std::vector<std::string> arguments) {
    start(std::move(arguments));
    ASSERT_TRUE(player->says("ready", kPatience)) << player->err();
  }

  // Tells it, as a script does, and gives its state afterwards.
  nlohmann::json tell(std::vector<std::string> controls, int code = 0) {
    controls.insert(controls.begin(), "--control");
    controls.insert(controls.end(), {"--domain", std::to_string(domain)});
    ProgramProcess client("jostle_play", controls, folder);
    EXPECT_EQ(client.wait(kPatience), code) << client.err();
    words = client.err();
    return code == 0 ? nlohmann::json::parse(client.out()) : nlohmann::json();
  }

  const wire::Participant& participant() {
    if (!participant_) participant_.emplace(wire::Participant::open({.domain = domain}).value());
    return *participant_;
  }
  std::unique_ptr<RawSubscriber> subscribe(const std::string& topic, const Qos& qos = {.depth = kKeepAll}) {
    const bool status = topic.ends_with("/robot/status");
    return std::make_unique<RawSubscriber>(participant(), topic,
                                           status ? "jostle_msgs/msg/RobotStatus" : "std_msgs/msg/String", qos);
  }

  void expect_refused(const std::string& path, const std::vector<std::string>& expected) {
    SCOPED_TRACE(path);
    bag = path;
    start({});
    EXPECT_EQ(player->wait(kPatience), 2);
    for (const std::string& word : expected) EXPECT_THAT(player->err(), HasSubstr(word));
  }

  const int domain = test_domain();
  const TempFolder folder;
  fs::path bag = folder.path() / "shelf";
  std::string words;  // of the last tell()
  std::unique_ptr<ProgramProcess> player;

 private:
  std::optional<wire::Participant> participant_;
};

// ---------------------------------------------------------------- order and bytes

class PlayRates : public Play, public ::testing::WithParamInterface<std::string> {};

TEST_P(PlayRates, EveryMessageArrivesAsItWasInOrder) {
  std::map<int, std::vector<Bytes>> sent;
  {
    auto writer = taken(bags::BagWriter::create(bag, {}));
    for (const char* name : {"/a", "/b", "/c"}) taken(writer->add_topic(string_topic(name, kCommand)));
    for (int i = 0; i < 400; ++i) {
      const int topic = i * i % 3;  // irregular
      // The wire pads to four bytes, and so do recordings of it.
      Bytes data = noise(static_cast<std::size_t>(i % 7 == 0 ? 20'000 : 40 + 4 * i), static_cast<std::uint64_t>(i));
      data[0] = data[2] = data[3] = std::byte{0};
      data[1] = std::byte{1};
      const bags::Time time = kBegin + i * i * 4000;  // the last one after 0.64 s
      taken(writer->write(topic, {.log_time = time, .publish_time = time, .data = data}));
      sent[topic].push_back(std::move(data));
    }
    taken(writer->close());
  }
  const auto a = subscribe("/a"), b = subscribe("/b"), c = subscribe("/c");
  const fs::path json = folder.path() / "played.json";

  start({"--rate", GetParam(), "--wait-for-subscribers=1", "--json", json});

  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return a->count() + b->count() + c->count() >= 400; }));
  EXPECT_TRUE(a->samples() == sent[0]) << a->count();
  EXPECT_TRUE(b->samples() == sent[1]) << b->count();
  EXPECT_TRUE(c->samples() == sent[2]) << c->count();
  const auto report = nlohmann::json::parse(contents(json));
  EXPECT_EQ(report["sent"], 400);
  EXPECT_EQ(report["messages"]["/a"], sent[0].size());
  EXPECT_EQ(report["refused"], 0);
  EXPECT_EQ(report["reason"], "played to its end");
  EXPECT_GE(report["seconds"].get<double>(), 0.636804 / std::stod(GetParam()));
  EXPECT_THAT(player->err(),
              AllOf(HasSubstr("400 messages of 3 topics"), HasSubstr("(p99)"), Not(HasSubstr("another publisher"))));
}

INSTANTIATE_TEST_SUITE_P(Integration, PlayRates, ::testing::Values("0.5", "1", "10"));

TEST_F(Play, ABagOfSqliteIsPlayedToo) {
  write_bag({string_topic("/a")}, {{0, 0ms, "a0"}, {0, 1ms, "a1"}}, {.storage = bags::BagOptions::Storage::kSqlite});
  const auto a = subscribe("/a");
  start({"--wait-for-subscribers=1"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return a->count() == 2; }));
  EXPECT_THAT(a->texts(), ElementsAre("a0", "a1"));
}

// ---------------------------------------------------------------- control

TEST_F(Play, IsSteeredOverDds) {
  write_run();
  const auto notes = subscribe("/notes");
  start_and_wait({"--paused", "--wait-for-subscribers=1", "/notes"});

  auto status = tell({"status"});
  EXPECT_EQ(status["state"], "paused");
  EXPECT_EQ(status["end"], 3.001);
  EXPECT_EQ(status["bag_time"], kBegin);
  status = tell({"step", "step"});
  EXPECT_EQ(status["messages"], 2);
  EXPECT_EQ(status["time"], 0.501);
  EXPECT_TRUE(soon(kPatience, [&] { return notes->count() == 2; }));
  status = tell({"rate:0.01", "seek:1.7", "resume", "pause", "loop:1"});
  EXPECT_EQ(status["state"], "paused");
  EXPECT_EQ(status["rate"], 0.01);
  EXPECT_EQ(status["loop"], true);
  EXPECT_THAT(status["time"].get<double>(), AllOf(Ge(1.7), Le(2.7)));
  tell({"step"});
  status = tell({"loop:0", "rate:100", "seek:2.8", "resume"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return notes->count() == 4; }));
  EXPECT_THAT(notes->texts(), ElementsAre("note0", "note1", "note4", "note6"));
}

TEST_F(Play, QuitsWhenToldAndRefusesNonsense) {
  write_run();
  start_and_wait({"--paused"});
  tell({"rate:1000"}, 2);
  EXPECT_THAT(words, HasSubstr("rate: got 1000, wanted 0.01 to 100"));
  tell({"jump"}, 2);
  EXPECT_THAT(words, HasSubstr("wanted pause, resume"));
  EXPECT_EQ(tell({"quit"})["state"], "ended");
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_THAT(player->err(), HasSubstr("told to quit: 0 messages"));
}

TEST_F(Play, ControlWithoutAPlaybackSaysSo) {
  tell({"pause", "--timeout", "0.2"}, 3);
  EXPECT_THAT(words, HasSubstr(fmt::format("no answer from a playback in domain {} within 0.2 s", domain)));
}

// ---------------------------------------------------------------- moments

TEST_F(Play, ALateSubscriberAfterASeekGetsTheSceneAndTheStateOfThatMoment) {
  write_run();
  start_and_wait({"--rate", "100"});
  EXPECT_EQ(player->wait(kPatience), 0);  // a whole pass is fine, too
  start_and_wait({"--paused"});
  tell({"rate:100", "seek:2.9", "step", "step", "seek:1.3"});  // scene1 and state6 have been sent

  const auto scene = subscribe("/task/run", {.latched = true, .depth = 1});
  const auto kept = subscribe("/robot/status", kAsksForKept);
  const auto plain = subscribe("/robot/status");
  const auto notes = subscribe("/notes");
  ASSERT_TRUE(soon(kPatience, [&] { return scene->count() >= 1 && kept->count() >= 1 && plain->count() >= 1; }))
      << player->err();

  tell({"step"});  // the next one of all is state3, the one after note3
  ASSERT_TRUE(soon(kPatience, [&] { return plain->texts().back() == "state3"; }));
  tell({"step"});
  ASSERT_TRUE(soon(kPatience, [&] { return notes->count() >= 1; }));
  EXPECT_THAT(scene->texts(), ElementsAre("scene0"));
  EXPECT_THAT(notes->texts(), ElementsAre("note3"));
  // Whoever came second made it go out once more.
  for (const auto* reader : {&kept, &plain}) {
    auto texts = (*reader)->texts();
    EXPECT_EQ(texts.back(), "state3");
    texts.pop_back();
    EXPECT_THAT(texts, AllOf(Not(IsEmpty()), Each(std::string("state2"))));
  }
}

TEST_F(Play, ASeekBackTakesBackWhatHadNotHappenedYet) {
  write_bag({string_topic("/first"), string_topic("/late", kLatched)}, {{0, 0ms, "f"}, {1, 1s, "late"}, {0, 2s, "g"}});
  start_and_wait({"--paused"});
  tell({"step", "step", "seek:0.5"});
  const auto late = subscribe("/late", {.latched = true, .depth = 1});
  ASSERT_TRUE(soon(kPatience, [&] { return late->matched() > 0; }));
  tell({"seek:1.5"});
  ASSERT_TRUE(soon(kPatience, [&] { return late->count() > 0; }));
  tell({"status"});
  EXPECT_THAT(late->texts(), ElementsAre("late"));  // not twice
}

TEST_F(Play, AStartOffsetBeginsWithItsMoment) {
  write_run();
  const auto scene = subscribe("/task/run", {.latched = true, .depth = 10});
  const auto status = subscribe("/robot/status");
  const auto notes = subscribe("/notes");
  start({"-v", "--start", "1.75", "--duration", "0.5", "--rate", "10", "--wait-for-subscribers=1"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return notes->count() == 1 && status->count() == 2 && scene->count() == 2; }));
  EXPECT_THAT(scene->texts(), ElementsAre("scene0", "scene1"));
  EXPECT_THAT(status->texts(), ElementsAre("state3", "state4"));
  EXPECT_THAT(notes->texts(), ElementsAre("note4"));
  EXPECT_THAT(player->err(), HasSubstr("the last message of these is sent again: /robot/status, /task/run"));
}

TEST_F(Play, LoopsUntilTold) {
  write_run();
  const auto notes = subscribe("/notes");
  start_and_wait({"--loop", "--rate", "100", "--wait-for-subscribers=1", "/notes"});
  EXPECT_TRUE(soon(kPatience, [&] { return notes->count() >= 15; }));
  EXPECT_GE(tell({"loop:0"})["passes"], 2);
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return notes->count() % 7 == 0; }));
  const auto texts = notes->texts();
  ASSERT_EQ(texts.size() % 7, 0u);
  for (std::size_t i = 0; i < texts.size(); ++i) EXPECT_EQ(texts[i], "note" + std::to_string(i % 7));
}

// ---------------------------------------------------------------- topics

TEST_F(Play, RemapsGlobsAndLeavesCommandsOut) {
  write_bag({string_topic("/a/x"),
             string_topic("/a/y"),
             string_topic("/b"),
             {.name = "/robot/command", .type = "jostle_msgs/msg/VelocityCommand", .qos = kCommand}},
            {{0, 0ms, "x"}, {1, 0ms, "y"}, {2, 0ms, "b"}, {3, 0ms, "c"}});
  const RawSubscriber command(participant(), "/robot/command", "jostle_msgs/msg/VelocityCommand");
  const auto moved = subscribe("/lab/x"), y = subscribe("/a/y"), b = subscribe("/b");

  start({"/a/*", "--remap", "/a/x:=/lab/x", "--exclude", "/a/y", "--wait-for-subscribers=1"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return moved->count() == 1; }));
  EXPECT_THAT(moved->texts(), ElementsAre("x"));

  const auto x = subscribe("/a/x");
  start({"--exclude", "/a/y", "--wait-for-subscribers=1"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return b->count() == 1; }));
  EXPECT_THAT(player->err(), HasSubstr("not played, because a robot would obey: /robot/command"));
  EXPECT_EQ(command.count(), 0u);
  EXPECT_EQ(command.matched(), 0);
  EXPECT_EQ(y->count(), 0u);

  start({"/robot/command", "--wait-for-subscribers=1"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return command.count() == 1; }));
}

TEST_F(Play, WarnsOfAnotherPublisher) {
  write_run();
  const wire::RawWriter other(participant(), {"rt/notes", "std_msgs::msg::dds_::String_", {}});
  start({"--paused"});
  EXPECT_TRUE(player->says("another publisher of /notes", kPatience)) << player->err();
}

TEST_F(Play, ClockShowsTheBagsTime) {
  write_run();
  const RawSubscriber clock(participant(), "/clock", "rosgraph_msgs/msg/Clock");
  const auto notes = subscribe("/notes");
  start({"/notes", "--wait-for-subscribers=1", "--rate", "10", "--clock=200"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  std::vector<std::int64_t> times;
  for (const Bytes& sample : clock.samples()) {
    const auto time = wire::from_cdr<rosgraph_msgs::msg::Clock>(sample).value().clock();
    times.push_back(time.sec() * 1'000'000'000ll + time.nanosec());
  }
  // 0.3 s at 200 Hz are 60; a busy machine may skip some.
  EXPECT_THAT(times.size(), AllOf(Ge(5u), Le(120u)));
  EXPECT_TRUE(std::ranges::is_sorted(times));
  EXPECT_THAT(times, Each(AllOf(Ge(kBegin), Le(kBegin + 3'001'000'000))));
}

TEST_F(Play, WaitsForSubscribersAndSaysWhoseAreMissing) {
  write_run();
  start({"--wait-for-subscribers=2", "--timeout", "0.3"});
  EXPECT_EQ(player->wait(kPatience), 3);
  EXPECT_THAT(player->err(),
              HasSubstr("got fewer than 2 subscribers of /notes, /robot/status, /task/run within 0.3 s"));

  const auto first = subscribe("/notes");
  start({"--wait-for-subscribers=2", "--rate", "100", "/notes"});
  ASSERT_TRUE(player->says("waits for subscribers of /notes", kPatience));
  EXPECT_EQ(tell({"status"})["state"], "waiting");
  const auto second = subscribe("/notes");
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] { return first->count() == 7 && second->count() == 7; }));
}

// ---------------------------------------------------------------- bad bags

TEST_F(Play, ForeignFilesGetAClearError) {
  expect_refused(folder.path() / "nowhere", {"nowhere: not there"});
  expect_refused(folder.write("notes.txt", "buy milk"), {"notes.txt", "wanted .mcap or .db3"});
  expect_refused(folder.write("picture.png", "\x89PNG\r\n\x1a\n"), {"picture.png", "wanted .mcap or .db3"});
  expect_refused(folder.write("picture.mcap", "\x89PNG\r\n\x1a\n and more"),
                 {"picture.mcap: byte 0", "wanted the beginning of an MCAP"});
  expect_refused(folder.write("nothing.mcap", ""), {"nothing.mcap", "empty"});
  expect_refused(folder.write("words.db3", "no database at all, but long enough to be read as one"), {"words.db3"});
  fs::create_directory(folder.path() / "bare");
  expect_refused(folder.path() / "bare", {"bare", "wanted a bag"});
}

TEST_F(Play, AnEmptyBagGetsAClearError) {
  write_bag({string_topic("/a")}, {});
  expect_refused(bag, {"shelf: got no messages"});
}

TEST_F(Play, AnMcapOfAnotherProfileGetsAClearError) {
  // Magic, a header of profile ros1, an end of data without a summary, a footer, magic.
  using namespace std::string_literals;
  const auto text = [](const std::string& content) {
    return std::string{static_cast<char>(content.size()), 0, 0, 0} + content;
  };
  const auto record = [](char op, const std::string& body) {
    return std::string{op, static_cast<char>(body.size()), 0, 0, 0, 0, 0, 0, 0} + body;
  };
  const std::string magic = "\x89MCAP0\r\n";
  const std::string head = magic + record(1, text("ros1") + text("rosbag"));
  const std::string schema = record(3, "\1\0"s + text("std_msgs/String") + text("ros1msg") + text("string data"));
  const std::string channel = record(4, "\1\0\1\0"s + text("/a") + text("ros1") + std::string(4, '\0'));
  const std::string message = record(5, "\1\0"s + std::string(20, '\0') + "data");
  const std::string tail = record(15, std::string(4, '\0')) + record(2, std::string(20, '\0')) + magic;
  expect_refused(folder.write("old.mcap", head + schema + channel + message + tail), {"old.mcap"});
}

// A message of before /clock was there, and nothing for decades.
TEST_F(Play, AGapOfYearsIsSaidAndCanBeSkipped) {
  const auto writer = taken(bags::BagWriter::create(bag, {}));
  const int topic = taken(writer->add_topic(string_topic("/a")));
  taken(writer->write(topic, {.log_time = 0, .data = cdr_of("early")}));
  taken(writer->write(topic, {.log_time = 1'700'000'000'000'000'000, .data = cdr_of("late")}));
  taken(writer->close());
  start({});
  EXPECT_TRUE(player->says("a gap: the next message, of 2023-11-14 22:13:20 UTC, comes in 53.9 years", kPatience))
      << player->err();
  EXPECT_THAT(player->err(), HasSubstr("--start 1700000000"));
  player->signal(SIGINT);
  EXPECT_EQ(player->wait(kPatience), 130);
  start({"--start", "1700000000"});
  EXPECT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_THAT(player->err(), HasSubstr("1 messages of 1 topics"));
}

TEST_F(Play, ATruncatedBagGetsAClearError) {
  write_run();
  const fs::path file = bag / "shelf_0.mcap";
  fs::resize_file(file, fs::file_size(file) * 2 / 3);
  expect_refused(bag, {"shelf_0.mcap", "jostle bag recover"});
}

TEST_F(Play, DamageInTheMiddleEndsThePlaybackThere) {
  // Chunks of their own for what comes later: noise that does not compress.
  auto writer = taken(bags::BagWriter::create(bag, {}));
  taken(writer->add_topic(string_topic("/a")));
  for (int i = 0; i < 40; ++i) {
    Bytes data = noise(200'000, static_cast<std::uint64_t>(i));
    std::copy_n(cdr_of("x").begin(), 4, data.begin());
    taken(writer->write(0, {.log_time = kBegin + i * 1'000'000, .data = data}));
  }
  taken(writer->close());
  const fs::path file = bag / "shelf_0.mcap";
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(static_cast<std::streamoff>(fs::file_size(file) / 2));
    bytes << "scratch";
  }
  start({});
  EXPECT_EQ(player->wait(kPatience), 2);
  EXPECT_THAT(player->err(), AllOf(HasSubstr("shelf_0.mcap: byte "), HasSubstr("ready")));
}

// ---------------------------------------------------------------- terminal

TEST_F(Play, KeysSteerAndTheTerminalIsRestoredAfterCtrlC) {
  write_run();
  const auto notes = subscribe("/notes");
  TerminalProcess sut("jostle_play",
                      {bag, "/notes", "--paused", "--domain", std::to_string(domain), "--wait-for-subscribers=1"});
  ASSERT_TRUE(sut.is_plain());
  ASSERT_TRUE(sut.shows("space pause", kPatience)) << sut.screen();
  ASSERT_TRUE(sut.shows("  paused", kPatience)) << sut.screen();
  EXPECT_FALSE(sut.is_plain());

  sut.type("s");
  EXPECT_TRUE(soon(kPatience, [&] { return notes->count() == 1; })) << sut.screen();
  sut.type("+");
  EXPECT_TRUE(sut.shows("  x2  ", kPatience)) << sut.screen();
  sut.type("l");
  EXPECT_TRUE(sut.shows("  loop  ", kPatience)) << sut.screen();
  sut.type("5");
  EXPECT_TRUE(sut.shows("  1.5/3.0 s", kPatience)) << sut.screen();
  sut.type("\033[C");
  EXPECT_TRUE(sut.shows("  3.0/3.0 s", kPatience)) << sut.screen();
  sut.type("l0 ");
  EXPECT_TRUE(sut.shows("  playing", kPatience)) << sut.screen();
  sut.type("\003");
  EXPECT_EQ(sut.wait(kPatience), 130);
  EXPECT_TRUE(sut.is_plain());
  EXPECT_THAT(sut.screen(), HasSubstr("interrupted: "));
}

TEST_F(Play, TheTerminalIsRestoredAfterQAndSigterm) {
  write_run();
  for (const bool by_signal : {false, true}) {
    TerminalProcess sut("jostle_play", {bag, "--paused", "--domain", std::to_string(domain)});
    ASSERT_TRUE(sut.shows("  paused", kPatience)) << sut.screen();
    EXPECT_FALSE(sut.is_plain());
    if (by_signal) {
      sut.signal(SIGTERM);
    } else {
      sut.type("q");
    }
    EXPECT_EQ(sut.wait(kPatience), by_signal ? 130 : 0) << sut.screen();
    EXPECT_TRUE(sut.is_plain());
  }
}

TEST_F(Play, ANarrowTerminalGetsAnUnbrokenLine) {
  write_run();
  TerminalProcess sut("jostle_play", {bag, "--paused", "--domain", std::to_string(domain)}, 40);
  ASSERT_TRUE(sut.shows("\r[>  ", kPatience)) << sut.screen();
  ASSERT_TRUE(sut.shows("\033[K\r", kPatience)) << sut.screen();
  const std::string& screen = sut.screen();
  const std::size_t begin = screen.find("\r[>");
  EXPECT_LT(screen.find("\033[K", begin) - begin, 41u);
}

}  // namespace
}  // namespace jostle::tests
