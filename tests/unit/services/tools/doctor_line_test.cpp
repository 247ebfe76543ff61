#include "services/tools/doctor/line.hpp"

#include <gmock/gmock.h>
#include <sys/socket.h>

#include <future>
#include <thread>

#include "tests/support/test_domain.hpp"

namespace jostle::tools {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::HasSubstr;
using tests::in;

constexpr auto kPatience = 60s;
const in_addr kLoopback{htonl(INADDR_LOOPBACK)};

// A port that was free a moment ago.
int free_port() {
  const Socket probe(SOCK_STREAM);
  const sockaddr_in here = endpoint(kLoopback, 0);
  if (bind(probe.get(), generic(here), sizeof here) != 0) throw std::runtime_error(failed_step("bind"));
  return ntohs(own_endpoint(probe)->sin_port);
}

// A door at some port.
struct OpenDoor {
  OpenDoor() {
    for (int attempt = 0; attempt < 20 && !door; ++attempt) {
      port = free_port();
      if (auto door_result = Door::open(port)) door.emplace(std::move(door_result).value());
    }
    if (!door) throw std::runtime_error("no free port");
  }

  int port = 0;
  std::optional<Door> door;
};

// One end is the line, the other what a test likes to send.
class DoctorLine : public testing::Test {
 protected:
  DoctorLine() {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) throw std::runtime_error("no socket pair");
    sut.emplace(Socket::adopt(ends[0]));
    other.emplace(Socket::adopt(ends[1]));
  }

  void send_raw(std::string_view text) {
    ASSERT_EQ(send(other->get(), text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }

  std::string received() {
    char buffer[4096];
    const ssize_t size = recv(other->get(), buffer, sizeof buffer, MSG_DONTWAIT);
    return size < 0 ? "" : std::string(buffer, static_cast<std::size_t>(size));
  }

  std::optional<Line> sut;
  std::optional<Socket> other;
};

TEST_F(DoctorLine, SaysOneValuePerLine) {
  ASSERT_TRUE(sut->say({{"ask", "facts"}}));
  ASSERT_TRUE(sut->say({{"text", "two\nlines"}}));
  EXPECT_EQ(received(), "{\"ask\":\"facts\"}\n{\"text\":\"two\\nlines\"}\n");
}

TEST_F(DoctorLine, SaysWhatIsNoTextWithReplacements) {
  ASSERT_TRUE(sut->say({{"host", "caf\xe9"}}));
  EXPECT_EQ(received(), "{\"host\":\"caf\xef\xbf\xbd\"}\n");
}

TEST_F(DoctorLine, HearsLinesInOrderHoweverTheyAreCut) {
  for (const char* part : {"{\"n\":", "1}\n{\"n\":2}\n{\"n\"", ":3}\n"}) ASSERT_NO_FATAL_FAILURE(send_raw(part));
  for (int n = 1; n <= 3; ++n) EXPECT_EQ(sut->hear(in(kPatience)), json({{"n", n}}));
  EXPECT_FALSE(sut->hear(in(10ms)));
}

TEST_F(DoctorLine, HearsALineThatComesInTwoHalves) {
  ASSERT_NO_FATAL_FAILURE(send_raw("{\"n\":"));
  EXPECT_FALSE(sut->hear(in(10ms)));
  ASSERT_NO_FATAL_FAILURE(send_raw("1}\n"));
  EXPECT_EQ(sut->hear(in(kPatience)), json({{"n", 1}}));
}

TEST_F(DoctorLine, WhatIsNoObjectIsNothing) {
  for (const char* text : {"\n", "hello\n", "{\"n\":\n", "[1]\n", "1\n", "null\n", "\xff\xfe\n", "{} {}\n"}) {
    ASSERT_NO_FATAL_FAILURE(send_raw(text));
    EXPECT_FALSE(sut->hear(in(kPatience))) << text;
  }
}

TEST_F(DoctorLine, DeepNestingIsNothing) {
  ASSERT_NO_FATAL_FAILURE(send_raw(std::string(30'000, '[') + "\n"));
  EXPECT_FALSE(sut->hear(in(kPatience)));
}

TEST_F(DoctorLine, LineWithoutAnEndIsNothing) {
  std::jthread talker([this] {
    const std::string endless(1 << 20, '.');
    while (send(other->get(), endless.data(), endless.size(), MSG_NOSIGNAL) > 0) {
    }
  });
  EXPECT_FALSE(sut->hear(in(kPatience)));
  sut.reset();  // ends the talker
}

TEST_F(DoctorLine, SilenceStopAndAnEndAreNothing) {
  const auto begin = tests::Clock::now();
  EXPECT_FALSE(sut->hear(in(10ms)));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(sut->hear(in(kPatience), stop.get_token()));
  other.reset();
  EXPECT_FALSE(sut->hear(in(kPatience)));
  EXPECT_LT(tests::Clock::now() - begin, kPatience);
}

TEST_F(DoctorLine, NothingCanBeSaidToWhoIsGone) {
  other.reset();
  EXPECT_FALSE(sut->say({{"ask", "facts"}}));
  const auto answer_result = sut->ask({{"ask", "facts"}});
  ASSERT_FALSE(answer_result);
  EXPECT_EQ(answer_result.error().code, Code::kUnavailable);
  EXPECT_THAT(answer_result.error().message, HasSubstr("went silent"));
}

TEST_F(DoctorLine, AsksAndGetsTheAnswer) {
  ASSERT_NO_FATAL_FAILURE(send_raw("{\"answer\":42}\n"));
  const auto answer_result = sut->ask({{"ask", "what"}});
  ASSERT_TRUE(answer_result) << answer_result.error().message;
  EXPECT_EQ(*answer_result, json({{"answer", 42}}));
  EXPECT_EQ(received(), "{\"ask\":\"what\"}\n");
}

TEST_F(DoctorLine, AnswerThatIsNoneIsAnError) {
  ASSERT_NO_FATAL_FAILURE(send_raw("HTTP/1.1 400 Bad Request\r\n"));
  EXPECT_FALSE(sut->ask({{"ask", "what"}}));
}

TEST(DoctorDoor, LetsInWhoConnects) {
  OpenDoor open;
  auto guest = std::async(std::launch::async, [&] { return open.door->next({}); });
  auto line_result = Line::connect(kLoopback, open.port, kPatience);
  ASSERT_TRUE(line_result) << line_result.error().message;
  auto line = guest.get();
  ASSERT_TRUE(line);

  ASSERT_TRUE(line_result->other());
  EXPECT_EQ(to_string(*line->other()), "127.0.0.1");
  ASSERT_TRUE(line_result->say({{"n", 1}}));
  EXPECT_EQ(line->hear(in(kPatience)), json({{"n", 1}}));
  ASSERT_TRUE(line->say({{"n", 2}}));
  EXPECT_EQ(line_result->hear(in(kPatience)), json({{"n", 2}}));
}

TEST(DoctorDoor, StaysShutAfterAStopRequest) {
  OpenDoor open;
  std::stop_source stop;
  auto guest = std::async(std::launch::async, [&] { return open.door->next(stop.get_token()).has_value(); });
  stop.request_stop();
  ASSERT_EQ(guest.wait_for(kPatience), std::future_status::ready);
  EXPECT_FALSE(guest.get());
}

TEST(DoctorDoor, AtATakenPortIsAnErrorThatNamesItAndTheRemedy) {
  const OpenDoor open;
  const auto door_result = Door::open(open.port);
  ASSERT_FALSE(door_result);
  EXPECT_EQ(door_result.error().code, Code::kUnavailable);
  EXPECT_THAT(door_result.error().message, HasSubstr(std::to_string(open.port)));
  EXPECT_THAT(door_result.error().message, HasSubstr("Address already in use"));
  EXPECT_THAT(door_result.error().message, HasSubstr("--port"));
}

TEST(DoctorDoor, WhereNobodyListensTheSystemSaysSo) {
  const auto line_result = Line::connect(kLoopback, free_port(), kPatience);
  ASSERT_FALSE(line_result);
  EXPECT_EQ(line_result.error().code, Code::kUnavailable);
  EXPECT_EQ(line_result.error().message, "Connection refused");
}

}  // namespace
}  // namespace jostle::tools
