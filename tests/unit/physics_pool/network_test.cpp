// The network's file: what comes back, and what the owner of a broken one is told.

#include "physics_pool/coarse/learned/network.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "tests/support/networks.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::physics_pool {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(NetworkFile, ComesBackBitForBit) {
  const Network network = tests::random_network();
  const std::string content = to_file(network);
  const auto sut = parse_network(content, "a.net");
  ASSERT_TRUE(sut) << sut.error().message;
  EXPECT_EQ(to_file(*sut), content);
  EXPECT_EQ(sut->samples, 1000u);
  EXPECT_EQ(sut->parking, kParking);
  EXPECT_EQ(sut->bodies.slider_radius, network.bodies.slider_radius);
  ASSERT_EQ(sut->layers.size(), 2u);
  EXPECT_EQ(sut->layers[0].weights, network.layers[0].weights);
  EXPECT_EQ(sut->layers[1].biases, network.layers[1].biases);
}

TEST(NetworkFile, ThatIsNotThereIsNamed) {
  const auto sut = load_network("/nowhere/a.net");
  ASSERT_FALSE(sut);
  EXPECT_EQ(sut.error().code, Code::kNotFound);
  EXPECT_THAT(sut.error().message, AllOf(HasSubstr("/nowhere/a.net"), HasSubstr("jostle train-coarse fit")));
}

TEST(NetworkFile, ThatIsThereIsRead) {
  const tests::TempFolder folder;
  const auto file = folder.write("a.net", to_file(tests::random_network()));
  EXPECT_TRUE(load_network(file));
}

struct Case {
  std::string name;
  std::string from, to;  // replaced once
  std::vector<std::string> told;
};

void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

class MalformedNetwork : public testing::TestWithParam<Case> {};

TEST_P(MalformedNetwork, IsRefusedWithFileFieldGotWantedAndRemedy) {
  std::string content = to_file(tests::random_network());
  const auto at = content.find(GetParam().from);
  ASSERT_NE(at, std::string::npos);
  content.replace(at, GetParam().from.size(), GetParam().to);
  const auto sut = parse_network(content, "bad.net");
  ASSERT_FALSE(sut);
  EXPECT_EQ(sut.error().code, Code::kInvalidArgument);
  EXPECT_THAT(sut.error().message, AllOf(HasSubstr("bad.net"), HasSubstr("jostle train-coarse fit")));
  for (const std::string& words : GetParam().told) EXPECT_THAT(sut.error().message, HasSubstr(words));
}

const std::string kShape = "layers " + std::to_string(kInputs) + " 12 " + std::to_string(kOutputs);

INSTANTIATE_TEST_SUITE_P(
    , MalformedNetwork,
    testing::Values(
        Case{"OtherFile", "jostle-network 1", "PNG", {"magic", "wanted a first line 'jostle-network 1'"}},
        Case{"OtherVersion", "jostle-network 1", "jostle-network 2", {"version: got '2', wanted 1"}},
        Case{"MissingLine",
             "slider_mass 0.5\n",
             "",
             {"slider_mass: got a line 'slider_friction", "wanted 'slider_mass"}},
        Case{"NoNumber", "duration 1\n", "duration one\n", {"duration: got 'one', wanted a number in [0.001, 60]"}},
        Case{"OutOfRange", "duration 1\n", "duration -1\n", {"duration: got '-1', wanted a number in"}},
        Case{"NaN", "duration 1\n", "duration nan\n", {"duration: got 'nan', wanted a number in"}},
        Case{"TwoNumbers", "duration 1\n", "duration 1 2\n", {"duration: got 2 values, wanted 1"}},
        Case{"TooFewNormalisations", "input_scale 0.1", "input_scale", {"input_scale: got", "values, wanted"}},
        Case{"ZeroScale", "input_scale 0.1", "input_scale 0", {"input_scale: got '0', wanted a number in"}},
        Case{"OtherInputs", kShape, "layers 3 12 " + std::to_string(kOutputs), {"layers: got 3 inputs", "wanted"}},
        Case{"OtherOutputs", kShape, "layers " + std::to_string(kInputs) + " 12 3", {"and 3 outputs, wanted"}},
        Case{"HalfANeuron",
             kShape,
             "layers " + std::to_string(kInputs) + " 12.5 " + std::to_string(kOutputs),
             {"layers: got 12.5 neurons, wanted a whole number"}},
        Case{"HugeLayer",
             kShape,
             "layers " + std::to_string(kInputs) + " 1e9 " + std::to_string(kOutputs),
             {"layers: got '1e9', wanted a number in [1, 4096]"}},
        Case{"OtherShape",
             kShape,
             "layers " + std::to_string(kInputs) + " 13 " + std::to_string(kOutputs),
             {"the file is cut off"}}),
    [](const auto& tested) { return tested.param.name; });

TEST(NetworkFile, ThatIsCutOffAnywhereIsRefused) {
  const std::string content = to_file(tests::random_network());
  for (std::size_t length = 0; length < content.size(); length += 97) {
    EXPECT_FALSE(parse_network(std::string_view(content).substr(0, length), "cut.net")) << length;
  }
  const auto sut = parse_network(std::string_view(content).substr(0, content.size() - 1), "cut.net");
  ASSERT_FALSE(sut);
  EXPECT_THAT(sut.error().message,
              HasSubstr("cut.net: biases of layer 2: the file is cut off: got 95 bytes, wanted 96"));
}

TEST(NetworkFile, ThatIsTooLongIsRefused) {
  const auto sut = parse_network(to_file(tests::random_network()) + "abc", "long.net");
  ASSERT_FALSE(sut);
  EXPECT_THAT(sut.error().message, HasSubstr("long.net: end: got 3 bytes after the last layer, wanted none"));
}

TEST(NetworkFile, WithAWeightThatIsNaNIsRefused) {
  Network network = tests::random_network();
  network.layers[1].weights[7] = std::numeric_limits<float>::quiet_NaN();
  const auto sut = parse_network(to_file(network), "nan.net");
  ASSERT_FALSE(sut);
  EXPECT_THAT(sut.error().message, HasSubstr("nan.net: weights of layer 2: value 7: got nan, wanted a finite number"));
}

}  // namespace
}  // namespace jostle::physics_pool
