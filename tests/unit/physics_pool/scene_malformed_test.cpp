// Every kind of malformed scene, and what the person who wrote it is told.

#include <gmock/gmock.h>

#include <random>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/scene/scene.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using testing::HasSubstr;

// Line numbers below count from here.
const std::string kGood = R"(jostle_scene: 1
name: two boxes
surface: {kind: table, size: [0.6, 0.6]}
robot:
  model: planar_gripper
  start: {x: -0.33, y: 0, rotation: 0, opening: 0.085}
objects:
  - name: a
    shape: box
    size: [0.04, 0.04, 0.04]
    mass: 0.5
    friction: 0.4
    pose: {x: 0, y: 0, yaw: 0}
  - name: b
    shape: cylinder
    radius: 0.04
    height: 0.05
    mass: 0.5
    friction: 0.4
    pose: {x: 0.1, y: 0.1}
task: {kind: grasp, target: a}
physics: {time_step: 0.002, iterations: 50, tolerance: 1e-08}
)";

struct Case {
  std::string name;
  std::string from, to;  // replaced once
  std::vector<std::string> told;
};

void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const auto at = text.find(from);
  if (at == std::string::npos)
    ADD_FAILURE() << "no '" << from << "' in the good scene";
  else
    text.replace(at, from.size(), to);
  return text;
}

class MalformedScene : public testing::TestWithParam<Case> {};

TEST(GoodScene, Parses) {
  const auto scene = parse_scene(kGood, "good.yaml");
  EXPECT_TRUE(scene) << scene.error().message;
}

TEST_P(MalformedScene, IsRefusedWithFileLineFieldGotAndWanted) {
  const auto scene = parse_scene(replaced(GetParam().from, GetParam().to), "bad.yaml");
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, Code::kInvalidArgument);
  for (const std::string& words : GetParam().told) {
    EXPECT_THAT(scene.error().message, HasSubstr(words));
  }
}

const std::vector<Case> kCases{
    {"NotYaml", "surface: {kind", "surface: }{kind", {"bad.yaml:3", "not YAML"}},
    {"UnclosedList", "size: [0.6, 0.6]}", "size: [0.6, 0.6", {"bad.yaml:", "not YAML"}},
    {"TabIndent", "  model:", "\tmodel:", {"bad.yaml:5", "a tab in the indentation"}},
    {"MissingVersion", "jostle_scene: 1", "", {"bad.yaml:", "jostle_scene", "missing", "wanted a whole number"}},
    {"OtherVersion",
     "jostle_scene: 1",
     "jostle_scene: 3",
     {"bad.yaml:1", "jostle_scene", "got version 3", "wanted 2 or 1"}},
    {"FractionalVersion",
     "jostle_scene: 1",
     "jostle_scene: 1.5",
     {"bad.yaml:1", "jostle_scene", "got '1.5'", "wanted a whole number"}},
    {"MissingMass", "    mass: 0.5\n", "", {"bad.yaml:8", "objects[0].mass", "missing", "wanted a number"}},
    {"MissingName", "name: a\n    shape", "shape", {"bad.yaml:8", "objects[0].name", "missing", "wanted text"}},
    {"MissingSize",
     "    size: [0.04, 0.04, 0.04]\n",
     "",
     {"bad.yaml:8", "objects[0].size", "missing", "wanted 3 numbers"}},
    {"MissingRadius", "    radius: 0.04\n", "", {"bad.yaml:14", "objects[1].radius", "missing", "wanted a number"}},
    {"MissingPose",
     "    pose: {x: 0, y: 0, yaw: 0}\n",
     "",
     {"bad.yaml:8", "objects[0].pose", "missing", "wanted a mapping"}},
    {"MissingPoseX",
     "{x: 0, y: 0, yaw: 0}",
     "{y: 0}",
     {"bad.yaml:13", "objects[0].pose.x", "missing", "wanted a number"}},
    {"MissingTask", "task: {kind: grasp, target: a}\n", "", {"bad.yaml:", "task", "missing", "wanted a mapping"}},
    {"MissingTarget",
     "kind: grasp, target: a",
     "kind: grasp",
     {"bad.yaml:21", "task.target", "missing", "wanted text"}},
    {"TextForNumber", "mass: 0.5", "mass: heavy", {"bad.yaml:11", "objects[0].mass", "got 'heavy'", "wanted a number"}},
    {"NumberWithUnit",
     "mass: 0.5",
     "mass: 0.5 kg",
     {"bad.yaml:11", "objects[0].mass", "got '0.5 kg'", "wanted a number"}},
    {"ListForNumber",
     "mass: 0.5",
     "mass: [0.5]",
     {"bad.yaml:11", "objects[0].mass", "got a list of 1", "wanted a number"}},
    {"NothingForNumber", "mass: 0.5", "mass:", {"bad.yaml:", "objects[0].mass", "got nothing", "wanted a number"}},
    {"MappingForText",
     "name: a\n",
     "name: {a: b}\n",
     {"bad.yaml:8", "objects[0].name", "got a mapping", "wanted text"}},
    {"TwoNumbersForThree",
     "[0.04, 0.04, 0.04]",
     "[0.04, 0.04]",
     {"bad.yaml:10", "objects[0].size", "got a list of 2", "wanted 3 numbers"}},
    {"TextInList",
     "[0.04, 0.04, 0.04]",
     "[0.04, wide, 0.04]",
     {"bad.yaml:10", "objects[0].size[1]", "got 'wide'", "wanted a number"}},
    {"ScalarForMapping",
     "surface: {kind: table, size: [0.6, 0.6]}",
     "surface: 3",
     {"bad.yaml:3", "surface", "got '3'", "wanted a mapping"}},
    {"ScalarForObjects",
     "task: {kind: grasp, target: a}",
     "task: grasp",
     {"bad.yaml:21", "task", "got 'grasp'", "wanted a mapping"}},
    {"UnknownTopKey", "name: two boxes", "nam: two boxes", {"bad.yaml:2", "nam", "unknown key", "name"}},
    {"UnknownObjectKey",
     "friction: 0.4",
     "frictoin: 0.4",
     {"bad.yaml:12", "unknown key frictoin, did you mean friction?"}},
    {"ExtraObjectKey",
     "mass: 0.5",
     "mass: 0.5\n    colour: red",
     {"bad.yaml:12", "objects[0].colour", "unknown key", "wanted one of", "friction"}},
    {"RadiusOfABox",
     "mass: 0.5",
     "mass: 0.5\n    radius: 0.1",
     {"bad.yaml:12", "objects[0].radius", "unknown key", "size"}},
    {"UnknownPoseKey",
     "{x: 0.1, y: 0.1}",
     "{x: 0.1, y: 0.1, z: 0}",
     {"bad.yaml:20", "objects[1].pose.z", "unknown key", "yaw"}},
    {"TwiceTheSameKey", "mass: 0.5", "mass: 0.5\n    mass: 0.6", {"bad.yaml:12", "objects[0].mass", "twice"}},
    {"UnknownShape",
     "shape: box",
     "shape: sphere",
     {"bad.yaml:9", "objects[0].shape", "got 'sphere'", "wanted one of: box, cylinder"}},
    {"UnknownSurface",
     "kind: table",
     "kind: floor",
     {"bad.yaml:3", "surface.kind", "got 'floor'", "wanted one of: table, shelf"}},
    {"UnknownRobot",
     "planar_gripper",
     "humanoid",
     {"bad.yaml:5", "robot.model", "got 'humanoid'", "wanted one of: planar_gripper"}},
    {"UnknownTask",
     "kind: grasp",
     "kind: juggle",
     {"bad.yaml:21", "task.kind", "got 'juggle'", "wanted one of: grasp"}},
    {"UnknownTarget",
     "target: a",
     "target: z",
     {"bad.yaml:21", "task.target", "got 'z'", "wanted the name of an object"}},
    {"NegativeMass", "mass: 0.5", "mass: -0.5", {"bad.yaml:11", "objects[0]", "mass", "got -0.5", "wanted"}},
    {"ZeroMass", "mass: 0.5", "mass: 0", {"bad.yaml:11", "objects[0]", "mass", "got 0", "wanted"}},
    {"InfiniteMass", "mass: 0.5", "mass: .inf", {"bad.yaml:11", "objects[0]", "mass", "got '.inf'", "wanted"}},
    {"NegativeFriction",
     "friction: 0.4",
     "friction: -1",
     {"bad.yaml:12", "objects[0]", "friction", "got -1", "wanted"}},
    {"NaNPose",
     "{x: 0, y: 0, yaw: 0}",
     "{x: .nan, y: 0}",
     {"bad.yaml:13", "objects[0]", "pose.x", "got '.nan'", "wanted"}},
    {"NaNYaw",
     "{x: 0, y: 0, yaw: 0}",
     "{x: 0, y: 0, yaw: .nan}",
     {"bad.yaml:13", "objects[0]", "pose.yaw", "got '.nan'", "wanted"}},
    {"NaNSurface", "[0.6, 0.6]", "[0.6, .nan]", {"bad.yaml:3", "surface.size[1]", "got '.nan'", "wanted"}},
    {"NaNTimeStep",
     "time_step: 0.002",
     "time_step: .nan",
     {"bad.yaml:22", "physics.time_step", "got '.nan'", "wanted"}},
    {"ZeroTimeStep", "time_step: 0.002", "time_step: 0", {"bad.yaml:22", "physics.time_step", "got 0", "wanted"}},
    {"ZeroSize", "[0.04, 0.04, 0.04]", "[0.04, 0, 0.04]", {"bad.yaml:10", "objects[0]", "size[1]", "got 0", "wanted"}},
    {"HugeRadius", "radius: 0.04", "radius: 40", {"bad.yaml:16", "objects[1]", "radius", "got 40", "wanted"}},
    {"TooWideOpen", "opening: 0.085", "opening: 0.2", {"bad.yaml:6", "robot.start.opening", "got 0.2", "wanted"}},
    {"EmptyName", "name: b", "name: ''", {"bad.yaml:14", "objects[1]", "name", "got ''", "wanted"}},
    {"DuplicateName", "name: b", "name: a", {"bad.yaml:14", "objects[1]", "'a'", "name", "taken", "unique"}},
    {"OffTheTable",
     "{x: 0.1, y: 0.1}",
     "{x: 0.31, y: 0.1}",
     {"bad.yaml:20", "objects[1]", "'b'", "pose.x", "got 0.31", "wanted", "on the surface"}},
    // A box edge at x = 0.02 and a disc of radius 0.04 at 0.05: 10 mm deep.
    {"InsideAnother",
     "{x: 0.1, y: 0.1}",
     "{x: 0.05, y: 0}",
     {"bad.yaml:20", "'b'", "inside object 'a'", "10.0 mm", "wanted a free place"}},
    {"InsideTheRobot",
     "{x: 0.1, y: 0.1}",
     "{x: -0.299, y: 0}",
     {"bad.yaml:20", "'b'", "inside the robot", "wanted a free place"}},
};

INSTANTIATE_TEST_SUITE_P(EveryKind, MalformedScene, testing::ValuesIn(kCases),
                         [](const auto& param) { return param.param.name; });

TEST(ParseScene, RefusesAnEmptyFile) {
  for (const char* text : {"", "\n\n", "# only a comment\n", "---\n"}) {
    const auto scene = parse_scene(text, "empty.yaml");
    ASSERT_FALSE(scene);
    EXPECT_THAT(scene.error().message, HasSubstr("empty.yaml:"));
    EXPECT_THAT(scene.error().message, HasSubstr("wanted a mapping"));
  }
}

TEST(ParseScene, RefusesOtherRoots) {
  for (const char* text : {"just text", "[1, 2]", "42"}) {
    const auto scene = parse_scene(text, "root.yaml");
    ASSERT_FALSE(scene);
    EXPECT_THAT(scene.error().message, HasSubstr("root.yaml:1"));
    EXPECT_THAT(scene.error().message, HasSubstr("wanted a mapping"));
  }
}

// A joint may be called "b[c]": the line of its field is looked for all the same.
TEST(LineOf, IsThatOfTheNearestPartForNamesWithBrackets) {
  const YAML::Node root = YAML::Load("a:\n  - 1\n  - {b: 2}\n");
  EXPECT_EQ(yaml::line_of(root, "a[1].b"), 3);
  EXPECT_EQ(yaml::line_of(root, "a[1].b[c]"), 3);
  EXPECT_EQ(yaml::line_of(root, "a[9].b"), 2);
  EXPECT_EQ(yaml::line_of(root, "z..[]"), 1);
}

TEST(ParseScene, RefusesKeysThatAreNotText) {
  EXPECT_FALSE(parse_scene(kGood + "? [a, b]\n: 3\n", "keys.yaml"));
  EXPECT_FALSE(parse_scene(kGood + "? {a: b}\n: 3\n", "keys.yaml"));
}

TEST(ParseScene, SurvivesDeepNesting) {
  const auto scene = parse_scene("name: " + std::string(100'000, '['), "deep.yaml");
  EXPECT_FALSE(scene);
}

TEST(ParseScene, SurvivesAliasesToThemselves) {
  EXPECT_FALSE(parse_scene("objects: &a [*a]\n", "alias.yaml"));
  EXPECT_FALSE(parse_scene("&a jostle_scene: *a\n", "alias.yaml"));
}

TEST(Validate, AcceptsObjectsThatJustTouch) {
  Scene scene = tests::target_only();
  scene.objects.push_back(tests::box("neighbour", 0.0401, 0));
  EXPECT_TRUE(validate(scene, "scene"));
  scene.objects.back().x = 0.0399;
  EXPECT_FALSE(validate(scene, "scene"));
}

// Mutations are drawn by a generator whose sequence the C++ standard fixes.
std::string mutated(std::string text, std::mt19937& random) {
  const int times = 1 + static_cast<int>(random() % 3);
  for (int i = 0; i < times && !text.empty(); ++i) {
    const std::size_t at = random() % text.size();
    const char byte = static_cast<char>(random() % 256);
    static constexpr std::string_view kSyntax = "{}[]:,-#&*!|>'\"%@`\n \t0.eE?~";
    switch (random() % 8) {
      case 0:
        text[at] = byte;
        break;
      case 1:
        text.insert(at, 1, kSyntax[random() % kSyntax.size()]);
        break;
      case 2:
        text.erase(at, 1 + random() % 8);
        break;
      case 3:
        text.insert(at, text.substr(random() % text.size(), random() % 20));
        break;
      case 4:
        text[at] = kSyntax[random() % kSyntax.size()];
        break;
      default: {  // another digit, which often leaves a good scene
        const std::size_t digit = text.find_first_of("0123456789", at);
        if (digit != std::string::npos) text[digit] = static_cast<char>('0' + random() % 10);
      }
    }
  }
  return text;
}

TEST(ParseScene, EitherReadsOrRefusesWhateverItIsGiven) {
  std::mt19937 random(20210401);
  int read = 0, refused = 0;
  for (int i = 0; i < 2000; ++i) {
    const std::string text = mutated(kGood, random);
    const auto scene = parse_scene(text, "fuzz.yaml");
    if (scene) {
      ++read;
      EXPECT_TRUE(validate(*scene, "fuzz.yaml"));
      const std::string canonical = to_yaml(*scene);
      const auto again = parse_scene(canonical, "canonical.yaml");
      ASSERT_TRUE(again) << again.error().message << "\nfrom\n" << text;
      EXPECT_EQ(to_yaml(*again), canonical);
    } else {
      ++refused;
      EXPECT_EQ(scene.error().code, Code::kInvalidArgument);
      EXPECT_THAT(scene.error().message, testing::StartsWith("fuzz.yaml:"));
    }
  }
  // Both branches were taken often, or the mutations are of no use.
  EXPECT_GT(read, 100);
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace jostle::physics_pool
