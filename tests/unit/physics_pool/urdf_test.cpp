// Robots from URDF: what is read, and what the person who wrote the file is told.

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "physics_pool/robot/robot_yaml.hpp"
#include "tests/support/arms.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

using testing::AllOf;
using testing::DoubleEq;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pointwise;

constexpr double kPi = std::numbers::pi;

const Link& link(const RobotModel& model, const std::string& name) {
  return *std::ranges::find(model.links, name, &Link::name);
}

std::string parent(const RobotModel& model, const std::string& name) {
  const int i = link(model, name).parent;
  return i < 0 ? "" : model.links[static_cast<std::size_t>(i)].name;
}

const Joint& joint(const RobotModel& model, const std::string& name) {
  return *std::ranges::find(model.joints, name, &Joint::name);
}

// The arm of tests/support/robots.

class UrdfArm : public testing::Test {
 protected:
  const RobotModel sut = seven_axis();
};

TEST_F(UrdfArm, HasItsLinksInTheOrderOfTheTree) {
  EXPECT_EQ(sut.name, "seven_axis");
  EXPECT_TRUE(sut.carries_itself);
  EXPECT_FALSE(sut.hand);
  std::vector<std::string> names;
  for (const Link& l : sut.links) names.push_back(l.name);
  EXPECT_THAT(names, ElementsAre("base", "shoulder", "upper_arm", "elbow", "forearm", "wrist", "wrist_ball", "flange",
                                 "palm", "finger_left", "finger_right", "tool"));
  EXPECT_EQ(parent(sut, "base"), "");
  EXPECT_EQ(parent(sut, "shoulder"), "base");
  EXPECT_EQ(parent(sut, "palm"), "flange");
  for (const char* name : {"finger_left", "finger_right", "tool"}) EXPECT_EQ(parent(sut, name), "palm");
}

TEST_F(UrdfArm, HasAJointForWhateverMovesAndNoneForWhatIsFixed) {
  std::vector<std::string> names;
  for (const Joint& j : sut.joints) names.push_back(j.name);
  EXPECT_THAT(names, ElementsAre("axis_1", "axis_2", "axis_3", "axis_4", "axis_5", "axis_6", "axis_7", "finger",
                                 "finger_follower"));
  EXPECT_THAT(link(sut, "shoulder").joints, ElementsAre(kAxis1));
  EXPECT_THAT(link(sut, "finger_right").joints, ElementsAre(kFingerFollower));
  for (const char* name : {"base", "palm", "tool"}) EXPECT_TRUE(link(sut, name).joints.empty()) << name;
}

TEST_F(UrdfArm, HasThePlaceKindAndLimitsOfItsJoints) {
  EXPECT_THAT(link(sut, "shoulder").pose.position, ElementsAre(0, 0, 0.14));
  const Joint& elbow = joint(sut, "axis_4");
  EXPECT_EQ(elbow.kind, JointKind::kHinge);
  EXPECT_THAT(elbow.axis, ElementsAre(0, 1, 0));
  EXPECT_EQ(elbow.low, -0.1);
  EXPECT_EQ(elbow.high, 2.6);
  EXPECT_EQ(elbow.force_limit, 60);
  const Joint& finger = joint(sut, "finger_follower");
  EXPECT_EQ(finger.kind, JointKind::kSlide);
  EXPECT_THAT(finger.axis, ElementsAre(0, -1, 0));
  EXPECT_EQ(finger.high, 0.04);
}

TEST_F(UrdfArm, TurnsWhatItsOriginTurns) {
  const Pose& pose = link(sut, "tool").pose;
  EXPECT_THAT(pose.position, ElementsAre(0, 0, 0.095));
  // -90 degrees about y.
  EXPECT_THAT(pose.orientation, Pointwise(DoubleNear(1e-15), std::vector{std::sqrt(0.5), 0.0, -std::sqrt(0.5), 0.0}));
}

TEST_F(UrdfArm, HasAnAxisForEveryJointThatMovesByItself) {
  std::vector<std::string> names;
  for (const Axis& axis : sut.axes) names.push_back(axis.name);
  EXPECT_THAT(names, ElementsAre("axis_1", "axis_2", "axis_3", "axis_4", "axis_5", "axis_6", "axis_7", "finger"));
  EXPECT_THAT(axis_limits(sut), ElementsAre(2, 2, 2, 2, 2.5, 2.5, 3, 0.1));
  EXPECT_THAT(sut.axes[kAxis3].joints, ElementsAre(std::pair(int{kAxis3}, 1.0)));
}

TEST_F(UrdfArm, MovesItsSecondFingerWithTheFirst) {
  EXPECT_THAT(sut.axes[kFinger].joints,
              ElementsAre(std::pair(int{kFinger}, 1.0), std::pair(int{kFingerFollower}, 1.0)));
}

// At full effort a drive gains 150 rad/s in a second, and it reaches a speed in 10 ms.
TEST_F(UrdfArm, HasDrivesAsStrongAsItsEffort) {
  for (const Joint& j : sut.joints) {
    EXPECT_THAT(j.armature, DoubleEq(std::max(j.force_limit / 150, 0.05))) << j.name;
    EXPECT_THAT(j.gain, DoubleEq(100 * j.armature)) << j.name;
  }
}

TEST_F(UrdfArm, HasTheInertiaOfWhatMoves) {
  const auto& inertia = link(sut, "palm").inertia;
  ASSERT_TRUE(inertia);
  EXPECT_EQ(inertia->mass, 0.5);
  EXPECT_THAT(inertia->pose.position, ElementsAre(0, 0, 0.015));
  EXPECT_THAT(inertia->moments, ElementsAre(0.00075, 0.0003, 0.00075, 0, 0, 0));
  EXPECT_FALSE(link(sut, "base").inertia);  // it does not move
  EXPECT_FALSE(link(sut, "tool").inertia);  // it has none
}

TEST_F(UrdfArm, HasTheShapesOfItsCollisions) {
  const RobotGeom& base = link(sut, "base").geoms.at(0);
  EXPECT_EQ(base.shape, GeomShape::kCylinder);
  EXPECT_EQ(base.radius, 0.08);
  EXPECT_EQ(base.height, 0.14);
  EXPECT_THAT(base.pose.position, ElementsAre(0, 0, 0.07));
  const RobotGeom& upper_arm = link(sut, "upper_arm").geoms.at(0);
  EXPECT_EQ(upper_arm.shape, GeomShape::kBox);
  EXPECT_THAT(upper_arm.size, ElementsAre(0.1, 0.12, 0.18));
  ASSERT_EQ(link(sut, "elbow").geoms.size(), 2u);
  const RobotGeom& ball = link(sut, "elbow").geoms[1];
  EXPECT_EQ(ball.shape, GeomShape::kSphere);
  EXPECT_EQ(ball.radius, 0.065);
  EXPECT_EQ(ball.name, "elbow_1");
  EXPECT_TRUE(link(sut, "tool").geoms.empty());
}

// Smallest and largest of the vertices along every axis.
std::vector<double> extents(const RobotGeom& geom) {
  std::vector<double> result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (std::size_t i = axis; i < geom.vertices.size(); i += 3) {
      low = std::min(low, geom.vertices[i]);
      high = std::max(high, geom.vertices[i]);
    }
    result.insert(result.end(), {low, high});
  }
  return result;
}

TEST_F(UrdfArm, HasTheMeshThatAPackageHolds) {
  const RobotGeom& forearm = link(sut, "forearm").geoms.at(0);
  EXPECT_EQ(forearm.shape, GeomShape::kMesh);
  EXPECT_EQ(forearm.vertices.size(), 3 * 16u);  // a prism of eight sides
  EXPECT_THAT(extents(forearm), ElementsAre(-0.04435, 0.04435, -0.04435, 0.04435, 0.005, 0.145));
  EXPECT_THAT(forearm.pose.position, ElementsAre(0, 0, 0.01));
}

TEST_F(UrdfArm, ScalesMeshes) {
  const std::vector<double> wanted{-0.03, 0.03, -0.06, 0.06, -0.015, 0.045};  // the file has millimetres
  EXPECT_THAT(extents(link(sut, "palm").geoms.at(0)), Pointwise(DoubleNear(1e-15), wanted));
}

TEST_F(UrdfArm, BecomesTheSameRobotAsText) {
  Scene scene = target_only();
  scene.robot = {.model = sut, .q = sut.start()};
  scene.robot.base.position = {-0.9, 0, 0};
  scene.task.kind = "reach";
  const auto again = parse_scene(to_yaml(scene), "again.yaml");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->robot, scene.robot);
}

// A small arm, its lines counted from here, and what becomes of it.

const std::string kGood = R"(<robot name="small">
  <link name="base"/>
  <joint name="turn" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <origin xyz="0 0 0.1"/>
    <axis xyz="0 0 2"/>
    <limit lower="0.5" upper="2" effort="30" velocity="1.5"/>
  </joint>
  <link name="arm">
    <inertial>
      <origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/>
      <mass value="2"/>
      <inertia ixx="0.01" ixy="0.001" ixz="0.002" iyy="0.02" iyz="0.003" izz="0.02"/>
    </inertial>
    <collision>
      <geometry>
        <box size="0.3 0.04 0.04"/>
      </geometry>
    </collision>
  </link>
  <joint name="follow" type="prismatic">
    <parent link="arm"/>
    <child link="hand"/>
    <axis xyz="1 0 0"/>
    <limit lower="-0.5" upper="0.5" effort="3" velocity="0.2"/>
    <mimic joint="turn" multiplier="-0.5" offset="0.1"/>
  </joint>
  <link name="hand">
    <inertial>
      <mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
  </link>
</robot>
)";

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const auto at = text.find(from);
  if (at == std::string::npos) {
    ADD_FAILURE() << "no '" << from << "' in the good file";
  } else {
    text.replace(at, from.size(), to);
  }
  return text;
}

RobotModel parsed(const std::string& xml) {
  const auto model_result = parse_urdf(xml, "small.urdf", {});
  if (!model_result) throw std::runtime_error(model_result.error().message);
  return *model_result;
}

TEST(Urdf, MakesUnitVectorsOfAxes) { EXPECT_THAT(joint(parsed(kGood), "turn").axis, ElementsAre(0, 0, 1)); }

TEST(Urdf, TakesXForAnAxisThatIsNotThere) {
  EXPECT_THAT(joint(parsed(replaced(R"(<axis xyz="0 0 2"/>)", "")), "turn").axis, ElementsAre(1, 0, 0));
}

TEST(Urdf, StartsJointsNearestToZero) {
  const RobotModel model = parsed(kGood);
  EXPECT_EQ(joint(model, "turn").start, 0.5);
  EXPECT_THAT(joint(model, "follow").start, DoubleEq(-0.5 * 0.5 + 0.1));
}

TEST(Urdf, MovesFollowersAsMuchAsTheirMultiplierSays) {
  EXPECT_THAT(parsed(kGood).axes.at(0).joints, ElementsAre(std::pair(0, 1.0), std::pair(1, -0.5)));
}

TEST(Urdf, NeedsNoSpeedOfFollowers) {
  EXPECT_EQ(parsed(replaced(R"(velocity="0.2")", R"(velocity="0")")).axes.size(), 1u);
}

TEST(Urdf, LetsContinuousJointsTurnForEver) {
  const RobotModel model = parsed(replaced(R"("revolute")", R"("continuous")"));
  EXPECT_EQ(joint(model, "turn").kind, JointKind::kHinge);
  EXPECT_FALSE(joint(model, "turn").is_limited());
  EXPECT_EQ(joint(model, "turn").start, 0);
}

TEST(Urdf, KeepsTheFrameAndProductsOfInertia) {
  const Inertia inertia = link(parsed(kGood), "arm").inertia.value();
  EXPECT_EQ(inertia.mass, 2);
  EXPECT_THAT(inertia.moments, ElementsAre(0.01, 0.02, 0.02, 0.001, 0.002, 0.003));
  EXPECT_THAT(inertia.pose.position, ElementsAre(0.1, 0, 0));
  EXPECT_THAT(inertia.pose.orientation, Pointwise(DoubleNear(1e-15), turned_about_z(kPi / 2)));
}

TEST(Urdf, BoundsSpeedsThatMeanNothing) {
  EXPECT_THAT(axis_limits(parsed(replaced(R"(velocity="1.5")", R"(velocity="1e9")"))), ElementsAre(100));
}

TEST(Urdf, ForgetsTheInertiaOfWhatDoesNotMove) {
  const RobotModel model = parsed(replaced(
      R"(<link name="base"/>)",
      R"(<link name="base"><inertial><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>)"));
  EXPECT_FALSE(link(model, "base").inertia);
}

TEST(Urdf, KeepsTheInertiaOfWhatHangsOnThingsThatMove) {
  std::string text = replaced(R"("prismatic")", R"("fixed")");
  EXPECT_TRUE(link(parsed(text), "hand").inertia);
}

TEST(Urdf, TakesLinksInAnyOrder) {
  const std::string base = "  <link name=\"base\"/>\n";
  std::string text = replaced(base, "");
  text.insert(text.find("</robot>"), base);
  EXPECT_EQ(parsed(text), parsed(kGood));
}

// Refusals.

struct Case {
  std::string name;
  std::string from, to;  // replaced once
  std::vector<std::string> told;
};

void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

class MalformedUrdf : public testing::TestWithParam<Case> {};

TEST_P(MalformedUrdf, IsRefusedWithFileLineElementAndRemedy) {
  const auto model_result = parse_urdf(replaced(GetParam().from, GetParam().to), "bad.urdf", {});
  ASSERT_FALSE(model_result);
  EXPECT_EQ(model_result.error().code, Code::kInvalidArgument);
  for (const std::string& words : GetParam().told) EXPECT_THAT(model_result.error().message, HasSubstr(words));
}

const std::string kTurn = R"(bad.urdf:3: <joint name="turn">)", kFollow = R"(bad.urdf:22: <joint name="follow">)",
                  kArm = R"(bad.urdf:10: <link name="arm">)", kHandLink = R"(bad.urdf:29: <link name="hand">)";

const std::vector<Case> kCases{
    {"NotXml", "<axis xyz=\"0 0 2\"/>", "<axis xyz=\"0 0 2\">", {"bad.urdf:", "not XML"}},
    {"XacroElement",
     "  <link name=\"base\"/>",
     "  <link name=\"base\"/>\n  <xacro:arm side=\"left\"/>",
     {"bad.urdf:3: <xacro:arm>", "got xacro", "remedy: xacro bad.urdf > NAME.urdf"}},
    {"XacroExpression",
     "<mass value=\"2\"/>",
     "<mass value=\"${density}\"/>",
     {"bad.urdf:13: <mass>", "got xacro", "remedy: xacro"}},
    {"XacroArgument", "\"small\"", "\"$(arg name)\"", {"bad.urdf:1: <robot>", "got xacro", "remedy: xacro"}},
    {"PlanarJoint",
     "\"revolute\"",
     "\"planar\"",
     {kTurn, "got type 'planar'", "continuous, fixed, prismatic, revolute",
      "remedy: write a planar joint as two prismatic"}},
    {"FloatingJoint", "\"revolute\"", "\"floating\"", {kTurn, "got type 'floating'", "remedy", "robot.base"}},
    {"JointOfNoType", " type=\"revolute\"", "", {kTurn, "got type ''", "wanted"}},
    {"ParentThatThereIsNot",
     "parent link=\"arm\"",
     "parent link=\"leg\"",
     {kFollow, "<parent link>", "got 'leg'", "the name of a <link>"}},
    {"JointWithoutChild", "<child link=\"arm\"/>", "", {kTurn, "<child link>", "got ''", "the name of a <link>"}},
    {"LinkOnTwoJoints",
     "<child link=\"hand\"/>",
     "<child link=\"arm\"/>",
     {kFollow, "<child link>", "got 'arm'", "hangs on another joint", "each link once"}},
    {"TwoRoots",
     "<link name=\"base\"/>",
     "<link name=\"base\"/><link name=\"second\"/>",
     {"bad.urdf:2: <link name=\"second\">", "two roots", "'base'", "remedy: hang one on the other by a fixed joint"}},
    {"NoRoot",
     "<link name=\"base\"/>",
     R"(<link name="base"/><joint name="back" type="fixed"><parent link="hand"/><child link="base"/></joint>)",
     {"bad.urdf:1: <robot>", "got no root", "no joint's child"}},
    {"Circle",
     "</robot>",
     R"(<link name="a"/><link name="b"/>
<joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="ba" type="fixed"><parent link="b"/><child link="a"/></joint></robot>)",
     {"bad.urdf:35: <link name=\"a\">", "a circle of joints", "the root 'base'"}},
    {"AxisOfLengthZero", "0 0 2", "0 0 0", {kTurn, "<axis>", "got length 0", "wanted a direction"}},
    {"NoLimit",
     R"(<limit lower="0.5" upper="2" effort="30" velocity="1.5"/>)",
     "",
     {kTurn, "got no <limit>", "lower, upper, effort and velocity"}},
    {"NoEffort", " effort=\"30\"", "", {kTurn, "<limit>", "got no effort"}},
    {"NoVelocity", " velocity=\"1.5\"", "", {kTurn, "<limit>", "got no velocity"}},
    {"EffortZero",
     "effort=\"30\"",
     "effort=\"0\"",
     {kTurn, "<limit effort>", "got 0", "more than 0 N or N m", "remedy"}},
    {"VelocityZero",
     "velocity=\"1.5\"",
     "velocity=\"0\"",
     {kTurn, "<limit velocity>", "got 0", "more than 0 rad/s or m/s", "remedy"}},
    {"LimitsBackwards", "lower=\"0.5\"", "lower=\"3\"", {kTurn, "<limit>", "lower 3", "upper 2", "remedy"}},
    {"LimitsOfNothing",
     "lower=\"0.5\" upper=\"2\"",
     "",
     {kTurn, "<limit>", "lower 0 and upper 0", "remedy: type continuous", "fixed for one that does not move"}},
    {"FollowerOfNobody",
     "mimic joint=\"turn\"",
     "mimic joint=\"twist\"",
     {kFollow, "<mimic joint>", "got 'twist'", "a joint that moves by itself"}},
    {"FollowerOfItself",
     "mimic joint=\"turn\"",
     "mimic joint=\"follow\"",
     {kFollow, "<mimic joint>", "got 'follow'", "a joint that moves by itself"}},
    {"FollowerThatStays",
     "multiplier=\"-0.5\"",
     "multiplier=\"0\"",
     {kFollow, "<mimic multiplier>", "got 0", "remedy: type fixed"}},
    {"NoInertial",
     R"(<inertial>
      <mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>)",
     "",
     {kHandLink, "got no <inertial>", "it moves", "remedy: add it"}},
    {"NoMass", "<mass value=\"1\"/>", "<mass value=\"0\"/>", {kHandLink, "a mass above 0", "remedy"}},
    {"MomentsZero",
     R"(ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01")",
     R"(ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0")",
     {"bad.urdf:29: robot.links[2] ('hand').inertia.moments", "above 0", "remedy"}},
    {"BoxOfNoWidth", "0.3 0.04 0.04", "0.3 0 0.04", {"bad.urdf:10: robot.links[1] ('arm').geoms[0].size", "got 0"}},
    {"NumberThatIsNone", "0.3 0.04 0.04", "0.3 wide 0.04", {kArm, "could not read all", "<collision>"}},
    {"MomentThatIsMissing", " iyz=\"0.003\"", "", {kArm, "could not read all", "<inertial>"}},
    {"AxisThatIsNoNumber", "0 0 2", "0 0 up", {"bad.urdf:1", "the URDF parser refused it"}},
    {"MeshThatMirrors",
     "<box size=\"0.3 0.04 0.04\"/>",
     R"(<mesh filename="arm.stl" scale="1 -1 1"/>)",
     {kArm, "<mesh scale>", "got 1 -1 1", "mirrors", "remedy: mirror the file"}},
    {"MeshThatIsFlattened",
     "<box size=\"0.3 0.04 0.04\"/>",
     R"(<mesh filename="arm.stl" scale="1 1 0"/>)",
     {kArm, "<mesh scale>", "got 1 1 0", "flattens"}},
};

INSTANTIATE_TEST_SUITE_P(EveryKind, MalformedUrdf, testing::ValuesIn(kCases),
                         [](const auto& param) { return param.param.name; });

TEST(Urdf, IsRefusedWithoutARobot) {
  for (const char* text : {"<sdf version=\"1.9\"/>", "<?xml version=\"1.0\"?>\n<mujoco/>"}) {
    const auto model_result = parse_urdf(text, "other.urdf", {});
    ASSERT_FALSE(model_result);
    EXPECT_THAT(model_result.error().message, AllOf(HasSubstr("other.urdf:1"), HasSubstr("no <robot>")));
  }
}

TEST(Urdf, IsRefusedWithoutXml) {
  for (const char* text : {"", "jostle_robot: 1\n", "<robot", "\xff\xfe"}) {
    const auto model_result = parse_urdf(text, "other.urdf", {});
    ASSERT_FALSE(model_result);
    EXPECT_EQ(model_result.error().code, Code::kInvalidArgument);
    EXPECT_THAT(model_result.error().message, HasSubstr("other.urdf:"));
  }
}

TEST(Urdf, IsRefusedWithoutLinks) {
  const auto model_result = parse_urdf("<robot name=\"none\"/>", "none.urdf", {});
  ASSERT_FALSE(model_result);
  EXPECT_THAT(model_result.error().message, AllOf(HasSubstr("none.urdf:1"), HasSubstr("got no root")));
}

TEST(Urdf, IsRefusedWhenNothingMoves) {
  const auto model_result = parse_urdf(R"(<robot name="rock"><link name="rock"/></robot>)", "rock.urdf", {});
  ASSERT_FALSE(model_result);
  EXPECT_THAT(model_result.error().message, AllOf(HasSubstr("rock.urdf:"), HasSubstr("robot.joints: got none")));
}

TEST(Urdf, IsRefusedWhenItEndsEarly) {
  for (std::size_t size = 0; size + 2 < kGood.size(); size += 7) {  // the last line's end may go
    EXPECT_FALSE(parse_urdf(kGood.substr(0, size), "cut.urdf", {})) << size;
  }
}

// Files of xacro are known by what is in them, whatever they are called.
TEST(Urdf, ReadsXacroFilesThatNeedNoXacro) {
  TempFolder folder;
  folder.write("plain.urdf.xacro", kGood);
  folder.write("macro.xacro", replaced("<link name=\"base\"/>", "<xacro:include filename=\"base.xacro\"/>"));
  EXPECT_TRUE(find_robot("plain.urdf.xacro", {.base = folder.path()}));
  const auto model_result = find_robot("macro.xacro", {.base = folder.path()});
  ASSERT_FALSE(model_result);
  EXPECT_THAT(model_result.error().message,
              AllOf(HasSubstr("macro.xacro:2: <xacro:include>"), HasSubstr("xacro macro.xacro > NAME.urdf")));
}

// Meshes.

class UrdfMesh : public testing::Test {
 protected:
  UrdfMesh() {
    std::filesystem::create_directories(folder.path() / "ws/src/my_arm/urdf");
    std::filesystem::create_directories(folder.path() / "ws/src/my_arm/meshes");
    std::filesystem::create_directories(folder.path() / "share/other/meshes");
    write("ws/src/my_arm/meshes/arm.obj", 1.0);
    write("ws/src/my_arm/urdf/arm.obj", 2.0);
    write("share/other/meshes/arm.obj", 3.0);
  }

  // A tetrahedron whose height tells which file it was.
  void write(const std::string& name, double height) const {
    folder.write(name, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 " + std::to_string(height) + "\n");
  }
  Result<RobotModel> arm(const std::string& mesh, const RobotPath& path = {}) const {
    return parse_urdf(replaced("<box size=\"0.3 0.04 0.04\"/>", "<mesh " + mesh + "/>"), origin, path);
  }
  double height(const std::string& mesh, const RobotPath& path = {}) const {
    const auto model_result = arm(mesh, path);
    if (!model_result) throw std::runtime_error(model_result.error().message);
    return extents(link(*model_result, "arm").geoms.at(0)).back();
  }

  TempFolder folder;
  const std::string origin = (folder.path() / "ws/src/my_arm/urdf/arm.urdf").string();
};

TEST_F(UrdfMesh, IsFoundInThePackageAroundTheFile) {
  EXPECT_EQ(height(R"(filename="package://my_arm/meshes/arm.obj")"), 1);
}

TEST_F(UrdfMesh, IsFoundInThePackagesOfTheSearchPath) {
  EXPECT_EQ(height(R"(filename="package://other/meshes/arm.obj")", {.folders = {"/nowhere", folder.path() / "share"}}),
            3);
}

TEST_F(UrdfMesh, IsTakenFromTheSearchPathFirst) {
  std::filesystem::create_directories(folder.path() / "share/my_arm/meshes");
  write("share/my_arm/meshes/arm.obj", 4.0);
  const std::string mesh = R"(filename="package://my_arm/meshes/arm.obj")";
  EXPECT_EQ(height(mesh, {.folders = {folder.path() / "share"}}), 4);
  EXPECT_EQ(height(mesh), 1);
}

TEST_F(UrdfMesh, IsFoundBesideTheFile) {
  EXPECT_EQ(height(R"(filename="arm.obj")"), 2);
  EXPECT_EQ(height(R"(filename="../meshes/arm.obj")"), 1);
}

TEST_F(UrdfMesh, IsFoundByItsWholePath) {
  const std::string file = (folder.path() / "share/other/meshes/arm.obj").string();
  EXPECT_EQ(height("filename=\"file://" + file + "\""), 3);
  EXPECT_EQ(height("filename=\"" + file + "\""), 3);
}

TEST_F(UrdfMesh, IsFoundFromTheWorkingFolderToo) {
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path() / "ws/src/my_arm/urdf");
  const auto model_result =
      parse_urdf(replaced("<box size=\"0.3 0.04 0.04\"/>", R"(<mesh filename="package://my_arm/meshes/arm.obj"/>)"),
                 "arm.urdf", {});
  std::filesystem::current_path(before);
  EXPECT_TRUE(model_result) << model_result.error().message;
}

TEST_F(UrdfMesh, IsScaledAlongEveryAxis) { EXPECT_EQ(height(R"(filename="arm.obj" scale="0.5 0.5 0.25")"), 0.5); }

TEST_F(UrdfMesh, MayBeTurnedByItsScale) {
  // Two mirrors are half a turn.
  EXPECT_TRUE(arm(R"(filename="arm.obj" scale="-1 -1 1")"));
}

TEST_F(UrdfMesh, ThatIsMissingIsRefusedWithThePlacesLookedAt) {
  const auto model_result =
      arm(R"(filename="package://my_arm/meshes/leg.obj")", {.folders = {folder.path() / "share"}});
  ASSERT_FALSE(model_result);
  EXPECT_EQ(model_result.error().code, Code::kNotFound);
  const std::string root = folder.path().string();
  for (const std::string& words : {origin + ":10: <link name=\"arm\">", std::string("package://my_arm/meshes/leg.obj"),
                                   root + "/share/my_arm/meshes/leg.obj", root + "/ws/src/my_arm/meshes/leg.obj",
                                   std::string("JOSTLE_MODELS"), std::string("ROS_PACKAGE_PATH")}) {
    EXPECT_THAT(model_result.error().message, HasSubstr(words));
  }
}

TEST_F(UrdfMesh, WithANameThatNoFileCanHaveIsMissing) {
  const auto model_result = arm("filename=\"" + std::string(5000, 'x') + "\"");
  ASSERT_FALSE(model_result);
  EXPECT_EQ(model_result.error().code, Code::kNotFound);
}

TEST_F(UrdfMesh, InColladaIsRefusedWithARemedy) {
  folder.write("ws/src/my_arm/urdf/arm.dae", "<COLLADA/>");
  const auto model_result = arm(R"(filename="arm.dae")");
  ASSERT_FALSE(model_result);
  EXPECT_EQ(model_result.error().code, Code::kInvalidArgument);
  EXPECT_THAT(model_result.error().message,
              AllOf(HasSubstr(origin + ":10: <link name=\"arm\">"), HasSubstr("<mesh>"), HasSubstr("'.dae'"),
                    HasSubstr("STL or OBJ"), HasSubstr("remedy: convert")));
}

TEST_F(UrdfMesh, InMillimetresIsRefused) {
  folder.write("ws/src/my_arm/urdf/big.obj", "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\n");
  const auto model_result = arm(R"(filename="big.obj")");
  ASSERT_FALSE(model_result);
  EXPECT_THAT(model_result.error().message,
              AllOf(HasSubstr(origin + ":10: robot.links[1] ('arm').geoms[0].vertices"), HasSubstr("too large")));
}

}  // namespace
}  // namespace jostle::physics_pool
