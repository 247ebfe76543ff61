// NatNet's messages: the bytes of the protocol, and what becomes of others.

#include <gmock/gmock.h>

#include <cstring>
#include <limits>
#include <random>

#include "perception/natnet/messages.hpp"

namespace jostle::perception::natnet {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr Version kVersions[] = {{3, 0}, {3, 1}, {4, 0}, {4, 1}};

Frame frame_of(std::vector<Body> bodies) {
  return {.number = 7,
          .bodies = std::move(bodies),
          .markers = {{.id = 1 << 16 | 2, .position = {1, 2, 3}, .size = 0.014F, .flags = 8, .residual = 0.001F}},
          .timestamp = 12.5,
          .mid_exposure = 100,
          .received = 200,
          .sent = 300,
          .models_changed = true};
}

const Body kCan{.id = 3, .position = {0.5F, -0.25F, 1}, .orientation = {0.5F, 0.5F, -0.5F, 0.5F}, .mean_error = 0.001F};

TEST(NatNetBytes, AreThoseOfTheProtocol) {
  EXPECT_THAT(encode(Message{MessageId::kKeepAlive, {}}), ElementsAre(10, 0, 0, 0));
  EXPECT_THAT(encode(Message{MessageId::kEcho, {1, 2}}), ElementsAre(12, 0, 2, 0, 1, 2));
  const Bytes info = encode(ServerInfo{.name = "me",
                                       .app_version = {1, 2, 3, 4},
                                       .natnet_version = {3, 1, 0, 0},
                                       .clock_hz = 0x0102030405060708,
                                       .data_port = 1511,
                                       .multicast = true,
                                       .group = {239, 255, 42, 99}});
  ASSERT_EQ(info.size(), 279u);
  EXPECT_THAT(Bytes(info.begin(), info.begin() + 3), ElementsAre('m', 'e', 0));
  EXPECT_THAT(Bytes(info.begin() + 256, info.end()),
              ElementsAre(1, 2, 3, 4, 3, 1, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 0xE7, 5, 1, 239, 255, 42, 99));
  EXPECT_THAT(encode(std::vector<Model>{{.id = 5, .name = "can"}}, {4, 1}),
              ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 28, 0, 0, 0, 'c', 'a', 'n', 0, 5, 0, 0, 0, 255, 255, 255, 255, 0, 0,
                          0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
}

// One body and no marker; 1.0 is 0x3F800000, the double 0x3FF0000000000000.
TEST(NatNetBytes, OfAFrameAreThoseOfTheProtocol) {
  Frame frame{.number = 2, .bodies = {{.id = 3, .position = {1, 0, 0}, .orientation = {1, 0, 0, 0}}}, .timestamp = 1.0};
  const auto join = [](std::initializer_list<Bytes> parts) {
    Bytes all;
    for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
  };
  const Bytes none(4, 0), one{0, 0, 0x80, 0x3F};
  const Bytes body = join({{3, 0, 0, 0}, one, none, none, none, none, none, one, none, {1, 0}});
  const Bytes end = join({{0, 0, 0, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0, 0xF0, 0x3F}, Bytes(24, 0)});
  EXPECT_EQ(encode(frame, {3, 1}),
            join({{2, 0, 0, 0}, none, none, {1, 0, 0, 0}, body, none, none, none, none, end, Bytes(6, 0)}));
  EXPECT_EQ(encode(frame, {4, 1}), join({{2, 0, 0, 0},
                                         Bytes(8, 0),
                                         Bytes(8, 0),
                                         {1, 0, 0, 0, 38, 0, 0, 0},
                                         body,
                                         Bytes(8, 0),
                                         Bytes(8, 0),
                                         Bytes(8, 0),
                                         Bytes(8, 0),
                                         Bytes(8, 0),
                                         end,
                                         Bytes(8, 0),
                                         Bytes(6, 0)}));
}

TEST(NatNetMessages, AreReadAsTheyWereWritten) {
  for (const Version version : kVersions) {
    Body hidden = kCan;
    hidden.tracked = false;
    const Frame frame = frame_of({kCan, hidden});
    EXPECT_EQ(*decode_frame(encode(frame, version), version), frame);
    const std::vector<Model> models{{.id = 1, .name = "can"}, {.id = -2, .name = ""}};
    EXPECT_EQ(*decode_models(encode(models, version), version), models);
  }
  const ServerInfo info{.name = "jostle", .natnet_version = {4, 1, 0, 0}, .clock_hz = 1, .group = {1, 2, 3, 4}};
  EXPECT_EQ(*decode_server_info(encode(info)), info);
  const Message message{MessageId::kText, {'h', 'i'}};
  EXPECT_EQ(*decode(encode(message)), message);
}

// Skeletons, sets of markers and devices come from others, and are passed over.
TEST(NatNetMessages, OfOthersHaveMoreInThem) {
  LittleEndianWriter out;
  const auto name = [&](std::string_view text) { out.put(text).put(std::uint8_t{0}); };
  const auto count = [&](std::int32_t n) { out.put(n); };
  const auto floats = [&](int n) {
    for (int i = 0; i < n; ++i) out.put(1.0F);
  };
  const auto body = [&](std::int32_t id) {
    count(id), floats(3 + 4 + 1);
    out.put(std::int16_t{1});
  };
  count(9);
  count(2), name("can"), count(2), floats(6), name("all"), count(0);  // marker sets
  count(3), floats(9);                                                // other markers
  count(1), body(4);
  count(1), count(6), count(2), body(1), body(2);                          // a skeleton
  count(0);                                                                // labelled markers
  count(1), count(1), count(2), count(1), floats(1), count(3), floats(3);  // a force plate
  count(1), count(2), count(1), count(2), floats(2);                       // a device
  out.put(std::uint64_t{0}).put(3.0).put(std::uint64_t{1}).put(std::uint64_t{2}).put(std::uint64_t{3});
  out.put(std::int16_t{0}).put(std::int32_t{0});
  const auto frame = decode_frame(out.bytes(), {3, 1});
  ASSERT_TRUE(frame) << frame.error().message;
  ASSERT_EQ(frame->bodies.size(), 1u);
  EXPECT_EQ(frame->bodies[0].id, 4);
  EXPECT_EQ(frame->timestamp, 3.0);
  EXPECT_EQ(frame->sent, 3u);
  EXPECT_FALSE(frame->models_changed);
}

TEST(NatNetMessages, CutAtAnyByteAreRefused) {
  for (const Version version : kVersions) {
    const Bytes frame = encode(frame_of({kCan}), version), models = encode(std::vector<Model>{{1, "can"}}, version);
    for (std::size_t size = 0; size < frame.size(); ++size) {
      const auto cut = decode_frame(std::span(frame).first(size), version);
      ASSERT_FALSE(cut) << size;
      EXPECT_EQ(cut.error().code, Code::kInvalidArgument);
      EXPECT_THAT(cut.error().message, HasSubstr("natnet frame"));
    }
    for (std::size_t size = 0; size < models.size(); ++size) {
      EXPECT_FALSE(decode_models(std::span(models).first(size), version)) << size;
    }
  }
  const Bytes info = encode(ServerInfo{.clock_hz = 1});
  for (std::size_t size = 0; size < info.size(); ++size) EXPECT_FALSE(decode_server_info(std::span(info).first(size)));
  const Bytes message = encode(Message{MessageId::kText, {1, 2, 3}});
  for (std::size_t size = 0; size < message.size(); ++size) EXPECT_FALSE(decode(std::span(message).first(size)));
}

TEST(NatNetMessages, CountsAndPosesThatCannotBeAreRefused) {
  for (const std::int32_t count : {-1, 2, 1 << 30, std::numeric_limits<std::int32_t>::min()}) {
    Bytes frame = encode(frame_of({kCan}), {3, 1});
    std::memcpy(frame.data() + 12, &count, sizeof count);  // of the bodies
    if (count != 2) {
      EXPECT_FALSE(decode_frame(frame, {3, 1})) << count;
    }
  }
  Body lost = kCan;
  lost.position[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(decode_frame(encode(frame_of({lost}), {4, 1}), {4, 1}).error().message, HasSubstr("pose of 3"));
  lost.tracked = false;
  EXPECT_TRUE(decode_frame(encode(frame_of({lost}), {4, 1}), {4, 1}));
}

TEST(NatNetMessages, SpoiltOnesAreReadOrRefused) {
  std::mt19937 random(5);
  for (int i = 0; i < 20'000; ++i) {
    const Version version = kVersions[random() % 4], other = kVersions[random() % 4];
    Bytes frame = encode(frame_of({kCan, kCan}), version),
          models = encode(std::vector<Model>{{1, "a"}, {2, "b"}}, version);
    for (Bytes* bytes : {&frame, &models}) {
      for (unsigned k = 0; k < 1 + random() % 4; ++k)
        (*bytes)[random() % bytes->size()] = static_cast<std::uint8_t>(random());
    }
    if (const auto read = decode_frame(frame, other)) {
      EXPECT_LE(read->bodies.size() + read->markers.size(), frame.size());
    }
    (void)decode_models(models, other);
  }
}

TEST(NatNetMessages, ARequestForAVersionIsUnderstood) {
  const auto asks = [](std::string_view words) {
    return requested_bitstream(std::span(reinterpret_cast<const std::uint8_t*>(words.data()), words.size()));
  };
  EXPECT_EQ(asks("Bitstream,4.1"), (Version{4, 1}));
  EXPECT_EQ(asks(std::string_view("Bitstream,3.0\0", 14)), (Version{3, 0}));
  EXPECT_EQ(asks("Bitstream,3"), (Version{3, 0}));
  for (const char* words :
       {"", "FrameRate", "Bitstream", "Bitstream,", "Bitstream,x.1", "Bitstream,3.", "Bitstream,999.0"})
    EXPECT_EQ(asks(words), std::nullopt) << words;
}

}  // namespace
}  // namespace jostle::perception::natnet
