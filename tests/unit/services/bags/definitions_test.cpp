// Definitions of our messages as text, and what they decode.

#include "services/bags/format/definitions.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/bags.hpp"

namespace jostle::tests {
namespace {

using bags::Decoder;
using bags::definition_of;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

// CDR by hand: values aligned to their size behind the four bytes.
class Cdr {
 public:
  explicit Cdr(bool is_little = true) : is_little_(is_little) { bytes_ = {std::byte{0}, std::byte{is_little}, {}, {}}; }
  template <class T>
  Cdr& add(T value) {
    while ((bytes_.size() - 4) % sizeof(T) != 0) bytes_.push_back({});
    std::array<std::byte, sizeof(T)> raw;
    std::memcpy(raw.data(), &value, sizeof(T));
    if (!is_little_) std::reverse(raw.begin(), raw.end());
    bytes_.insert(bytes_.end(), raw.begin(), raw.end());
    return *this;
  }
  Cdr& text(const std::string& value) {
    add(static_cast<std::uint32_t>(value.size() + 1));
    for (const char c : value + '\0') add(c);
    return *this;
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  bool is_little_;
  Bytes bytes_;
};

Decoder decoder(const std::string& type) { return taken(Decoder::create(type, definition_of(type).value())); }

TEST(DefinitionOf, IsAMessageFileWithItsPartsBehindIt) {
  EXPECT_EQ(definition_of("geometry_msgs/msg/PoseStamped"),
            "std_msgs/Header header\n"
            "geometry_msgs/Pose pose\n" +
                std::string(80, '=') +
                "\nMSG: std_msgs/Header\n"
                "builtin_interfaces/Time stamp\n"
                "string frame_id\n" +
                std::string(80, '=') +
                "\nMSG: builtin_interfaces/Time\n"
                "int32 sec  # of the clock that is meant: docs/topics.md\n"
                "uint32 nanosec  # [0, 10^9)\n" +
                std::string(80, '=') +
                "\nMSG: geometry_msgs/Pose\n"
                "geometry_msgs/Point position\n"
                "geometry_msgs/Quaternion orientation\n" +
                std::string(80, '=') +
                "\nMSG: geometry_msgs/Point\n"
                "float64 x  # m\nfloat64 y\nfloat64 z\n" +
                std::string(80, '=') +
                "\nMSG: geometry_msgs/Quaternion\n"
                "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");
}

TEST(DefinitionOf, KeepsWhatCommentsSay) {
  EXPECT_THAT(
      *definition_of("jostle_msgs/msg/ObjectState"),
      StartsWith("# Pose X_WB and velocity of body B.\nstring name\ngeometry_msgs/Pose pose  # world frame, m\n"));
  EXPECT_THAT(*definition_of("jostle_msgs/msg/VelocityCommand"), HasSubstr("float64[<=64] velocities"));
  EXPECT_THAT(*definition_of("sensor_msgs/msg/CameraInfo"),
              HasSubstr("float64[9] k  # fx 0 cx 0 fy cy 0 0 1, pixels\n"));
}

TEST(DefinitionOf, IsThereForEveryMessageOfIdlAndDecodable) {
  const auto types = bags::known_types();
  ASSERT_GT(types.size(), 50u);
  for (const char* type :
       {"jostle_msgs/msg/Plan", "jostle_msgs/msg/Assignment", "jostle_msgs/msg/GoalResult", "tf2_msgs/msg/TFMessage",
        "sensor_msgs/msg/PointCloud2", "visualization_msgs/msg/MarkerArray", "nav_msgs/msg/Odometry",
        "rcl_interfaces/msg/Log", "diagnostic_msgs/msg/DiagnosticArray", "trajectory_msgs/msg/JointTrajectory"}) {
    EXPECT_THAT(types, Contains(type));
  }
  for (const std::string& type : types) EXPECT_TRUE(Decoder::create(type, *definition_of(type))) << type;
  EXPECT_FALSE(definition_of("some_msgs/msg/Other"));
}

TEST(DefinitionsOfIdl, SayWhatIsMalformedAndWhere) {
  const auto error = [](std::string_view text) { return bags::definitions_of_idl({{"a.idl", text}}).error().message; };
  EXPECT_THAT(error("module a {\n module msg {\n struct S {\n double;\n};\n};\n};"),
              HasSubstr("a.idl: line 4: got ';', wanted a name"));
  EXPECT_THAT(error("struct S {};"), HasSubstr("line 1: got 'struct', wanted 'module'"));
  EXPECT_THAT(error("module a { module msg { struct S { T t; }; }; };"), HasSubstr("t: got type a/T"));
  EXPECT_THAT(error("module a { module msg { struct S { double x"), HasSubstr("wanted ';'"));
}

TEST(DefinitionsOfIdl, ConstantsOfAMessageStandInFrontOfItsFields) {
  const auto result = bags::definitions_of_idl(
      {{"a.idl",
        "module a { module msg {\n"
        "module S_Constants {\n const octet OK = 1;  // all is well\n const unsigned long BIG = 70000;\n};\n"
        "// Says how.\nstruct S { octet how; };\nstruct T { double x; };\n}; };"}});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->at("a/msg/S"), "# Says how.\nuint8 OK=1  # all is well\nuint32 BIG=70000\nuint8 how\n");
  EXPECT_EQ(result->at("a/msg/T"), "float64 x\n");
  const auto sut = taken(Decoder::create("a/msg/S", result->at("a/msg/S")));
  EXPECT_EQ(taken(sut.decode(Cdr().add(std::uint8_t{1}).bytes())).dump(), R"({"how":1})");

  const auto error = [](std::string_view text) {
    return bags::definitions_of_idl({{"a.idl", "module a { module msg { " + std::string(text) + " }; };"}})
        .error()
        .message;
  };
  EXPECT_THAT(error("module Values { const octet A = 1; };"), HasSubstr("got 'Values', wanted"));
  EXPECT_THAT(error("module S_Constants { const Other A = 1; }; struct S { octet a; };"), HasSubstr("basic type"));
  EXPECT_THAT(error("module S_Constants { const octet A = 1; }; struct T { octet a; };"), HasSubstr("wanted struct S"));
}

TEST(DefinitionsOfIdl, ServicesAndActionsHaveNamesOfTheirOwn) {
  const auto result = bags::definitions_of_idl(
      {{"a.idl",
        "module a { module msg { struct S { octet x; }; };\n"
        "module srv { struct Add_Request { a::msg::S s; }; struct Add_Response { Add_Request asked; }; }; };"},
       {"b.idl", "module b { module action { struct Go_Goal { a::srv::Add_Request request; }; }; };"}});
  ASSERT_TRUE(result) << result.error().message;
  const std::string line(80, '=');
  EXPECT_EQ(result->at("a/srv/Add_Request"), "a/S s\n" + line + "\nMSG: a/S\nuint8 x\n");
  EXPECT_THAT(result->at("a/srv/Add_Response"), StartsWith("a/srv/Add_Request asked\n" + line));
  EXPECT_THAT(result->at("b/action/Go_Goal"), StartsWith("a/srv/Add_Request request\n"));
  const auto sut = taken(Decoder::create("b/action/Go_Goal", result->at("b/action/Go_Goal")));
  EXPECT_EQ(taken(sut.decode(Cdr().add(std::uint8_t{7}).bytes())).dump(), R"({"request":{"s":{"x":7}}})");
  EXPECT_THAT(bags::definitions_of_idl({{"a.idl", "module a { module other { }; };"}}).error().message,
              HasSubstr("got 'other', wanted module msg, srv or action"));
}

TEST(DefinitionOf, ResultsSaysWhatItsNumbersMean) {
  EXPECT_THAT(definition_of("jostle_msgs/msg/GoalResult").value(), HasSubstr("uint8 TIMED_OUT=3\n"));
}

TEST(EarlierDefinitionOf, DecodesWhatWasRecordedBeforeAFieldWasAppended) {
  const std::string type = "jostle_msgs/msg/GoalResult";
  const auto earlier = taken(Decoder::create(type, bags::earlier_definitions_of(type).at(0)));
  const Bytes old = Cdr().text("goal").add(std::uint8_t{1}).text("target grasped").text("").text("{}").bytes();
  EXPECT_FALSE(decoder(type).decode(old));
  EXPECT_EQ(taken(earlier.decode(old)).dump(),
            R"({"goal_id":"goal","success":true,"reason":"target grasped","error":"","report":"{}"})");
  EXPECT_THAT(bags::earlier_definitions_of("jostle_msgs/msg/WorkerHeartbeat").at(0),
              AllOf(HasSubstr("ClientLoad[] clients"), Not(HasSubstr("refused"))));
  EXPECT_THAT(bags::earlier_definitions_of("jostle_msgs/msg/Plan").at(0),
              AllOf(HasSubstr("uint64 rollouts\n"), Not(HasSubstr("deviation")), Not(HasSubstr("while_acting"))));
  EXPECT_THAT(
      bags::earlier_definitions_of("jostle_msgs/msg/RobotStatus"),
      ElementsAre(AllOf(HasSubstr("float64[] limits"), HasSubstr("uint8 error_code"), Not(HasSubstr("string scene"))),
                  AllOf(HasSubstr("float64[] limits"), Not(HasSubstr("uint8 error_code"))),
                  AllOf(HasSubstr("float64[] v"), Not(HasSubstr("float64[] limits")))));
  EXPECT_THAT(bags::earlier_definitions_of("jostle_msgs/msg/Goal"), IsEmpty());
}

TEST(DecoderTest, DecodesEveryKindOfFieldInBothByteOrders) {
  const auto sut = taken(Decoder::create("a/msg/B",
                                         "uint8 KIND=3\nstring TEXT = \"# no comment\"\nbool flag\nint16 small\nuint64 "
                                         "large\nfloat32 f\nint8[3] fixed\nstring[] names\n"
                                         "Part[<=2] parts 7\nother/Time[1] time\n=====\nMSG: a/Part\nbyte b\nfloat64 d "
                                         "# unit\n=====\nMSG: other/msg/Time\nint32 sec\n"));
  for (const bool is_little : {true, false}) {
    Cdr cdr(is_little);
    cdr.add(std::uint8_t{1}).add(std::int16_t{-2}).add(~std::uint64_t{0}).add(0.5f);
    cdr.add(std::int8_t{-1}).add(std::int8_t{0}).add(std::int8_t{1});
    cdr.add(std::uint32_t{2}).text("x").text("");
    cdr.add(std::uint32_t{1}).add(std::uint8_t{255}).add(-1e300);
    cdr.add(std::int32_t{7});
    EXPECT_EQ(taken(sut.decode(cdr.bytes())).dump(),
              R"({"flag":true,"small":-2,"large":18446744073709551615,"f":0.5,"fixed":[-1,0,1],"names":["x",""],)"
              R"("parts":[{"b":255,"d":-1e+300}],"time":[{"sec":7}]})");
  }
}

// In front of the characters stands how many; middlewares give them two bytes or four.
TEST(DecoderTest, DecodesWideStringsOfEitherWidth) {
  const auto sut = taken(Decoder::create("a/msg/W", "wstring text\nwstring<=3[] more\nint8 end\n"));
  const std::u16string pair = u"h\u00e4\U0001F600";
  const std::u32string whole = U"h\u00e4\U0001F600";
  Cdr two, four;
  const auto add = [](Cdr& to, const auto& text) {
    to.add(static_cast<std::uint32_t>(text.size()));
    for (const auto c : text) to.add(c);
  };
  add(two, pair);
  add(four, whole);
  for (Cdr* cdr : {&two, &four}) cdr->add(std::uint32_t{1});
  add(two, std::u16string(u"x"));
  add(four, std::u32string(U"x"));
  const std::string wanted = "{\"text\":\"h\u00e4\U0001F600\",\"more\":[\"x\"],\"end\":7}";
  EXPECT_EQ(taken(sut.decode(two.add(std::int8_t{7}).bytes())).dump(), wanted);
  EXPECT_EQ(taken(sut.decode(four.add(std::int8_t{7}).bytes())).dump(), wanted);
  Cdr half;
  add(half, std::u16string(1, 0xD800));
  EXPECT_EQ(taken(taken(Decoder::create("a/msg/W", "wstring text")).decode(half.bytes()))["text"], "\xEF\xBF\xBD");
  Cdr huge;
  EXPECT_FALSE(sut.decode(huge.add(~std::uint32_t{0}).bytes()));
}

TEST(DecoderTest, DecodesAStringAndAnEmptyMessage) {
  EXPECT_EQ(taken(decoder("std_msgs/msg/String").decode(cdr_of("hello")))["data"], "hello");
  EXPECT_EQ(taken(decoder("std_msgs/msg/Empty").decode(Bytes(5))).dump(), "{}");
  EXPECT_EQ(taken(decoder("std_msgs/msg/Empty").decode(Bytes(4))).dump(), "{}");
}

TEST(DecoderTest, RefusesOtherBytesThanTheTypeHas) {
  const auto sut = decoder("sensor_msgs/msg/JointState");
  Cdr cdr;
  cdr.add(std::int32_t{1})
      .add(std::uint32_t{2})
      .text("f")
      .add(std::uint32_t{1})
      .text("j")
      .add(std::uint32_t{1})
      .add(1.0);
  cdr.add(std::uint32_t{0}).add(std::uint32_t{1}).add(2.0);
  const Bytes& bytes = cdr.bytes();
  ASSERT_TRUE(sut.decode(bytes));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(sut.decode(std::span(bytes).first(size))) << size;
  }
  Bytes longer = bytes;
  longer.resize(longer.size() + 8);
  EXPECT_THAT(sut.decode(longer).error().message, HasSubstr("8 bytes more"));
  Bytes huge = bytes;
  huge[4 + 16] = huge[4 + 17] = huge[4 + 18] = huge[4 + 19] = std::byte{0xFF};
  EXPECT_THAT(sut.decode(huge).error().message, HasSubstr("name: byte "));
  Bytes other = bytes;
  other[1] = std::byte{7};
  EXPECT_THAT(sut.decode(other).error().message, HasSubstr("encapsulation 0007"));
}

TEST(DecoderTest, NeverCrashesOnChangedBytes) {
  const auto sut = decoder("jostle_msgs/msg/Assignment");
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    Bytes bytes = noise(seed % 600 + 4, seed);
    bytes[0] = std::byte{0};
    bytes[1] = static_cast<std::byte>(seed % 2);
    // Small numbers now and then, so that lengths are possible.
    for (std::size_t i = 4; i < bytes.size(); i += 3) bytes[i] = std::byte{0};
    (void)sut.decode(bytes);
  }
}

TEST(RosNames, AreFoundInNamesOfTheWireAndInShortOnes) {
  for (const char* type : {"std_msgs/msg/String", "std_msgs/String", "std_msgs::msg::dds_::String_"}) {
    EXPECT_EQ(bags::ros_type_name(type), "std_msgs/msg/String");
  }
  EXPECT_EQ(bags::ros_type_name("foxglove.Log"), "foxglove.Log");
  for (const char* topic : {"/a/b", "rt/a/b", "a/b"}) EXPECT_EQ(bags::ros_topic_name(topic), "/a/b");
}

TEST(DecoderTest, RefusesMalformedDefinitions) {
  const auto error = [](const std::string& text) { return Decoder::create("a/msg/B", text).error().message; };
  EXPECT_THAT(error("float64 x\nfloat64"), HasSubstr("a/msg/B: line 2: got 'float64', wanted a type and a name"));
  EXPECT_THAT(error("float64[0] x"), HasSubstr("array size '0'"));
  EXPECT_THAT(error("float64[x x"), HasSubstr("ends with ]"));
  EXPECT_THAT(error("Other x"), HasSubstr("got type a/Other"));
  EXPECT_THAT(error("B[] x"), HasSubstr("contains itself"));
  EXPECT_THAT(error("wstring<=3[<=2] x\nwchar y"), HasSubstr("line 2: got type a/wchar"));
  std::string deep = "T0 x\n";
  for (int i = 0; i < 5000; ++i) deep += "===\nMSG: a/T" + std::to_string(i) + "\nT" + std::to_string(i + 1) + " x\n";
  EXPECT_THAT(error(deep + "===\nMSG: a/T5000\nbool x\n"), HasSubstr("nested"));
}

}  // namespace
}  // namespace jostle::tests
