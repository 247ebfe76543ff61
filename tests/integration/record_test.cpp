// jostle record as a user starts it, beside publishers of this test: nothing is lost, and what
// is lost is counted.

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>

#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "services/bags/format/folder_reader.hpp"
#include "services/wire/dds/core.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/raw.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/rover.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

constexpr Qos kDeep{.depth = 5000};  // holds whatever a test sends
constexpr Qos kDeepRetained{.retained = true, .depth = 5000};

// Number i as text. With its end a multiple of four bytes long, as all on the wire is.
std::string text(int i, std::size_t size = 7) {
  std::string digits = fmt::format("{:07}", i);
  digits.resize(size, ' ');
  return digits;
}

// A process's part of DDS: at the end of its scope the domain sees it go. The bytes are
// those of a string whatever the type: a recorder does not look into them.
class Publisher {
 public:
  Publisher(int domain, const std::string& topic, const Qos& qos,
            const std::string& type = "sensor_msgs/msg/JointState")
      : participant_(wire::Participant::open({.domain = domain}).value()),
        writer_(participant_, {wire::wire_topic(topic), *wire::wire_type(type), qos}) {}

  bool is_heard(int readers = 1) const { return writer_.wait_for_readers(in(kPatience), readers); }

  // Goes on counting where the last call ended.
  void write(int count, std::size_t size = 7) {
    for (int i = 0; i < count; ++i) ASSERT_TRUE(writer_.write(cdr_of(text(sent++, size))));
  }

  bool was_received() const { return writer_.wait_until_received(in(kPatience)); }

  int sent = 0;

 private:
  wire::Participant participant_;
  wire::RawWriter writer_;
};

class Record : public RunFixture {
 protected:
  // Ready when it returns.
  void record(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--min-free", "0", "--json", folder.path() / "record.json"});
    if (std::ranges::find(arguments, "-o") == arguments.end()) arguments.insert(arguments.end(), {"-o", bag()});
    recorder = program("jostle_record", arguments);
    ASSERT_TRUE(recorder->says("ready", kPatience)) << recorder->err();
  }

  int stop_recorder() {
    recorder->signal(SIGINT);
    return recorder->wait(kPatience).value_or(-1);
  }

  std::string bag(const std::string& suffix = "") const { return (folder.path() / "bag").string() + suffix; }

  std::vector<bags::Message> messages_of(const std::string& topic, const std::string& path,
                                         bool recover = false) const {
    const auto reader = taken(bags::open_bag(path, recover));
    const auto index = reader->find_topic(topic);
    if (!index) return {};
    reader->seek(0, {*index});
    return rest_of(*reader);
  }

  std::vector<std::string> topics_of(const std::string& path) const {
    std::vector<std::string> names;
    const auto reader = taken(bags::open_bag(path, false));
    for (const auto& topic : reader->info().topics) names.push_back(topic.topic.name);
    return names;
  }

  std::map<std::string, bags::Note> notes_of(const std::string& path) const {
    const auto reader = taken(bags::open_bag(path, false));
    return reader->info().notes;
  }

  json summary() const { return json::parse(contents(folder.path() / "record.json"), nullptr, false); }

  std::unique_ptr<ProgramProcess> recorder;
};

std::vector<std::string> numbers(int from, int to, std::size_t size = 7) {
  std::vector<std::string> texts;
  for (int i = from; i < to; ++i) texts.push_back(text(i, size));
  return texts;
}

// Of every promise a writer can make, on a topic nobody has heard of before.
TEST_F(Record, LosesNothingOfAPublisherThatComesWritesAndGoes) {
  record({});
  const std::pair<const char*, Qos> cases[] = {
      {"/volatile", kDeep}, {"/latched", {.latched = true, .depth = 5000}}, {"/retained", kDeepRetained}};
  for (const auto& [topic, qos] : cases) {
    Publisher publisher(domain, topic, qos);
    ASSERT_TRUE(publisher.is_heard()) << recorder->err();
    publisher.write(500);
    ASSERT_TRUE(publisher.was_received());
  }

  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  for (const auto& [topic, qos] : cases) {
    EXPECT_EQ(texts_of(messages_of(topic, bag())), numbers(0, 500)) << topic;
    EXPECT_EQ(summary()["lost"][topic], 0);
    EXPECT_EQ(summary()["messages"][topic], 500);
  }
}

TEST_F(Record, GetsWhatWasWrittenBeforeItCame) {
  Publisher early(domain, "/early", {.retained = true, .depth = 10});
  early.write(30);
  Publisher status(domain, "/robot/status", kState, "jostle_msgs/msg/RobotStatus");
  status.write(3);

  record({});
  ASSERT_TRUE(early.is_heard() && early.was_received());
  ASSERT_TRUE(status.is_heard() && status.was_received());
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  EXPECT_EQ(texts_of(messages_of("/early", bag())), numbers(20, 30));
  EXPECT_EQ(texts_of(messages_of("/robot/status", bag())), numbers(0, 3));
}

// `ros2 topic pub` on a topic of ours, say: it offers less than our own writers do.
TEST_F(Record, HearsWritersThatOfferLessThanTheSystemsOwn) {
  record({"/robot/*"});
  Publisher ours(domain, "/robot/status", kDeepRetained, "jostle_msgs/msg/RobotStatus");
  ASSERT_TRUE(ours.is_heard());
  ours.write(10);
  Publisher volatile_one(domain, "/robot/status", kDeep, "jostle_msgs/msg/RobotStatus");
  ASSERT_TRUE(volatile_one.is_heard()) << recorder->err();
  volatile_one.write(10);
  Publisher unreliable(domain, "/robot/status", {.reliable = false, .depth = 100}, "jostle_msgs/msg/RobotStatus");
  ASSERT_TRUE(unreliable.is_heard()) << recorder->err();
  ours.write(10);  // three readers get these now; each counts once
  volatile_one.write(10);
  ASSERT_TRUE(ours.was_received() && volatile_one.was_received());
  // What is best effort may be lost on its way: again, until one arrives.
  const auto written = [&] { return json::parse(contents(folder.path() / "record.json"), nullptr, false); };
  unreliable.write(1);
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  EXPECT_GE(written()["messages"]["/robot/status"], 40);
  EXPECT_LE(written()["messages"]["/robot/status"], 41);
  EXPECT_EQ(written()["lost"]["/robot/status"], 0);
}

TEST_F(Record, GlobsChooseTopics) {
  record({"/a/*", "*pose*", "/absent*", "--exclude", "/a/secret"});
  // Who hears of the later ones has heard of these.
  Publisher secret(domain, "/a/secret", kDeepRetained), other(domain, "/other", kDeepRetained);
  Publisher taken_one(domain, "/a/b/c", kDeep), pose(domain, "/x/pose", kDeep);
  secret.write(1);
  other.write(1);
  ASSERT_TRUE(taken_one.is_heard() && pose.is_heard());
  taken_one.write(1);
  pose.write(1);
  ASSERT_TRUE(taken_one.was_received() && pose.was_received());

  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  EXPECT_THAT(topics_of(bag()), UnorderedElementsAre("/a/b/c", "/x/pose"));
  EXPECT_THAT(recorder->err(), AllOf(HasSubstr("/absent*: no topic of that name"), HasSubstr("/other")));
  EXPECT_EQ(secret.is_heard(0) + other.is_heard(0), 2);
}

TEST_F(Record, LeavesOutHiddenTopicsUnlessAGlobNamesThem) {
  record({});
  Publisher hidden(domain, "/a/_action/status", kDeepRetained), open(domain, "/a/b", kDeep);
  ASSERT_TRUE(open.is_heard());
  open.write(1);
  ASSERT_TRUE(open.was_received());
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();
  EXPECT_THAT(topics_of(bag()), ElementsAre("/a/b"));

  record({"/a/*", "-o", folder.path() / "all"});
  ASSERT_TRUE(hidden.is_heard());
  hidden.write(1);
  ASSERT_TRUE(hidden.was_received());
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();
  EXPECT_THAT(topics_of(folder.path() / "all"), ElementsAre("/a/_action/status"));
}

TEST_F(Record, NamesTypesItDoesNotKnowAndLeavesThemOut) {
  record({"/x", "/y"});
  Publisher unknown(domain, "/x", kDeep, "robots_of_others_msgs/msg/Wheel"), known(domain, "/y", kDeep);

  EXPECT_TRUE(
      recorder->says("/x: the definition of type robots_of_others_msgs/msg/Wheel is unknown; left out", kPatience))
      << recorder->err();
  ASSERT_TRUE(known.is_heard());
  known.write(1);
  ASSERT_TRUE(known.was_received());
  ASSERT_EQ(stop_recorder(), 0);
  EXPECT_THAT(topics_of(bag()), ElementsAre("/y"));
}

// From the wire into a bag, out of it again, and as JSON: the bag alone says what the type is.
TEST_F(Record, TakesTypesOfUsersByTheirMsgFiles) {
  record({"/wheel", "--messages", kMessageFolder});
  {
    const auto participant = wire::Participant::open({.domain = domain}).value();
    wire::RawWriter writer(participant, {"rt/wheel", *wire::wire_type(kWheelType), kDeep});
    ASSERT_TRUE(writer.wait_for_readers(in(kPatience))) << recorder->err();
    ASSERT_TRUE(writer.write(wheel()));
    ASSERT_TRUE(writer.wait_until_received(in(kPatience)));
  }
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  const auto exported = program("jostle_bag", {"export", bag(), "--json"});
  ASSERT_EQ(exported->wait(kPatience), 0) << exported->err();
  EXPECT_EQ(json::parse(exported->out())["message"],
            json::parse(R"({"header": {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": "a"}, "speed": 1.5,
                            "treads": [{"wear": 0.25, "codes": [7, 8]}]})"));

  const wire::RawTopic topic{"rt/wheel", *wire::wire_type(kWheelType), kDeep};
  const auto listener = wire::Participant::open({.domain = domain}).value();
  std::mutex mutex;
  std::vector<std::vector<std::byte>> heard;
  wire::RawReader reader(listener, topic, [&](std::span<const std::byte> bytes, const wire::Origin&) {
    const std::lock_guard lock(mutex);
    heard.emplace_back(bytes.begin(), bytes.end());
  });
  const auto player = program("jostle_play", {bag(), "--wait-for-subscribers=1"});
  ASSERT_EQ(player->wait(kPatience), 0) << player->err();
  EXPECT_TRUE(soon(kPatience, [&] {
    const std::lock_guard lock(mutex);
    return heard == std::vector<std::vector<std::byte>>{wheel()};
  }));
}

TEST_F(Record, NamesTopicsWhoseWriterOffersWhatNobodyTakes) {
  record({"/x", "/y"});
  const auto participant = wire::Participant::open({.domain = domain}).value();
  const std::string type = *wire::wire_type("sensor_msgs/msg/JointState");
  const wire::RawWriter registers(participant, {"rt/z", type, kDeep});
  auto& core = participant.core();
  auto* topic = core.participant->create_topic("rt/x", type, eprosima::fastdds::dds::TOPIC_QOS_DEFAULT);
  ASSERT_TRUE(topic);
  eprosima::fastdds::dds::DataWriterQos exclusive;
  exclusive.ownership().kind = eprosima::fastdds::dds::EXCLUSIVE_OWNERSHIP_QOS;
  ASSERT_TRUE(core.publisher->create_datawriter(topic, exclusive));
  const wire::RawWriter plain_one(participant, {"rt/y", type, kDeep});  // announced after it
  ASSERT_TRUE(plain_one.wait_for_readers(in(kPatience)));

  ASSERT_EQ(stop_recorder(), 0);

  EXPECT_THAT(recorder->err(), HasSubstr("/x: it has a writer and none of its messages came"));
  EXPECT_THAT(recorder->err(), Not(HasSubstr("/y: it has a writer")));
}

TEST_F(Record, RingIsWrittenWhenASignalOrAMessageSaysSo) {
  record({"/x", "/map", "--ring", "3600"});
  Publisher x(domain, "/x", kDeep), map(domain, "/map", {.latched = true, .depth = 1});
  ASSERT_TRUE(x.is_heard() && map.is_heard());
  map.write(1);
  x.write(10);
  ASSERT_TRUE(x.was_received() && map.was_received());

  recorder->signal(SIGUSR1);
  ASSERT_TRUE(recorder->says("wrote " + bag("-1"), kPatience)) << recorder->err();
  x.write(10);
  ASSERT_TRUE(x.was_received());
  Publisher trigger(domain, "/record/trigger", kTask, "std_msgs/msg/Empty");
  ASSERT_TRUE(trigger.is_heard());
  trigger.write(1);
  ASSERT_TRUE(recorder->says("wrote " + bag("-2"), kPatience)) << recorder->err();
  ASSERT_EQ(stop_recorder(), 0);

  EXPECT_EQ(texts_of(messages_of("/x", bag("-1"))), numbers(0, 10));
  EXPECT_EQ(texts_of(messages_of("/x", bag("-2"))), numbers(0, 20));
  EXPECT_EQ(texts_of(messages_of("/map", bag("-2"))), numbers(0, 1));
  EXPECT_FALSE(std::filesystem::exists(bag("-3")));
  EXPECT_EQ(summary()["bags"].size(), 2u);
}

TEST_F(Record, RingForgetsTheOldButNotWhatLatchedTopicsLastSaid) {
  std::filesystem::create_directories(bag("-1"));  // of an earlier recorder
  record({"/x", "/map", "--ring", "3600", "--max-memory", "40000"});
  Publisher x(domain, "/x", kDeep), map(domain, "/map", {.latched = true, .depth = 1});
  ASSERT_TRUE(x.is_heard() && map.is_heard());
  map.write(2);
  ASSERT_TRUE(map.was_received());
  // More than fits; in portions that do.
  const auto pushes_out = [&] {
    x.write(5, 503);
    return x.was_received() && recorder->err().find("--max-memory") != std::string::npos;
  };
  ASSERT_TRUE(soon(kPatience, pushes_out)) << recorder->err();

  recorder->signal(SIGUSR1);
  ASSERT_TRUE(recorder->says("wrote " + bag("-2"), kPatience)) << recorder->err();
  ASSERT_EQ(stop_recorder(), 0);

  const auto maps = messages_of("/map", bag("-2")), rest = messages_of("/x", bag("-2"));
  ASSERT_EQ(texts_of(maps), numbers(1, 2));
  ASSERT_FALSE(rest.empty());
  EXPECT_LT(rest.size(), static_cast<std::size_t>(x.sent));
  EXPECT_LE(maps.front().log_time, rest.front().log_time);
}

TEST_F(Record, SplitsBySizeAndEveryMessageIsThereOnce) {
  record({"/x", "--split-size", "20000", "--no-compress"});
  Publisher x(domain, "/x", kDeep);
  ASSERT_TRUE(x.is_heard());
  x.write(200, 1003);
  ASSERT_TRUE(x.was_received());

  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  EXPECT_EQ(messages_of("/x", bag()).size(), 200u);
  const auto reader = taken(bags::open_bag(bag(), false));
  EXPECT_GE(reader->info().files.size(), 2u);
}

TEST_F(Record, KilledItLeavesAllButTheLastSecond) {
  record({"/x"});
  Publisher x(domain, "/x", kDeep);
  ASSERT_TRUE(x.is_heard());
  // Keeps writing until the file shows that samples are being flushed, then a second more.
  std::map<int, Clock::time_point> when;
  const auto file = std::filesystem::path(bag()) / "bag_0.mcap";
  const auto begin = Clock::now();
  std::uintmax_t size = 0;
  int growths = 0;
  ASSERT_TRUE(soon(kPatience, [&] {
    when[x.sent] = Clock::now();
    x.write(1);
    std::error_code ignored;
    const auto now = std::filesystem::file_size(file, ignored);
    if (now > size) size = now, ++growths;
    return growths >= 4 && Clock::now() - begin > 2s;
  })) << recorder->err();
  const auto killed = Clock::now();
  recorder->signal(SIGKILL);
  recorder->wait(kPatience);

  const auto recovered = texts_of(messages_of("/x", bag(), true));

  ASSERT_FALSE(recovered.empty());
  EXPECT_EQ(recovered, numbers(0, static_cast<int>(recovered.size())));
  const auto missed = when.find(static_cast<int>(recovered.size()));
  if (missed != when.end()) {
    EXPECT_GE(missed->second, killed - 1s) << recovered.size() << " of " << x.sent;
  }
}

TEST_F(Record, FullDiskEndsItCleanlyWithWhatFits) {
  record({"/x", "--no-compress"});
  const rlimit limit{.rlim_cur = 3'000'000, .rlim_max = 3'000'000};
  ASSERT_EQ(prlimit(recorder->pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  Publisher x(domain, "/x", kDeep);
  ASSERT_TRUE(x.is_heard());
  const auto ended = [&] {
    x.write(100, 1003);
    return recorder->code().has_value();
  };

  ASSERT_TRUE(soon(kPatience, ended)) << recorder->err();

  EXPECT_EQ(recorder->code(), 3);
  EXPECT_THAT(recorder->err(), HasSubstr("bag_0.mcap"));
  const auto recovered = texts_of(messages_of("/x", bag(), true));
  EXPECT_FALSE(recovered.empty());
  const int lost = summary()["lost"]["/x"], kept = summary()["messages"]["/x"];
  EXPECT_GE(recovered.size(), static_cast<std::size_t>(kept));
  EXPECT_GT(lost, 0);
}

// Runs on a disk of so many bytes, mounted at `place` for the thread it runs on and what that
// starts.
void on_a_small_disk(const std::filesystem::path& place, int bytes, const std::function<void()>& act) {
  bool mounted = false;
  std::thread([&] {
    std::filesystem::create_directories(place);
    const std::string size = fmt::format("size={}", bytes);
    mounted = unshare(CLONE_FS | CLONE_NEWNS) == 0 && mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
              mount("tmpfs", place.c_str(), "tmpfs", 0, size.c_str()) == 0;
    if (mounted) act();
  }).join();
  if (!mounted) throw std::runtime_error("a disk cannot be mounted");
}

TEST_F(Record, SmallDiskThatFillsUpEndsItCleanlyWithWhatFits) {
  on_a_small_disk(folder.path() / "disk", 6'000'000, [&] {
    record({"/x", "--no-compress", "-o", folder.path() / "disk" / "bag"});
    Publisher x(domain, "/x", kDeep);
    ASSERT_TRUE(x.is_heard());
    ASSERT_TRUE(soon(kPatience, [&] { return x.write(100, 1003), recorder->code().has_value(); })) << recorder->err();

    EXPECT_EQ(recorder->code(), 3);
    EXPECT_THAT(recorder->err(), HasSubstr("No space left"));
    const auto recovered = texts_of(messages_of("/x", folder.path() / "disk" / "bag", true));
    EXPECT_GE(recovered.size(), summary()["messages"]["/x"].get<std::size_t>());
    EXPECT_EQ(recovered, numbers(0, static_cast<int>(recovered.size()), 1003));
    EXPECT_GT(recovered.size(), 1000u);
  });
}

TEST_F(Record, EndsBeforeASmallDiskIsFullAndNothingItTookIsLost) {
  on_a_small_disk(folder.path() / "disk", 24'000'000, [&] {
    recorder = program("jostle_record", {"/x", "--no-compress", "--min-free", "12MB", "--json",
                                         folder.path() / "record.json", "-o", folder.path() / "disk" / "bag"});
    ASSERT_TRUE(recorder->says("ready", kPatience)) << recorder->err();
    Publisher x(domain, "/x", kDeep);
    ASSERT_TRUE(x.is_heard());
    ASSERT_TRUE(soon(kPatience, [&] { return x.write(50, 1003), recorder->code().has_value(); })) << recorder->err();

    EXPECT_EQ(recorder->code(), 3);
    EXPECT_THAT(recorder->err(), HasSubstr("--min-free"));
    const auto texts = texts_of(messages_of("/x", folder.path() / "disk" / "bag"));
    EXPECT_EQ(texts, numbers(0, static_cast<int>(texts.size()), 1003));
    EXPECT_EQ(summary()["messages"]["/x"], texts.size());
    EXPECT_EQ(summary()["lost"]["/x"], 0);
  });
}

TEST_F(Record, RefusesToStartWithLessFreeDiskThanAskedFor) {
  const auto refused = program("jostle_record", {"-o", bag(), "--min-free", "1000000TB"});

  EXPECT_EQ(refused->wait(kPatience), 3);
  EXPECT_THAT(refused->err(), HasSubstr("--min-free"));
  EXPECT_FALSE(std::filesystem::exists(bag()));
}

TEST_F(Record, RefusesAFolderThatIsThere) {
  std::filesystem::create_directories(bag());
  folder.write("bag/precious", "data");

  const auto refused = program("jostle_record", {"-o", bag()});

  EXPECT_EQ(refused->wait(kPatience), 2);
  EXPECT_THAT(refused->err(), HasSubstr(bag()));
}

TEST_F(Record, WhatHasNoRoomIsCountedAndTheBagSaysSo) {
  record({"/x", "/y", "--max-memory", "10000"});
  Publisher x(domain, "/x", kDeep), y(domain, "/y", kDeep);
  ASSERT_TRUE(x.is_heard() && y.is_heard());
  x.write(1000, 503);
  ASSERT_TRUE(x.was_received());

  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  const int recorded = static_cast<int>(messages_of("/x", bag()).size()), lost = summary()["lost"]["/x"];
  EXPECT_GT(lost, 0);
  EXPECT_EQ(recorded + lost, 1000);
  auto notes = notes_of(bag());
  EXPECT_EQ(notes["lost"]["/x"], std::to_string(lost));
  EXPECT_EQ(notes["lost"]["/y"], "0");
  EXPECT_THAT(notes["record"]["options"], HasSubstr("--max-memory 10000"));
  EXPECT_NE(notes["record"]["version"], "");
  EXPECT_THAT(recorder->err(), HasSubstr("/x: lost " + std::to_string(lost)));
}

// A writer whose history is too short for its pace: what it overwrites before it is
// delivered shows as a gap in its numbers.
TEST_F(Record, GapsOfAWriterAreCounted) {
  record({"/x"});
  Publisher x(domain, "/x", {.depth = 1});
  ASSERT_TRUE(x.is_heard());
  recorder->signal(SIGSTOP);
  x.write(20'000, 1003);  // far more than a socket holds
  recorder->signal(SIGCONT);
  x.write(1);
  ASSERT_TRUE(x.was_received());

  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  const auto texts = texts_of(messages_of("/x", bag()));
  ASSERT_GE(texts.size(), 2u);
  const int span = std::stoi(texts.back()) - std::stoi(texts.front()) + 1;
  EXPECT_EQ(summary()["lost"]["/x"], span - static_cast<int>(texts.size()));
  EXPECT_GT(summary()["lost"]["/x"], 0);
}

TEST_F(Record, TakesKeyedTopicsOfTheSystemWhenAskedTo) {
  record({"/pool/*"});

  start_planning();  // until the recorder has found everybody, however busy the machine is
  for (const char* topic : {"/pool/world", "/pool/worker"}) {
    EXPECT_TRUE(soon(kPatience, [&] { return !messages_of(topic, bag() + "/bag_0.mcap", true).empty(); })) << topic;
  }
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  EXPECT_THAT(topics_of(bag()), IsSupersetOf({"/pool/world", "/pool/worker"}));
}

TEST_F(Record, OfAWholeRunIsOneOption) {
  const std::string result = folder.path() / "result.json";

  ASSERT_EQ(finish({easy, "--workers", "1", "--parameters", plain, "--record", bag(), "--json", result}), 0)
      << run->err();

  EXPECT_EQ(messages_of("/task/goal", bag()).size(), 1u);
  EXPECT_EQ(messages_of("/task/result", bag()).size(), 1u);
  // A command is repeated as long as it is at work.
  std::set<std::vector<std::byte>> commands;
  for (const bags::Message& message : messages_of("/robot/command", bag())) commands.insert(message.data);
  EXPECT_EQ(commands.size(), json::parse(contents(result))["actions"].get<std::size_t>() + 1);
  EXPECT_THAT(topics_of(bag()), Not(Contains(HasSubstr("/pool/"))));
  auto notes = notes_of(bag());
  for (const auto& [topic, lost] : notes["lost"]) EXPECT_EQ(lost, "0") << topic;
  EXPECT_THAT(run->left_over(), ::testing::IsEmpty());

  EXPECT_EQ(finish({easy, "--record", bag()}), 2);
  EXPECT_THAT(run->err(), HasSubstr(bag()));
}

TEST_F(Record, RunWhoseRecorderStoodStillSaysWhatIsMissing) {
  start({easy, "--workers", "1", "--parameters", plain, "--record", bag(), "--rate", "2"});
  ASSERT_TRUE(soon(kPatience, [&] { return executed(1) || run->code(); })) << run->err();
  kill(run->child("jostle_record"), SIGSTOP);

  EXPECT_EQ(run->wait(kPatience), 3) << run->err();

  EXPECT_THAT(run->out(), HasSubstr("SUCCESS"));
  EXPECT_THAT(run->err(), HasSubstr("the recording " + bag() + " is not complete"));
  EXPECT_THAT(run->err(), HasSubstr("messages of /task/observation"));
  EXPECT_THAT(run->err(), HasSubstr("messages of /task/result"));
}

TEST_F(Record, RunWhoseRecorderDiedSaysSo) {
  start({easy, "--workers", "1", "--parameters", plain, "--record", bag(), "--rate", "2"});
  ASSERT_TRUE(soon(kPatience, [&] { return executed(1) || run->code(); })) << run->err();
  kill(run->child("jostle_record"), SIGKILL);

  EXPECT_EQ(run->wait(kPatience), 3) << run->err();

  EXPECT_THAT(run->err(), HasSubstr("the recorder ended: killed by signal 9"));
  EXPECT_THAT(run->err(), HasSubstr("the recording " + bag() + " is not complete"));
}

TEST_F(Record, StartedStoppedAndStartedAgainDuringARunChangesNothing) {
  const std::string result = folder.path() / "result.json";
  const std::vector<std::string> task{easy, "--workers", "2", "--parameters", plain, "--json", result};
  ASSERT_EQ(finish(task), 0) << run->err();
  const json alone = json::parse(contents(result));

  auto slowly = task;
  slowly.insert(slowly.end(), {"--rate", "2"});
  start(slowly);
  const auto after = [&](int actions) {
    return soon(kPatience, [&] { return executed(actions) || run->code(); }) && !run->code();
  };
  ASSERT_TRUE(after(1)) << run->err();
  record({"-o", bag("-stopped")});
  ASSERT_TRUE(after(2)) << run->err();
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();
  record({"-o", bag("-again")});
  EXPECT_EQ(run->wait(kPatience), 0) << run->err();
  ASSERT_EQ(stop_recorder(), 0) << recorder->err();

  EXPECT_EQ(json::parse(contents(result))["plan_hash"], alone["plan_hash"]);
  EXPECT_EQ(json::parse(contents(result))["actions"], alone["actions"]);
  // What its writers keep is in the bag of who came late.
  EXPECT_EQ(messages_of("/task/goal", bag("-again")).size(), 1u);
}

}  // namespace
}  // namespace jostle::tests
