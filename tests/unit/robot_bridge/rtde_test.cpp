#include "robot_bridge/ur/rtde.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <random>

namespace jostle::robot_bridge::ur::rtde {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Packet only_packet(const Bytes& bytes) {
  PacketStream stream;
  stream.append(bytes);
  auto result = stream.next();
  EXPECT_TRUE(result && *result);
  return result && *result ? **result : Packet{};
}

// What a client and a controller say to each other, as it is on the wire.
TEST(RtdeBytes, AreThoseOfTheProtocol) {
  EXPECT_THAT(encode(protocol_request(2)), ElementsAre(0, 5, 'V', 0, 2));
  EXPECT_THAT(encode(accepted_reply(PacketType::kProtocolVersion, true)), ElementsAre(0, 4, 'V', 1));
  EXPECT_THAT(encode(version_request()), ElementsAre(0, 3, 'v'));
  EXPECT_THAT(encode(version_reply({.major = 3, .minor = 15, .bugfix = 8, .build = 0x01020304})),
              ElementsAre(0, 19, 'v', 0, 0, 0, 3, 0, 0, 0, 15, 0, 0, 0, 8, 1, 2, 3, 4));
  // 125 Hz is 0x405F400000000000.
  EXPECT_THAT(encode(outputs_request(125, {"actual_q", "timestamp"})),
              ElementsAre(0, 29, 'O', 0x40, 0x5F, 0x40, 0, 0, 0, 0, 0, 'a', 'c', 't', 'u', 'a', 'l', '_', 'q', ',', 't',
                          'i', 'm', 'e', 's', 't', 'a', 'm', 'p'));
  EXPECT_THAT(encode(recipe_reply(PacketType::kOutputs, {.id = 1, .types = {"VECTOR6D", "DOUBLE"}})),
              ElementsAre(0, 19, 'O', 1, 'V', 'E', 'C', 'T', 'O', 'R', '6', 'D', ',', 'D', 'O', 'U', 'B', 'L', 'E'));
  EXPECT_THAT(encode(inputs_request({"speed_slider_mask"})).size(), 3u + 17u);
  EXPECT_THAT(encode(start_request()), ElementsAre(0, 3, 'S'));
  EXPECT_THAT(encode(pause_request()), ElementsAre(0, 3, 'P'));
  EXPECT_THAT(encode(text_packet({.level = Text::Level::kWarning, .text = "hot", .source = "me"})),
              ElementsAre(0, 10 + 1, 'M', 3, 'h', 'o', 't', 2, 'm', 'e', 2));
  const Recipe recipe{.id = 7, .names = {"robot_mode", "timestamp"}, .types = {FieldType::kInt32, FieldType::kDouble}};
  EXPECT_THAT(encode(pack(recipe, {std::int32_t{-1}, 1.0})),
              ElementsAre(0, 16, 'U', 7, 0xFF, 0xFF, 0xFF, 0xFF, 0x3F, 0xF0, 0, 0, 0, 0, 0, 0));
}

// As every connection begins, and as it stays with old software.
TEST(RtdeBytes, OfVersion1HaveNoNumbersOfRecipesNoFrequencyAndNoSource) {
  EXPECT_THAT(encode(outputs_request(125, {"robot_mode"}, Version::k1)),
              ElementsAre(0, 13, 'O', 'r', 'o', 'b', 'o', 't', '_', 'm', 'o', 'd', 'e'));
  EXPECT_THAT(encode(recipe_reply(PacketType::kOutputs, {.id = 1, .types = {"INT32"}}, Version::k1)),
              ElementsAre(0, 8, 'O', 'I', 'N', 'T', '3', '2'));
  EXPECT_THAT(encode(text_packet({.level = Text::Level::kWarning, .text = "hot", .source = "me"}, Version::k1)),
              ElementsAre(0, 7, 'M', 2, 'h', 'o', 't'));
  const Recipe recipe{.id = 1, .names = {"robot_mode"}, .types = {FieldType::kInt32}};
  EXPECT_THAT(encode(pack(recipe, {std::int32_t{7}}, Version::k1)), ElementsAre(0, 7, 'U', 0, 0, 0, 7));
}

TEST(RtdeMessages, OfVersion1AreReadAsTheyWereWritten) {
  const auto outputs = read_outputs_request(outputs_request(500, {"actual_q", "robot_mode"}, Version::k1), Version::k1);
  ASSERT_TRUE(outputs);
  EXPECT_EQ(outputs->frequency, 125);
  EXPECT_THAT(outputs->names, ElementsAre("actual_q", "robot_mode"));
  const RecipeReply good{.id = 1, .types = {"DOUBLE", "INT32"}}, refused{.id = 0, .types = {"DOUBLE", "IN_USE"}};
  for (const RecipeReply& reply : {good, refused}) {
    EXPECT_EQ(*read_recipe_reply(recipe_reply(PacketType::kInputs, reply, Version::k1), Version::k1), reply);
  }
  EXPECT_EQ(read_recipe_reply({.type = PacketType::kOutputs, .payload = {}}, Version::k1)->id, 0);
  const Text text{.level = Text::Level::kError, .text = "no", .source = ""};
  EXPECT_EQ(*read_text(text_packet(text, Version::k1), Version::k1), text);
  EXPECT_FALSE(read_text({.type = PacketType::kText, .payload = {}}, Version::k1));
  EXPECT_FALSE(read_text({.type = PacketType::kText, .payload = {4, 'x'}}, Version::k1)) << "a level of 4";
  const Recipe recipe{.id = 1, .names = {"timestamp"}, .types = {FieldType::kDouble}};
  Packet data = pack(recipe, {1.5}, Version::k1);
  EXPECT_EQ(unpack(recipe, data, Version::k1)->front(), Value(1.5));
  EXPECT_FALSE(unpack(recipe, data)) << "one byte is missing in version 2";
  data.payload.pop_back();
  EXPECT_FALSE(unpack(recipe, data, Version::k1));
}

TEST(RtdeMessages, AreReadAsTheyWereWritten) {
  EXPECT_EQ(*read_protocol_request(protocol_request(2)), 2);
  const auto outputs = read_outputs_request(outputs_request(500, {"actual_q", "robot_mode"}));
  ASSERT_TRUE(outputs);
  EXPECT_EQ(outputs->frequency, 500);
  EXPECT_THAT(outputs->names, ElementsAre("actual_q", "robot_mode"));
  EXPECT_THAT(*read_inputs_request(inputs_request({"a", "b"})), ElementsAre("a", "b"));
  EXPECT_TRUE(*read_accepted(accepted_reply(PacketType::kStart, true)));
  EXPECT_FALSE(*read_accepted(accepted_reply(PacketType::kStart, false)));
  const ControllerVersion version{.major = 5, .minor = 11, .bugfix = 1, .build = 99};
  EXPECT_EQ(*read_version(version_reply(version)), version);
  const RecipeReply reply{.id = 3, .types = {"DOUBLE", "NOT_FOUND"}};
  EXPECT_EQ(*read_recipe_reply(recipe_reply(PacketType::kInputs, reply)), reply);
  const Text text{.level = Text::Level::kError, .text = "no", .source = "RTDE"};
  EXPECT_EQ(*read_text(text_packet(text)), text);
}

// A client of another house ends its lists with a comma.
TEST(RtdeMessages, TakeAListThatEndsWithAComma) {
  EXPECT_THAT(*read_inputs_request(inputs_request({"a", "b", ""})), ElementsAre("a", "b"));
  EXPECT_THAT(*read_inputs_request(inputs_request({})), IsEmpty());
}

TEST(RtdeMessages, OfAWrongSizeAreRefusedAtEveryByte) {
  const auto refused = [](Packet packet, auto read) {
    const Bytes whole = packet.payload;
    for (std::size_t size = 0; size < whole.size(); ++size) {
      packet.payload.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_FALSE(read(packet)) << static_cast<char>(packet.type) << " of " << size << " bytes";
    }
  };
  refused(protocol_request(2), read_protocol_request);
  refused(accepted_reply(PacketType::kStart, true), read_accepted);
  refused(version_reply({}), read_version);
  refused(text_packet({.level = Text::Level::kInfo, .text = "hello", .source = "x"}),
          [](const Packet& packet) { return read_text(packet); });
  const Recipe recipe{.id = 1, .names = {"actual_q"}, .types = {FieldType::kVector6d}};
  refused(pack(recipe, {std::array<double, 6>{1, 2, 3, 4, 5, 6}}),
          [&](const Packet& packet) { return unpack(recipe, packet); });
  Packet outputs = outputs_request(125, {});
  refused(outputs, [](const Packet& packet) { return read_outputs_request(packet); });

  Packet longer = version_reply({});
  longer.payload.push_back(0);
  EXPECT_FALSE(read_version(longer)) << "a version of 17 bytes";
}

TEST(RtdeMessages, RefuseFrequenciesThatAreNone) {
  for (const double frequency : {0.0, -1.0, 1e9, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(read_outputs_request(outputs_request(frequency, {"timestamp"}))) << frequency;
  }
}

// TCP keeps bytes in order and nothing else: every cut of a stream gives the same packets.
TEST(RtdeStream, GivesThePacketsHoweverTheyWereCut) {
  Bytes bytes;
  std::vector<Packet> sent{protocol_request(2), outputs_request(125, {"actual_q"}), start_request(),
                           text_packet({.level = Text::Level::kInfo, .text = "hello", .source = "x"})};
  for (const Packet& packet : sent) {
    const Bytes one = encode(packet);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    PacketStream stream;
    std::vector<Packet> got;
    const std::span<const std::uint8_t> all(bytes);
    for (const auto part : {all.first(cut), all.subspan(cut)}) {
      stream.append(part);
      for (;;) {
        auto result = stream.next();
        ASSERT_TRUE(result);
        if (!*result) break;
        got.push_back(**result);
      }
    }
    EXPECT_EQ(got, sent) << "cut at " << cut;
  }
}

TEST(RtdeStream, RefusesASizeThatIsLessThanItsHeader) {
  for (const std::uint8_t size : {0, 1, 2}) {
    PacketStream stream;
    stream.append(Bytes{0, size, 'V'});
    EXPECT_FALSE(stream.next()) << int{size};
  }
}

// Whatever a peer sends: an answer, an error, or patience.
TEST(RtdeStream, SurvivesRandomBytes) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 20'000; ++i) {
    PacketStream stream;
    Bytes bytes(random() % 64);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    if (bytes.size() > 2) bytes[0] = 0, bytes[2] = static_cast<std::uint8_t>("VvMOISPU"[random() % 8]);
    stream.append(bytes);
    for (auto packet = stream.next(); packet && *packet; packet = stream.next()) {
      (void)read_protocol_request(**packet);
      (void)read_outputs_request(**packet);
      (void)read_inputs_request(**packet);
      (void)read_accepted(**packet);
      (void)read_version(**packet);
      (void)read_recipe_reply(**packet);
      (void)read_text(**packet);
      (void)read_outputs_request(**packet, Version::k1);
      (void)read_recipe_reply(**packet, Version::k1);
      (void)read_text(**packet, Version::k1);
    }
  }
}

TEST(RtdeFields, HaveTheTypesOfTheMakersGuide) {
  EXPECT_EQ(output_field("actual_q"), FieldType::kVector6d);
  EXPECT_EQ(output_field("robot_mode"), FieldType::kInt32);
  EXPECT_EQ(output_field("actual_digital_input_bits"), FieldType::kUint64);
  EXPECT_EQ(output_field("joint_mode"), FieldType::kVector6Int32);
  EXPECT_EQ(output_field("output_double_register_47"), FieldType::kDouble);
  EXPECT_EQ(output_field("output_bit_register_64"), FieldType::kBool);
  EXPECT_EQ(output_field("output_bit_registers0_to_31"), FieldType::kUint32);
  EXPECT_EQ(output_field("input_int_register_24"), FieldType::kInt32) << "inputs can be read back";
  EXPECT_EQ(input_field("input_int_register_24"), FieldType::kInt32);
  EXPECT_EQ(input_field("standard_digital_output"), FieldType::kUint8);
  EXPECT_EQ(input_field("external_force_torque"), FieldType::kVector6d);
}

TEST(RtdeFields, ThatControllersDoNotHaveAreNone) {
  for (const char* name :
       {"", "actual_Q", "output_int_register_48", "output_int_register_-1", "output_int_register_007",
        "output_bit_register_63", "output_bit_register_128", "output_double_register_", "output_double_register_1x"}) {
    EXPECT_FALSE(output_field(name)) << name;
  }
  EXPECT_FALSE(input_field("actual_q"));
  EXPECT_FALSE(input_field("output_int_register_1"));
}

TEST(RtdeFields, NamesOfTypesReadBack) {
  for (int i = 0; i < 10; ++i) {
    const auto type = static_cast<FieldType>(i);
    EXPECT_EQ(parse_field_type(name_of(type)), type);
  }
  EXPECT_FALSE(parse_field_type("NOT_FOUND"));
}

TEST(RtdeRecipe, CarriesValuesOfEveryTypeToTheLastBit) {
  const std::vector<Value> values{true,
                                  std::uint8_t{200},
                                  std::int32_t{-5},
                                  std::uint32_t{4'000'000'000},
                                  std::uint64_t{1} << 63,
                                  0.1,
                                  std::array<double, 3>{1, -2, 1e-300},
                                  std::array<double, 6>{1, 2, 3, 4, 5, 6},
                                  std::array<std::int32_t, 6>{-1, 2, -3, 4, -5, 6},
                                  std::array<std::uint32_t, 6>{1, 2, 3, 4, 5, 6}};
  Recipe recipe{.id = 9};
  for (std::size_t i = 0; i < values.size(); ++i) {
    recipe.names.push_back(std::to_string(i));
    recipe.types.push_back(static_cast<FieldType>(i));
  }
  const auto result = unpack(recipe, only_packet(encode(pack(recipe, values))));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(*result, values);
  EXPECT_EQ(recipe.offset("5"), 1u + 1 + 4 + 4 + 8);
  EXPECT_FALSE(recipe.offset("10"));
}

TEST(RtdeRecipe, OfAnotherIdIsRefused) {
  const Recipe recipe{.id = 1, .names = {"timestamp"}, .types = {FieldType::kDouble}};
  Packet packet = pack(recipe, {1.0});
  packet.payload[0] = 2;
  const auto result = unpack(recipe, packet);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("got recipe 2, wanted 1"));
}

TEST(RtdeRecipe, SaysWhichFieldsAControllerDoesNotHaveOrSomebodyElseWrites) {
  const auto unknown =
      agree({"actual_q", "no_such", "nor_this"}, {.id = 0, .types = {"VECTOR6D", "NOT_FOUND", "NOT_FOUND"}});
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().message, HasSubstr("no_such, nor_this"));
  const auto taken = agree({"input_int_register_0"}, {.id = 0, .types = {"IN_USE"}});
  ASSERT_FALSE(taken);
  EXPECT_THAT(taken.error().message, HasSubstr("input_int_register_0 in use by another client"));
  EXPECT_FALSE(agree({"actual_q"}, {.id = 0, .types = {"VECTOR6D"}})) << "id 0 is a refusal";
  EXPECT_FALSE(agree({"actual_q", "timestamp"}, {.id = 1, .types = {"VECTOR6D"}})) << "a type is missing";
  const auto agreed = agree({"actual_q"}, {.id = 4, .types = {"VECTOR6D"}});
  ASSERT_TRUE(agreed);
  EXPECT_EQ(agreed->id, 4);
  EXPECT_EQ(agreed->size(), 48u);
}

}  // namespace
}  // namespace jostle::robot_bridge::ur::rtde
