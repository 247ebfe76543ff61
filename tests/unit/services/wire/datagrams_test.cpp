// What is let through to the middleware.

#include "services/wire/dds/datagrams.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <random>
#include <vector>

#include "services/wire/limits.hpp"
#include "tests/fuzz/wire/mutation.hpp"

namespace jostle::wire {
namespace {

using namespace std::chrono_literals;
using tests::Bytes;

void append(Bytes& bytes, std::uint64_t number, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(number >> (8 * i)));
}

// High half first, each in little-endian order.
void append_sequence(Bytes& bytes, std::int64_t number) {
  append(bytes, static_cast<std::uint64_t>(number) >> 32, 4);
  append(bytes, static_cast<std::uint64_t>(number), 4);
}

// The header of a message of Fast DDS; `who` tells participants apart.
Bytes header(std::uint8_t who = 1) {
  Bytes bytes{'R', 'T', 'P', 'S', 2, 3, 1, 15};
  bytes.resize(20, who);
  return bytes;
}

Bytes& operator+=(Bytes& bytes, const Bytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
  return bytes;
}

Bytes submessage(std::uint8_t kind, const Bytes& body) {
  Bytes bytes{kind, 1};
  append(bytes, body.size(), 2);
  return bytes += body;
}

constexpr std::uint32_t kWriter = 0xc2030000;

Bytes data(std::int64_t number, std::uint32_t writer = kWriter) {
  Bytes body;
  append(body, 0x00100000, 4);
  append(body, 0, 4);
  append(body, writer, 4);
  append_sequence(body, number);
  return submessage(0x15, body);
}

Bytes heartbeat(std::int64_t first, std::int64_t last, std::uint32_t writer = kWriter) {
  Bytes body;
  append(body, 0, 4);
  append(body, writer, 4);
  append_sequence(body, first);
  append_sequence(body, last);
  append(body, 1, 4);
  return submessage(0x07, body);
}

Bytes gap(std::int64_t start, std::int64_t base, std::uint32_t bits = 0) {
  Bytes body;
  append(body, 0, 4);
  append(body, kWriter, 4);
  append_sequence(body, start);
  append_sequence(body, base);
  append(body, bits, 4);
  return submessage(0x08, body);
}

Bytes fragments(std::uint16_t piece, std::uint32_t sample) {
  Bytes body;
  append(body, 0x00100000, 4);
  append(body, 0, 4);
  append(body, kWriter, 4);
  append_sequence(body, 1);
  append(body, 1, 4);
  append(body, 1, 2);
  append(body, piece, 2);
  append(body, sample, 4);
  return submessage(0x16, body);
}

Bytes statistics(std::size_t size = 56) { return submessage(0x80, Bytes(size, 0)); }

constexpr std::uint16_t kPort = 41000;

Bytes info_source(std::uint8_t who) {
  Bytes body{0, 0, 0, 0, 2, 3, 1, 15};
  body.resize(20, who);
  return submessage(0x0c, body);
}

class Datagrams : public ::testing::Test {
 protected:
  Flaw judge(const Bytes& parts, std::uint8_t who = 1, std::uint16_t port = kPort) {
    Bytes datagram = header(who);
    return sut.judge(datagram += parts, port, now);
  }

  // Somebody's first words, from all of its ports, and time passes.
  void is_known(std::uint8_t who, std::initializer_list<std::uint16_t> ports) {
    for (const std::uint16_t port : ports) ASSERT_EQ(judge(data(1), who, port), Flaw::kNone) << port;
    now += limits::kShowsItsPorts - 1s;
    for (const std::uint16_t port : ports) ASSERT_EQ(judge(data(1), who, port), Flaw::kNone) << port;
    now += 1s;
  }

  Judge sut;
  Judge::TimePoint now = Judge::TimePoint{} + 24h;
};

TEST_F(Datagrams, OfAnOrdinaryExchangePass) {
  EXPECT_EQ(judge(heartbeat(1, 0)), Flaw::kNone);
  for (std::int64_t number = 1; number < 100; ++number) {
    Bytes parts = data(number);
    parts += heartbeat(1, number);
    EXPECT_EQ(judge(parts += statistics()), Flaw::kNone);
  }
  EXPECT_EQ(judge(gap(3, 90)), Flaw::kNone);
  EXPECT_EQ(judge(fragments(65000, 200'000)), Flaw::kNone);
  EXPECT_EQ(judge(submessage(0x09, Bytes{})), Flaw::kNone);    // a time without a time
  EXPECT_EQ(judge(submessage(0x30, Bytes(13))), Flaw::kNone);  // encrypted, of any length
}

TEST_F(Datagrams, WithStatisticsThatAreNotTheLastAreDropped) {
  for (const std::size_t more : {1, 2, 4}) {
    Bytes parts = statistics();
    EXPECT_EQ(judge(parts += Bytes(more, 0)), Flaw::kStatistics) << more;
  }
  Bytes hidden = submessage(0x0e, Bytes(17));  // the middleware looks for statistics without rounding up to four
  EXPECT_EQ(judge((hidden += statistics()) += Bytes(3, 0)), Flaw::kStatistics);
}

TEST_F(Datagrams, ThatAreNoneOrCutAreDropped) {
  EXPECT_EQ(sut.judge({}, kPort, now), Flaw::kMalformed);
  EXPECT_EQ(sut.judge(Bytes(100, 'x'), kPort, now), Flaw::kMalformed);
  for (const Bytes& whole : {data(1), heartbeat(1, 5), gap(1, 2), fragments(1000, 5000)}) {
    for (std::size_t size = 1; size < whole.size(); ++size) {
      EXPECT_NE(judge(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))), Flaw::kNone) << size;
    }
  }
  EXPECT_EQ(judge(gap(1, 2, 257)), Flaw::kMalformed);
}

TEST_F(Datagrams, OfAbsurdNumbersAreDroppedFromStrangersToo) {
  constexpr std::int64_t kAbsurd = std::int64_t{1} << 40;
  EXPECT_EQ(judge(heartbeat(kAbsurd, kAbsurd)), Flaw::kNumber);
  EXPECT_EQ(judge(heartbeat(1, kAbsurd)), Flaw::kNumber);
  EXPECT_EQ(judge(heartbeat(-5, 3)), Flaw::kNumber);
  EXPECT_EQ(judge(data(kAbsurd)), Flaw::kNumber);
  EXPECT_EQ(judge(gap(1, kAbsurd)), Flaw::kNumber);
  EXPECT_EQ(judge(gap(9, 2)), Flaw::kNumber);
}

TEST_F(Datagrams, InTheNameOfAKnownWriterLeapNoFurtherThanItCan) {
  ASSERT_EQ(judge(data(1000)), Flaw::kNone);
  now += 10ms;

  EXPECT_EQ(judge(heartbeat(limits::kFirstNumber / 2, limits::kFirstNumber / 2)), Flaw::kNumber);
  EXPECT_EQ(judge(data(1000 + limits::kNumberLeap)), Flaw::kNone);
  EXPECT_EQ(judge(data(1000 + 2 * limits::kNumberLeap)), Flaw::kNumber);
  EXPECT_EQ(judge(data(1001), 2), Flaw::kNone) << "another participant's numbers are its own";
}

TEST_F(Datagrams, OfAWriterThatWasSilentForLongPass) {
  ASSERT_EQ(judge(data(1000)), Flaw::kNone);
  now += 1h;
  EXPECT_EQ(judge(data(50'000'000)), Flaw::kNone);
}

TEST_F(Datagrams, OfALongLivedWriterPassHoweverHighItsNumbers) {
  std::int64_t number = limits::kFirstNumber;
  ASSERT_EQ(judge(data(number)), Flaw::kNone);
  for (int i = 0; i < 1000; ++i) {
    now += 1s;
    number += 900'000;
    ASSERT_EQ(judge(data(number)), Flaw::kNone) << number;
  }
  EXPECT_GT(number, limits::kFirstNumber + limits::kFirstNumber / 2);
}

// Each costs the middleware so much that strangers could keep it busy.
TEST_F(Datagrams, OfManyLongLivedWritersPassOneAfterTheOther) {
  ASSERT_EQ(judge(data(limits::kFirstNumber)), Flaw::kNone);
  EXPECT_EQ(judge(data(limits::kFirstNumber), 2), Flaw::kNumber);
  EXPECT_EQ(judge(data(limits::kNumberLeap), 3), Flaw::kNone) << "young ones do not wait";
  now += 10min;
  EXPECT_EQ(judge(data(limits::kFirstNumber), 2), Flaw::kNone);
}

TEST_F(Datagrams, WithFragmentsOfGiantsAreDropped) {
  EXPECT_EQ(judge(fragments(65000, UINT32_MAX)), Flaw::kFragments);
  EXPECT_EQ(judge(fragments(4, 200'000'000)), Flaw::kFragments);
  EXPECT_EQ(judge(fragments(0, 1000)), Flaw::kFragments);
}

TEST_F(Datagrams, InTheNameOfSomebodyWhoSendsFromElsewhereAreDropped) {
  is_known(1, {kPort, kPort + 1});

  EXPECT_EQ(judge(data(2), 1, kPort + 2), Flaw::kImpostor);
  Bytes hidden = info_source(1);
  EXPECT_EQ(judge(hidden += data(2), 2, kPort + 2), Flaw::kImpostor);
  EXPECT_EQ(judge(data(2), 1, kPort), Flaw::kNone);
  EXPECT_EQ(judge(data(3), 1, kPort + 1), Flaw::kNone);
  EXPECT_EQ(judge(data(1), 2, kPort + 2), Flaw::kNone) << "another participant's ports are its own";
}

// A network between may give whoever was silent another port.
TEST_F(Datagrams, OfSomebodyWhoWasSilentForLongMayComeFromElsewhere) {
  is_known(1, {kPort});
  ASSERT_EQ(judge(data(2), 1, kPort + 1), Flaw::kImpostor);

  now += limits::kShowsItsPorts;

  EXPECT_EQ(judge(data(2), 1, kPort + 1), Flaw::kNone);
  EXPECT_EQ(judge(data(3), 1, kPort), Flaw::kNone) << "it has both now";
}

TEST_F(Datagrams, OfWhoShowsCountlessPortsAreDroppedFromTheRest) {
  for (std::uint16_t i = 0; i < limits::kPortsOfOne; ++i) ASSERT_EQ(judge(data(1), 1, kPort + i), Flaw::kNone);
  EXPECT_EQ(judge(data(1), 1, kPort - 1), Flaw::kImpostor);
}

// For the sanitizers: what is read lies in the datagram.
TEST_F(Datagrams, ThatAreSpoiltInAnyWayAreJudged) {
  std::mt19937_64 random(1);
  Bytes whole = header();
  for (const Bytes& part : {heartbeat(1, 5), data(3), gap(1, 2), fragments(1000, 5000), statistics()}) whole += part;
  std::map<Flaw, int> judged;
  for (int i = 0; i < 100'000; ++i) {
    const Bytes spoilt = tests::mutated(whole, random() % 4 == 0 ? 0 : 20, random);
    ++judged[sut.judge(std::vector<std::uint8_t>(spoilt), kPort, now)];
  }
  for (const Flaw flaw : {Flaw::kNone, Flaw::kMalformed, Flaw::kStatistics, Flaw::kNumber, Flaw::kFragments}) {
    EXPECT_GT(judged[flaw], 0) << to_string(flaw);
  }
}

TEST_F(Datagrams, OfCountlessParticipantsTakeNoMemoryForEver) {
  Bytes datagram = header();
  for (std::uint32_t i = 0; i < 10 * limits::kParticipantsRemembered; ++i) {
    std::memcpy(datagram.data() + 8, &i, sizeof i);
    ASSERT_EQ(sut.judge(datagram, kPort, now), Flaw::kNone);
  }
  ASSERT_EQ(sut.judge(datagram, kPort + 1, now += 2 * limits::kShowsItsPorts), Flaw::kNone) << "was not remembered";
}

TEST_F(Datagrams, OfCountlessWritersTakeNoMemoryForEver) {
  for (std::uint32_t i = 0; i < 10 * limits::kWritersRemembered; ++i) {
    ASSERT_EQ(judge(data(1, i)), Flaw::kNone);
  }
  EXPECT_EQ(judge(data(limits::kFirstNumber + 1, 0xffffff)), Flaw::kNumber);
}

}  // namespace
}  // namespace jostle::wire
