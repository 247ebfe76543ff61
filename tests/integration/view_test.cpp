// jostle view, with viewers that are not its own page: what they get, and what they cannot do to it.

#include <gmock/gmock.h>

#include <fstream>
#include <regex>
#include <thread>

#include "services/bags/format/bag_writer.hpp"
#include "services/tools/view/bag_source.hpp"
#include "services/tools/view/view_server.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/raw.hpp"
#include "tests/integration/view_client.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/rover.hpp"
#include "tests/support/run_fixture.hpp"
#include "tests/support/test_domain.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using tools::BagSource;
using tools::ViewServer;
using tools::ViewServerOptions;

std::unique_ptr<ViewServer> serve(ViewServerOptions options = {}) {
  options.port = 0;
  return taken(ViewServer::start(std::move(options), {}));
}

std::size_t resident_memory() {
  std::ifstream file("/proc/self/statm");
  std::size_t total = 0, resident = 0;
  file >> total >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

TEST(ViewServer, TellsViewersItsChannelsAndSendsWhatTheySubscribedTo) {
  const auto sut = serve();
  const int chatter = sut->add_channel(string_topic("/chatter"), false);
  ViewClient viewer(sut->port());
  const auto info = viewer.next_op("serverInfo");
  EXPECT_EQ(info["capabilities"], nlohmann::json::array());
  const auto channel = viewer.channel("/chatter");
  EXPECT_EQ(channel["encoding"], "cdr");
  EXPECT_EQ(channel["schemaName"], "std_msgs/msg/String");
  EXPECT_EQ(channel["schemaEncoding"], "ros2msg");
  EXPECT_EQ(channel["schema"], "string data\n");
  const int latched = sut->add_channel(string_topic("/latched"), true);
  sut->send(latched, 5, cdr_of("kept"));
  EXPECT_EQ(viewer.channel("/latched")["id"], latched);

  viewer.subscribe(7, static_cast<std::uint32_t>(latched));
  auto frame = viewer.next_sample();
  EXPECT_EQ(frame.subscription(), 7u);
  EXPECT_EQ(frame.time(), 5);
  EXPECT_EQ(frame.sample(), cdr_of("kept"));
  viewer.subscribe(8, static_cast<std::uint32_t>(chatter));
  viewer.send({{"op", "unsubscribe"}, {"subscriptionIds", {7}}});
  viewer.send({{"op", "getParameters"}, {"parameterNames", nlohmann::json::array()}, {"id", "done"}});
  EXPECT_EQ(viewer.next_op("parameterValues")["id"], "done");
  sut->send(latched, 6, cdr_of("to nobody"));
  sut->send(chatter, 7, cdr_of("hello"));
  frame = viewer.next_sample();
  EXPECT_EQ(frame.subscription(), 8u);
  EXPECT_EQ(frame.sample(), cdr_of("hello"));
}

TEST(ViewServer, AnswersBadRequestsAndGoesOn) {
  const auto sut = serve();
  sut->add_channel(string_topic("/chatter"), false);
  ViewClient viewer(sut->port());
  const auto complaint = [&](const std::string& text) {
    viewer.send_text(text);
    const auto status = viewer.next_op("status");
    EXPECT_EQ(status["level"], 2);
    return status["message"].get<std::string>();
  };
  EXPECT_THAT(complaint("{"), HasSubstr("not JSON"));
  EXPECT_THAT(complaint(std::string(60'000, '[')), HasSubstr("not JSON"));
  EXPECT_THAT(complaint(std::string(30'000, '[') + std::string(30'000, ']')), HasSubstr("more than 64 deep"));
  EXPECT_THAT(complaint("[1]"), HasSubstr("wanted an object"));
  EXPECT_THAT(complaint(R"({"op":"advertise","channels":[]})"), HasSubstr("this server only shows"));
  EXPECT_THAT(complaint(R"({"op":"subscribe"})"), HasSubstr("subscriptions: got null, wanted a list"));
  EXPECT_THAT(complaint(R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":0}]})"), HasSubstr("id: got -1"));
  EXPECT_THAT(complaint(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":9}]})"), HasSubstr("one of 1"));
  EXPECT_THAT(complaint(R"({"op":"unsubscribe","subscriptionIds":[3]})"), HasSubstr("subscriptionIds: got 3"));
  EXPECT_THAT(complaint(R"({"op":"setParameters","parameters":[{"name":"playback.time","value":1}]})"),
              HasSubstr("there is nothing to set"));
  viewer.send_binary("\x01publish");
  EXPECT_THAT(viewer.next_op("status")["message"].get<std::string>(), HasSubstr("takes no messages"));
  EXPECT_EQ(sut->counts().invalid_requests, 11u);
  EXPECT_EQ(sut->counts().viewers, 1u);

  // One that is too long ends its connection, and no other.
  ViewClient other(sut->port());
  EXPECT_THROW(
      {
        viewer.send_text(std::string(70'000, ' '));
        for (;;) viewer.next();
      },
      boost::system::system_error);
  other.send({{"op", "getParameters"}, {"parameterNames", nlohmann::json::array()}, {"id", "still here"}});
  EXPECT_EQ(other.next_op("parameterValues")["id"], "still here");
}

TEST(ViewServer, LetsInOnlyWhoHasTheRight) {
  const auto sut = serve({.origins = {"https://app.foxglove.dev"}});
  const std::uint16_t port = sut->port();
  const std::string own = "http://localhost:" + std::to_string(port);
  EXPECT_EQ(answer_of(port, "/", upgrade()).result_int(), 101);
  EXPECT_EQ(answer_of(port, "/", upgrade({{"Origin", own}})).result_int(), 101);
  EXPECT_EQ(answer_of(port, "/", upgrade({{"Origin", "https://app.foxglove.dev"}})).result_int(), 101);
  EXPECT_EQ(answer_of(port, "/", upgrade({{"Origin", "https://elsewhere.example"}})).result_int(), 403);
  EXPECT_EQ(answer_of(port, "/", upgrade({{"Origin", "null"}})).result_int(), 403);
  EXPECT_EQ(answer_of(port, "/", upgrade({{"Host", "elsewhere.example"}})).result_int(), 421);
  EXPECT_EQ(answer_of(port, "/", {{"Host", "127.0.0.1.elsewhere.example"}}).result_int(), 421);
  EXPECT_EQ(answer_of(port, "/", upgrade({{"Sec-WebSocket-Protocol", "chat"}})).result_int(), 400);
  EXPECT_EQ(answer_of(port, "/", {}).result_int(), 200);
  EXPECT_EQ(answer_of(port, "/../etc/passwd", {}).result_int(), 404);
  EXPECT_EQ(answer_of(port, "/", {}, http::verb::post).result_int(), 405);

  const auto open = ViewServer::start({.address = "0.0.0.0", .port = 0}, {});
  ASSERT_FALSE(open);
  EXPECT_THAT(open.error().message, HasSubstr("without a token"));
  const auto guarded = serve({.address = "0.0.0.0", .token = "0123456789abcdef"});
  EXPECT_THAT(guarded->url(), HasSubstr("/?token=0123456789abcdef"));
  EXPECT_EQ(answer_of(guarded->port(), "/", upgrade()).result_int(), 401);
  EXPECT_EQ(answer_of(guarded->port(), "/?token=0123456789abcdee", upgrade()).result_int(), 401);
  EXPECT_EQ(answer_of(guarded->port(), "/metrics").result_int(), 401);
  EXPECT_EQ(answer_of(guarded->port(), "/metrics", {{"Authorization", "Bearer 0123456789abcdef"}}).result_int(), 200);
  EXPECT_EQ(answer_of(guarded->port(), "/?a=b&token=0123456789abcdef", upgrade()).result_int(), 101);
}

TEST(ViewServer, CountsForPrometheus) {
  const auto sut = serve();
  const int chatter = sut->add_channel(string_topic("/chatter"), false);
  ViewClient viewer(sut->port());
  viewer.subscribe(0, static_cast<std::uint32_t>(chatter));
  viewer.send({{"op", "getParameters"}, {"parameterNames", nlohmann::json::array()}});
  viewer.next_op("parameterValues");
  sut->send(chatter, 1, cdr_of("one"));
  viewer.next_sample();
  const auto answer = answer_of(sut->port(), "/metrics");
  EXPECT_THAT(answer.body(), HasSubstr("# TYPE jostle_view_viewers gauge\njostle_view_viewers 1\n"));
  EXPECT_THAT(answer.body(), HasSubstr("\njostle_view_channels 1\n"));
  EXPECT_THAT(answer.body(), HasSubstr("\njostle_view_samples_out_total 1\n"));
  EXPECT_THAT(answer.body(), HasSubstr("\njostle_view_dropped_samples_total 0\n"));
}

TEST(ViewServer, DropsForWhoeverNeverReadsAndForNobodyElse) {
  const auto sut = serve({.most_waiting = 1 << 20});
  const int channel = sut->add_channel(string_topic("/big"), false);
  ViewClient reader(sut->port()), sleeper(sut->port());
  for (ViewClient* viewer : {&reader, &sleeper}) {
    viewer->subscribe(0, static_cast<std::uint32_t>(channel));
    viewer->send({{"op", "getParameters"}, {"parameterNames", nlohmann::json::array()}});
    viewer->next_op("parameterValues");
  }
  constexpr int kSamples = 2000;
  const Bytes big = noise(64 << 10, 1);
  const std::size_t before = resident_memory();
  for (int i = 0; i < kSamples; ++i) {
    sut->send(channel, i, big);
    ASSERT_EQ(reader.next_sample().time(), i);
  }
  // 125 MiB came: a queue of 1 MiB, and what two kernels' buffers hold.
  EXPECT_GT(sut->counts().dropped, 1500u);
  EXPECT_LT(resident_memory(), before + (32 << 20));
  // What the sleeper gets when it wakes are older ones and then the newest.
  EXPECT_EQ(sleeper.next([](const auto& frame) { return frame.is_sample() && frame.time() > 1000; }).sample(), big);
}

TEST(ViewServer, ServesTwoHundredAtOnceAndNotOneMoreThanItMay) {
  const auto sut = serve({.most_viewers = 200});
  const int chatter = sut->add_channel(string_topic("/chatter"), true);
  sut->send(chatter, 1, cdr_of("kept"));
  std::vector<std::unique_ptr<ViewClient>> viewers;
  for (int i = 0; i < 200; ++i) viewers.push_back(std::make_unique<ViewClient>(sut->port()));
  for (const auto& viewer : viewers) viewer->subscribe(3, static_cast<std::uint32_t>(chatter));
  for (const auto& viewer : viewers) EXPECT_EQ(viewer->next_sample().sample(), cdr_of("kept"));
  EXPECT_EQ(sut->counts().viewers, 200u);
  EXPECT_EQ(answer_of(sut->port(), "/", upgrade()).result_int(), 503);
  sut->send(chatter, 2, cdr_of("to all"));
  for (const auto& viewer : viewers) EXPECT_EQ(viewer->next_sample().sample(), cdr_of("to all"));
  EXPECT_EQ(sut->counts().dropped, 0u);
  viewers.clear();
  EXPECT_TRUE(soon(kPatience, [&] { return sut->counts().viewers == 0; }));
}

// A bag whose message i says "i", at i times 10 ms.
class ViewOfABag : public ::testing::Test {
 protected:
  static constexpr int kMessages = 100;
  static constexpr bags::Time kBegin = 1'700'000'000'000'000'000;

  void SetUp() override {
    const auto writer = taken(bags::BagWriter::create(folder.path() / "bag", {}));
    const int chatter = taken(writer->add_topic(string_topic("/chatter")));
    for (int i = 0; i < kMessages; ++i) {
      const bags::Time time = kBegin + i * 10'000'000;
      const Bytes data = cdr_of(std::to_string(i));
      taken(writer->write(chatter, {.log_time = time, .publish_time = time, .data = data}));
    }
    taken(writer->close());
    bag = taken(BagSource::open({.bag = folder.path() / "bag", .selection = {}, .paused = true, .on_warning = {}}));
    server = taken(ViewServer::start({.port = 0, .has_playback = true},
                                     {.on_set = [this](const auto& wanted) { return bag->set(wanted); }}));
    player = std::jthread([this](const std::stop_token& stop) { bag->run(*server, stop); });
  }

  void TearDown() override {
    player = {};
    server.reset();
  }

  static nlohmann::json set(const std::string& name, const nlohmann::json& value) {
    return {{"op", "setParameters"}, {"parameters", {{{"name", name}, {"value", value}}}}, {"id", name}};
  }

  static nlohmann::json parameter(ViewClient& viewer, const std::string& name) {
    viewer.send({{"op", "getParameters"}, {"parameterNames", {name}}});
    return viewer.next_op("parameterValues")["parameters"][0]["value"];
  }

  const TempFolder folder;
  std::unique_ptr<BagSource> bag;
  std::unique_ptr<ViewServer> server;
  std::jthread player;
};

TEST_F(ViewOfABag, GoesWhereAViewerWants) {
  ViewClient viewer(server->port());
  EXPECT_THAT(viewer.next_op("serverInfo")["capabilities"], ::testing::Contains("time"));
  viewer.subscribe(0, viewer.channel("/chatter")["id"].get<std::uint32_t>());

  viewer.send(set("playback.time", 0.505));
  bool shown = false, told = false;  // in either order
  while (!shown || !told) {
    const auto frame = viewer.next();
    if (frame.is_sample()) {
      EXPECT_EQ(frame.sample(), cdr_of("50"));
      shown = true;
    }
    told |= frame.is_time() && frame.time() == kBegin + 505'000'000;
  }
  viewer.send(set("playback.time", 0.205));  // and back
  EXPECT_EQ(viewer.next_sample().sample(), cdr_of("20"));

  viewer.send(set("playback.rate", 100.0));
  viewer.send(set("playback.paused", false));
  for (int i = 21; i < kMessages; ++i) EXPECT_EQ(viewer.next_sample().sample(), cdr_of(std::to_string(i)));
  while (parameter(viewer, "playback.paused") == false) {
  }
  viewer.send(set("playback.paused", false));  // at the end: from the beginning
  EXPECT_EQ(viewer.next_sample().sample(), cdr_of("0"));
}

TEST_F(ViewOfABag, ShowsWhoComesLaterWhereItStands) {
  ViewClient first(server->port());
  first.subscribe(0, first.channel("/chatter")["id"].get<std::uint32_t>());
  first.send(set("playback.time", 0.7));
  EXPECT_EQ(first.next_sample().sample(), cdr_of("69"));  // what was recorded exactly then comes next
  ViewClient second(server->port());
  second.subscribe(0, second.channel("/chatter")["id"].get<std::uint32_t>());
  EXPECT_EQ(second.next_sample().sample(), cdr_of("69"));
}

TEST_F(ViewOfABag, RefusesWhatCannotBeSetAndTellsFollowersOfTheRest) {
  ViewClient viewer(server->port()), follower(server->port());
  follower.send({{"op", "subscribeParameterUpdates"}, {"parameterNames", nlohmann::json::array()}});
  for (const auto& [name, value] : std::vector<std::pair<std::string, nlohmann::json>>{
           {"playback.rate", 0.0}, {"playback.rate", true}, {"playback.paused", 1}, {"playback.length", 3}}) {
    viewer.send(set(name, value));
    EXPECT_THAT(viewer.next_op("status")["message"].get<std::string>(), HasSubstr(name)) << value;
  }
  viewer.send(set("playback.rate", 2.5));
  const auto answer = viewer.next_op("parameterValues");
  EXPECT_EQ(answer["id"], "playback.rate");
  EXPECT_THAT(answer["parameters"], ::testing::Contains(nlohmann::json{{"name", "playback.rate"}, {"value", 2.5}}));
  EXPECT_THAT(answer["parameters"], ::testing::Contains(nlohmann::json{{"name", "playback.length"}, {"value", 0.99}}));
  follower.next([](const auto& frame) {
    return frame.op() == "parameterValues" && frame.data.find(R"("playback.rate","value":2.5)") != std::string::npos;
  });
}

class View : public RunFixture {
 protected:
  static std::uint16_t port_in(const std::string& said) {
    std::smatch port;
    if (!std::regex_search(said, port, std::regex("http://127.0.0.1:([0-9]+)/"))) throw std::runtime_error(said);
    return static_cast<std::uint16_t>(std::stoi(port[1]));
  }
};

TEST_F(View, ShowsWhatIsLiveAsItIsOnTheWire) {
  const auto viewing = program("jostle_view", {"--port", "0"});
  ASSERT_TRUE(viewing->says("ready", kPatience)) << viewing->err();
  ViewClient viewer(port_in(viewing->err()));

  const auto participant = taken(wire::Participant::open({.domain = domain}));
  wire::RawWriter writer(
      participant,
      {wire::wire_topic("/chatter"), *wire::wire_type("std_msgs/msg/String"), {.latched = true, .depth = 1}});
  ASSERT_TRUE(writer.write(cdr_of("abc")));
  const auto channel = viewer.channel("/chatter");
  EXPECT_THAT(channel["schema"].get<std::string>(), HasSubstr("string data"));
  viewer.subscribe(0, channel["id"].get<std::uint32_t>());
  EXPECT_EQ(text_of(viewer.next_sample().sample()), "abc");  // kept for whoever subscribes later
  viewing->signal(SIGINT);
  EXPECT_EQ(viewing->wait(kPatience), 0) << viewing->err();
}

TEST_F(View, ShowsTypesOfUsersByTheirMsgFiles) {
  const auto viewing = program("jostle_view", {"--port", "0", "--messages", kMessageFolder});
  ASSERT_TRUE(viewing->says("ready", kPatience)) << viewing->err();
  ViewClient viewer(port_in(viewing->err()));
  const auto participant = taken(wire::Participant::open({.domain = domain}));
  wire::RawWriter writer(participant,
                         {wire::wire_topic("/wheel"), *wire::wire_type(kWheelType), {.latched = true, .depth = 1}});
  ASSERT_TRUE(writer.write(wheel()));

  const auto channel = viewer.channel("/wheel");
  viewer.subscribe(0, channel["id"].get<std::uint32_t>());

  EXPECT_EQ(viewer.next_sample().sample(), wheel());
  EXPECT_EQ(channel["schemaName"], kWheelType);
  EXPECT_THAT(channel["schema"].get<std::string>(), HasSubstr("MSG: rover_msgs/Tread"));
}

// A viewer cancels, and can do nothing else; without --control not even that.
TEST_F(View, CancelsAGoalWhereItMay) {
  const auto viewing = program("jostle_view", {"--port", "0", "--control"});
  const auto looking = program("jostle_view", {"--port", "0"});
  ASSERT_TRUE(viewing->says("ready", kPatience)) << viewing->err();
  ASSERT_TRUE(looking->says("ready", kPatience)) << looking->err();
  ViewClient viewer(port_in(viewing->err())), onlooker(port_in(looking->err()));
  const auto complaint = [](ViewClient& client, const std::string& name, const nlohmann::json& value) {
    client.send({{"op", "setParameters"}, {"parameters", {{{"name", name}, {"value", value}}}}, {"id", "1"}});
    return client.next_op("status")["message"].get<std::string>();
  };
  EXPECT_THAT(complaint(viewer, "task.cancel", true), HasSubstr("wanted a goal that is at work"));
  start_planning();

  EXPECT_THAT(complaint(viewer, "task.cancel", false), HasSubstr("task.cancel: got false"));
  EXPECT_THAT(complaint(viewer, "playback.time", 1.0), HasSubstr("playback.time: got 1.0"));
  EXPECT_THAT(complaint(onlooker, "task.cancel", true), HasSubstr("--control was not given"));
  ASSERT_FALSE(run->code()) << run->err();
  EXPECT_TRUE(soon(kPatience, [&] {  // as soon as it has heard of the goal
    viewer.send(
        {{"op", "setParameters"}, {"parameters", {{{"name", "task.cancel"}, {"value", true}}}}, {"id", "mine"}});
    const auto frame =
        viewer.next([](const auto& one) { return one.op() == "status" || one.op() == "parameterValues"; });
    return frame.op() == "parameterValues";
  }));

  EXPECT_EQ(run->wait(kPatience), 130) << run->err();
  EXPECT_THAT(run->err(), HasSubstr("cancelled"));
}

TEST_F(View, LastsAsLongAsTheRunThatWantsIt) {
  start({easy, "--workers", "2", "--rate", "1", "--parameters", plain, "--view", "0"});
  ASSERT_TRUE(run->says("shown at", kPatience)) << run->err();
  ViewClient viewer(port_in(run->err()));
  viewer.subscribe(0, viewer.channel("/objects/states")["id"].get<std::uint32_t>());
  viewer.next_sample();
  const pid_t viewing = run->child("jostle_view");
  ASSERT_GT(viewing, 0);
  run->signal(SIGINT);
  EXPECT_EQ(run->wait(kPatience), 130) << run->err();
  EXPECT_FALSE(lives(viewing));
}

TEST_F(View, SaysWhatIsWrong) {
  auto viewing = program("jostle_view", {"no-such-bag", "--port", "0"});
  EXPECT_EQ(viewing->wait(kPatience), 2);
  EXPECT_THAT(viewing->err(), HasSubstr("no-such-bag"));
  viewing = program("jostle_view", {"--address", "nowhere"});
  EXPECT_EQ(viewing->wait(kPatience), 2);
  EXPECT_THAT(viewing->err(), HasSubstr("address: got nowhere"));
  const auto taken_port = serve();
  viewing = program("jostle_view", {"--port", std::to_string(taken_port->port())});
  EXPECT_EQ(viewing->wait(kPatience), 3);
  EXPECT_THAT(viewing->err(), HasSubstr("--port 0 takes a free one"));
}

}  // namespace
}  // namespace jostle::tests
