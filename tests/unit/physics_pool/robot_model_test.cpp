// Robots as data: what is refused, what a model is taken for, and its text.

#include "physics_pool/robot/robot_model.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/robot/robot_yaml.hpp"
#include "tests/support/arms.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Optional;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

RobotModel gripper() { return builtin_robot("planar_gripper").value(); }

// Refusals: each is one change of the planar gripper.

struct Refusal {
  std::string name;
  std::function<void(RobotModel&)> change;
  std::vector<std::string> told;
};

void PrintTo(const Refusal& value, std::ostream* out) { *out << value.name; }

class MalformedRobot : public testing::TestWithParam<Refusal> {};

TEST_P(MalformedRobot, IsRefusedWithFieldGotAndWanted) {
  RobotModel model = gripper();
  GetParam().change(model);
  const auto ok = validate(model);
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kInvalidArgument);
  for (const std::string& words : GetParam().told) EXPECT_THAT(ok.error().message, HasSubstr(words));
}

RobotGeom& palm(RobotModel& m) { return m.links[0].geoms[0]; }

void make_mesh(RobotModel& m, std::vector<double> vertices) {
  palm(m).shape = GeomShape::kMesh;
  palm(m).vertices = std::move(vertices);
}

Inertia& inertia(RobotModel& m) {
  return m.links[0].inertia.emplace(Inertia{.mass = 1, .moments = {1, 1, 1, 0, 0, 0}});
}

std::vector<Refusal> refusals() {
  using R = RobotModel;
  const std::string link = "robot.links[0] ('gripper')", joint = "robot.joints[0] ('gripper_x')",
                    geom = link + ".geoms[0]", axis = "robot.axes[0] ('x')", left = "robot.joints[3] ('finger_left')";
  return {
      {"NoLinks", [](R& m) { m.links.clear(); }, {"robot.links", "got none", "one at least"}},
      {"NoJoints", [](R& m) { m.joints.clear(); }, {"robot.joints", "got none", "one at least"}},
      {"NoAxes", [](R& m) { m.axes.clear(); }, {"robot.axes", "got none", "one at least"}},
      {"TooManyJoints", [](R& m) { m.joints.resize(65); }, {"robot.joints", "got 65", "at most 64"}},
      {"TooManyLinks", [](R& m) { m.links.resize(257); }, {"robot.links", "got 257", "at most 256"}},

      {"LinkWithoutName", [](R& m) { m.links[0].name = ""; }, {"robot.links[0] ('').name", "got ''", "a name"}},
      {"TwoLinksOfOneName",
       [](R& m) { m.links[2].name = "gripper"; },
       {"robot.links[2]", ".name", "got 'gripper'", "a name of its own"}},
      {"ParentThatComesLater",
       [](R& m) { m.links[1].parent = 2; },
       {"robot.links[1] ('finger_left').parent", "got 2", "an earlier link"}},
      {"ParentThatIsItself", [](R& m) { m.links[0].parent = 0; }, {link + ".parent", "got 0", "an earlier link"}},
      {"ParentBelowTheBase", [](R& m) { m.links[1].parent = -2; }, {".parent", "got -2", "or -1"}},
      {"LinkNowhere", [](R& m) { m.links[0].pose.position[1] = kNaN; }, {link + ".pose", "no pose", "finite"}},
      {"LinkThatIsStretched", [](R& m) { m.links[0].pose.orientation[0] = 2; }, {link + ".pose", "unit quaternion"}},
      {"LinkOfAJointThatThereIsNot", [](R& m) { m.links[0].joints[2] = 5; }, {link + ".joints", "got 5", "0 to 4"}},
      {"LinkThatMovesWithoutMass",
       [](R& m) { m.links[1].geoms[0].mass = 0; },
       {"robot.links[1] ('finger_left').mass", "got 0", "more than 0 kg", "it moves"}},
      {"JointsOutOfOrder",
       [](R& m) { std::swap(m.links[0].joints[0], m.links[0].joints[1]); },
       {"robot.links", "do not count up", "followed by its children"}},
      {"JointThatNothingHangsOn",
       [](R& m) { m.links[2].joints.clear(); },
       {"robot.joints[4]", "got 0 links", "wanted 1"}},

      {"InertiaWithoutMass", [](R& m) { inertia(m).mass = 0; }, {link + ".inertia.mass", "got 0", "more than 0"}},
      {"InertiaWithoutEnd", [](R& m) { inertia(m).mass = kInfinity; }, {link + ".inertia.mass", "got inf", "at most"}},
      {"InertiaNowhere", [](R& m) { inertia(m).pose.position[2] = kNaN; }, {link + ".inertia.pose", "no pose"}},
      {"NoMoments",
       [](R& m) { inertia(m).moments = {}; },
       {link + ".inertia.moments", "got [0, 0", "above 0", "remedy"}},
      {"NegativeMoment", [](R& m) { inertia(m).moments[1] = -1; }, {link + ".inertia.moments", "got [1, -1"}},
      {"MomentThatIsNoNumber", [](R& m) { inertia(m).moments[4] = kNaN; }, {link + ".inertia.moments", "nan"}},
      {"ProductsLargerThanMoments", [](R& m) { inertia(m).moments[3] = 2; }, {link + ".inertia.moments", "above 0"}},
      // No body has more mass far from z than it has far from x and y together.
      {"MomentAboveTheSumOfTheOthers",
       [](R& m) { inertia(m).moments = {1, 1, 2.1, 0, 0, 0}; },
       {link + ".inertia.moments", "got [1, 1, 2.1", "none above the sum of the other two"}},

      {"JointWithoutName", [](R& m) { m.joints[0].name = ""; }, {"robot.joints[0] ('').name", "got ''", "a name"}},
      {"TwoJointsOfOneName",
       [](R& m) { m.joints[4].name = "gripper_x"; },
       {"robot.joints[4] ('gripper_x').name", "twice", "a name of its own"}},
      {"AxisOfLengthTwo",
       [](R& m) {
         m.joints[0].axis = {0, 2, 0};
       },
       {joint + ".axis", "got [0, 2, 0]", "length 1"}},
      {"AxisOfLengthZero", [](R& m) { m.joints[0].axis = {}; }, {joint + ".axis", "got [0, 0, 0]", "length 1"}},
      {"AxisThatIsNoNumber", [](R& m) { m.joints[0].axis[0] = kNaN; }, {joint + ".axis", "nan", "length 1"}},
      {"RangeBackwards",
       [](R& m) { m.joints[3].low = 0.1; },
       {left + ".range", "got [0.1, 0.0425]", "the lower first"}},
      {"RangeOfNothing", [](R& m) { m.joints[3].low = 0.0425; }, {left + ".range", "[0.0425, 0.0425]", "remedy"}},
      {"RangeWithoutLowerEnd", [](R& m) { m.joints[3].low = -kInfinity; }, {left + ".range", "-inf", "two finite"}},
      {"RangeWithoutUpperEnd", [](R& m) { m.joints[3].high = kInfinity; }, {left + ".range", "inf", "two finite"}},
      {"RangeThatIsNoNumber", [](R& m) { m.joints[3].low = kNaN; }, {left + ".range", "nan", "two finite"}},
      {"NegativeArmature", [](R& m) { m.joints[0].armature = -1; }, {joint + ".armature", "got -1", "0 to 1e6"}},
      // Half the armature over 2 ms: 20 kg carry 5000 N s/m.
      {"GainAboveWhatTheArmatureCarries",
       [](R& m) { m.joints[0].gain = 5001; },
       {joint + ".gain", "got 5001", "0 to 5000", "overshoots", "raise the armature"}},
      {"NegativeGain", [](R& m) { m.joints[0].gain = -1; }, {joint + ".gain", "got -1"}},
      {"DriveWithoutForce",
       [](R& m) { m.joints[0].force_limit = 0; },
       {joint + ".force_limit", "got 0", "more than 0"}},
      {"ForceWithoutEnd", [](R& m) { m.joints[0].force_limit = kInfinity; }, {joint + ".force_limit", "inf", "finite"}},
      {"StartOutsideTheRange", [](R& m) { m.joints[3].start = 0.05; }, {left + ".start", "got 0.05", "0 to 0.0425"}},
      {"StartAtInfinity", [](R& m) { m.joints[0].start = kInfinity; }, {joint + ".start", "got inf"}},
      {"StartThatIsNoNumber", [](R& m) { m.joints[0].start = kNaN; }, {joint + ".start", "got nan"}},

      {"BoxOfNoHeight", [](R& m) { palm(m).size[2] = 0; }, {geom + ".size", "got 0", "0.0001 to 10 m"}},
      {"BoxOfTenMetresAndMore", [](R& m) { palm(m).size[0] = 11; }, {geom + ".size", "got 11", "0.0001 to 10 m"}},
      {"CylinderWithoutRadius",
       [](R& m) { palm(m) = {.shape = GeomShape::kCylinder, .height = 0.1}; },
       {geom + ".radius", "got 0", "0.0001 to 10 m"}},
      {"CylinderWithoutHeight",
       [](R& m) { palm(m) = {.shape = GeomShape::kCylinder, .radius = 0.1}; },
       {geom + ".height", "got 0", "0.0001 to 10 m"}},
      {"SphereWhoseRadiusIsNoNumber",
       [](R& m) { palm(m) = {.shape = GeomShape::kSphere, .radius = kNaN}; },
       {geom + ".radius", "got nan", "0.0001 to 10 m"}},
      {"MeshOfThreePoints",
       [](R& m) {
         make_mesh(m, {0, 0, 0, 1, 0, 0, 0, 1, 0});
       },
       {geom + ".vertices", "got 9 numbers", "4 points or more"}},
      {"MeshOfPointsAndAHalf",
       [](R& m) {
         make_mesh(m, {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1});
       },
       {geom + ".vertices", "got 13 numbers", "three for each"}},
      {"MeshThatIsNoNumber",
       [](R& m) {
         make_mesh(m, {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, kNaN});
       },
       {geom + ".vertices", "not finite", "-10 to 10 m"}},
      {"MeshInMillimetres",
       [](R& m) {
         make_mesh(m, {0, 0, 0, 100, 0, 0, 0, 100, 0, 0, 0, 100});
       },
       {geom + ".vertices", "too large", "-10 to 10 m"}},
      {"MeshInAPlane",
       [](R& m) {
         make_mesh(m, {0, 0, 0, 1, 0, 1, 0, 1, 1, 1, 1, 2});
       },  // z = x + y
       {geom + ".vertices", "in a plane", "thick", "remedy"}},
      {"GeomOfNegativeMass", [](R& m) { palm(m).mass = -1; }, {geom + ".mass", "got -1", "0 to 1000 kg"}},
      {"GeomNowhere", [](R& m) { palm(m).pose.position[0] = kInfinity; }, {geom + ".pose", "no pose"}},
      {"GeomOfAnotherMaterial",
       [](R& m) { palm(m).material = "gold"; },
       {geom + ".material", "'gold'", "dark or steel"}},
      {"TwoGeomsOfOneName",
       [](R& m) { m.links[2].geoms[0].name = "palm"; },
       {"robot.links[2] ('finger_right').geoms[0].name", "got 'palm'", "a name of its own"}},

      {"AxisWithoutName", [](R& m) { m.axes[0].name = ""; }, {"robot.axes[0] ('').name", "got ''"}},
      {"TwoAxesOfOneName", [](R& m) { m.axes[1].name = "x"; }, {"robot.axes[1] ('x').name", "a name of its own"}},
      {"AxisThatMovesNothing", [](R& m) { m.axes[0].joints.clear(); }, {axis + ".joints", "got none"}},
      {"AxisThatMayNotMove", [](R& m) { m.axes[0].limit = 0; }, {axis + ".limit", "got 0", "more than 0"}},
      {"AxisWithoutLimit", [](R& m) { m.axes[0].limit = kInfinity; }, {axis + ".limit", "got inf"}},
      {"AxisOfAJointThatThereIsNot",
       [](R& m) { m.axes[0].joints[0].first = 5; },
       {axis + ".joints", "got 5", "0 to 4"}},
      {"AxisThatMovesAJointTwice",
       [](R& m) {
         m.axes[0].joints = {{0, 1.0}, {0, 0.5}};
       },
       {axis + ".joints", "got 0", "each joint once"}},
      {"FactorZero", [](R& m) { m.axes[0].joints[0].second = 0; }, {axis + ".joints", "got 0", "not 0"}},
      {"FactorWithoutEnd",
       [](R& m) { m.axes[0].joints[0].second = kInfinity; },
       {axis + ".joints", "got inf", "finite"}},
      {"AxisOfAJointWithoutDrive",
       [](R& m) { m.joints[0].gain = 0; },
       {axis + ".joints", "'gripper_x', which has no drive", "joints with a gain"}},

      {"HandOnNoLink", [](R& m) { m.hand->link = 3; }, {"robot.hand.link", "got 3", "a link"}},
      {"FingerThatThereIsNot", [](R& m) { m.hand->right = -1; }, {"robot.hand.fingers", "a joint that there is not"}},
      {"HandOfOneFinger", [](R& m) { m.hand->right = m.hand->left; }, {"robot.hand.fingers", "twice", "two joints"}},
      {"HandThatNothingOpens", [](R& m) { m.hand->opening = 4; }, {"robot.hand.opening", "got 4", "an axis"}},
      {"HandNowhere", [](R& m) { m.hand->pose.orientation = {}; }, {"robot.hand.pose", "no pose", "unit quaternion"}},
      {"HandThatEndsBeforeItBegins", [](R& m) { m.hand->far = m.hand->near; }, {"robot.hand", "near < far"}},
      {"HandOfNoWidth", [](R& m) { m.hand->side = 0; }, {"robot.hand", "side"}},
      {"HandWithoutEnd", [](R& m) { m.hand->finger_length = kInfinity; }, {"robot.hand", "below 10 m"}},
      {"HandThatIsNoNumber", [](R& m) { m.hand->stroke = kNaN; }, {"robot.hand", "stroke > 0"}},
  };
}

INSTANTIATE_TEST_SUITE_P(EveryKind, MalformedRobot, testing::ValuesIn(refusals()),
                         [](const auto& param) { return param.param.name; });

TEST(Validate, AcceptsEveryRobotOfTheseTests) {
  for (const RobotModel& model : {gripper(), builtin_robot("pusher").value(), two_links(), seven_axis()}) {
    const auto ok = validate(model);
    EXPECT_TRUE(ok) << model.name << ": " << ok.error().message;
  }
}

TEST(Validate, AcceptsWhatIsJustWithinItsBounds) {
  RobotModel model = gripper();
  model.joints[0].gain = 5000;                        // half of 20 kg over 2 ms
  inertia(model).moments = {0.1, 0.2, 0.3, 0, 0, 0};  // a plate
  model.joints[2].gain = model.joints[2].force_limit = 0;
  model.axes.erase(model.axes.begin() + 2);
  model.hand->opening = 2;
  const auto ok = validate(model);
  EXPECT_TRUE(ok) << ok.error().message;
}

TEST(Validate, AcceptsAPlateThatIsTurned) {
  RobotModel model = gripper();
  // diag(1, 2, 3) turned by 45 degrees about x, so that rounding decides about 1 + 2 - 3.
  inertia(model).moments = {1, 2.5, 2.5, 0, 0, 0.5};
  EXPECT_TRUE(validate(model));
}

// What a model is taken for.

TEST(AsPlanar, KnowsRobotsThatSlideInThePlaneAndThoseThatTurnToo) {
  const auto turning = as_planar(gripper()), sliding = as_planar(builtin_robot("pusher").value());
  ASSERT_TRUE(turning && sliding);
  EXPECT_THAT((std::vector{turning->x, turning->y, turning->rotation}), ElementsAre(0, 1, 2));
  EXPECT_THAT((std::vector{sliding->x, sliding->y, sliding->rotation}), ElementsAre(0, 1, -1));
}

TEST(AsPlanar, FindsTheAxesWhereverTheyAre) {
  RobotModel model = gripper();
  std::swap(model.axes[0], model.axes[2]);
  const auto planar = as_planar(model);
  ASSERT_TRUE(planar);
  EXPECT_THAT((std::vector{planar->x, planar->y, planar->rotation}), ElementsAre(2, 1, 0));
}

TEST(AsPlanar, RefusesEverythingElse) {
  EXPECT_FALSE(as_planar(RobotModel{}));
  EXPECT_FALSE(as_planar(two_links()));
  EXPECT_FALSE(as_planar(seven_axis()));
  const auto changed = [](auto change) {
    RobotModel model = gripper();
    change(model);
    return as_planar(model);
  };
  EXPECT_TRUE(changed([](RobotModel&) {}));
  EXPECT_FALSE(changed([](RobotModel& m) { std::swap(m.joints[0], m.joints[1]); }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.joints[0].axis = {-1, 0, 0}; }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.joints[1].kind = JointKind::kHinge; }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.joints[2].axis = {1, 0, 0}; }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.axes[0].joints[0].second = 2; }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.axes[0].joints.emplace_back(1, 1.0); }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.axes.erase(m.axes.begin() + 2); }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.links[0].joints.push_back(3); }));
  // Its slides are not along x and y of the surface.
  EXPECT_FALSE(changed([](RobotModel& m) { m.links[0].pose.orientation = turned_about_z(0.1); }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.links[0].pose.orientation = {0, 1, 0, 0}; }));
}

TEST(DiscRadius, IsThatOfAPusher) {
  EXPECT_THAT(disc_radius(builtin_robot("pusher").value()), Optional(0.0145));
  EXPECT_THAT(disc_radius(pusher({.radius = 0.02}).model), Optional(0.02));
}

TEST(DiscRadius, IsThereForNoOtherRobot) {
  EXPECT_FALSE(disc_radius(gripper()));
  EXPECT_FALSE(disc_radius(two_links()));
  const auto changed = [](auto change) {
    RobotModel model = builtin_robot("pusher").value();
    change(model);
    return disc_radius(model);
  };
  EXPECT_FALSE(changed([](RobotModel& m) { m.links[0].geoms[0].shape = GeomShape::kBox; }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.links[0].geoms[0].pose.position[0] = 0.01; }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.links[0].geoms.push_back(m.links[0].geoms[0]); }));
  EXPECT_FALSE(changed([](RobotModel& m) { m.links.push_back({.name = "hat", .parent = 0}); }));
}

TEST(AxisLimits, ComeInTheOrderOfTheAxes) {
  RobotModel model = two_links();
  model.axes[0].limit = 0.7;
  model.axes[1].limit = 1.1;
  EXPECT_THAT(axis_limits(model), ElementsAre(0.7, 1.1));
}

TEST(Start, IsThatOfEveryJoint) { EXPECT_THAT(gripper().start(), ElementsAre(-0.3, 0, 0, 0.0425, 0.0425)); }

// Text.

RobotModel read_back(const std::string& text) {
  const std::string origin = "model.yaml";
  return yaml::parse<RobotModel>(text, origin,
                                 [&](const YAML::Node& root) -> Result<RobotModel> {
                                   yaml::Fields fields(root, "", origin);
                                   RobotModel model = read_robot(fields);
                                   fields.finish();
                                   return model;
                                 })
      .value();
}

void expect_reads_back(const RobotModel& model) {
  const std::string text = robot_text(model, 0);
  const RobotModel again = read_back(text);
  EXPECT_EQ(again, model) << text;
  EXPECT_EQ(robot_text(again, 0), text);
}

TEST(RobotText, ReadsBackBitForBit) {
  for (const RobotModel& model : {gripper(), builtin_robot("pusher").value(), two_links(), seven_axis()}) {
    SCOPED_TRACE(model.name);
    expect_reads_back(model);
  }
}

TEST(RobotText, ReadsBackAwkwardNumbersBitForBit) {
  RobotModel model = gripper();
  const double third = 1.0 / 3.0, slight = 0.1 + 0.2 - 0.3, least = 5e-324, next = std::nextafter(0.3, 1.0);
  model.joints[0].axis = {third, -third, third};
  model.joints[0].low = -1e300;
  model.joints[0].high = next;
  model.joints[1].armature = least;
  model.joints[2].start = -slight;
  model.axes[3].joints[1].second = -third;
  model.axes[3].limit = 1e-17;
  model.links[1].pose = {.position = {third, least, -next}, .orientation = {0.5, -0.5, third, slight}};
  model.links[0].inertia = {
      .mass = next, .pose = model.links[1].pose, .moments = {third, next, 1e-9, -slight, least, 0}};
  make_mesh(model, {third, 0, -1e-9, next, 1, 2, 3, 4, 5, slight, least, 1e-300});
  palm(model).size = {};
  model.hand->pose = model.links[1].pose;
  model.hand->near = third;
  expect_reads_back(model);
}

TEST(RobotText, KeepsEveryShapeAndMaterial) {
  RobotModel model = gripper();
  std::vector<RobotGeom>& geoms = model.links[0].geoms;
  geoms.push_back({.name = "c", .shape = GeomShape::kCylinder, .radius = 0.1, .height = 0.2, .material = "arm"});
  geoms.push_back({.name = "s", .shape = GeomShape::kSphere, .radius = 0.3, .mass = 2, .material = "dark"});
  geoms.push_back({.shape = GeomShape::kMesh, .vertices = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}});
  expect_reads_back(model);
}

TEST(RobotText, KeepsNamesThatNeedQuotes) {
  for (const std::string name : {"a: b", "- x", "\"quoted\"", "tab\tline\n", "42", "null", "ö", "#", "a[0]", "a.b"}) {
    RobotModel model = gripper();
    model.name = model.links[0].name = model.joints[0].name = model.axes[0].name = palm(model).name = name;
    SCOPED_TRACE(name);
    expect_reads_back(model);
  }
}

TEST(RobotText, IsIndented) {
  std::istringstream lines(robot_text(seven_axis(), 4));
  for (std::string line; std::getline(lines, line);) EXPECT_THAT(line, testing::StartsWith("    "));
}

TEST(RobotText, FillsInDefaults) {
  const RobotModel model = read_back(R"(
name: dot
links:
  - name: dot
    joints: [{name: x, axis: [1, 0, 0], kind: slide}]
    geoms: [{shape: sphere, radius: 0.1, mass: 1}]
axes: [{name: x, joints: {x: 1}}]
)");
  RobotModel wanted{.name = "dot"};
  wanted.joints = {{.name = "x", .kind = JointKind::kSlide, .axis = {1, 0, 0}}};
  wanted.links = {{.name = "dot", .joints = {0}, .geoms = {{.shape = GeomShape::kSphere, .radius = 0.1, .mass = 1}}}};
  wanted.axes = {{.name = "x", .joints = {{0, 1.0}}}};
  EXPECT_EQ(model, wanted);
}

// Where models come from.

TEST(BuiltinRobot, IsThereAndValidUnderEveryNameThatMessagesList) {
  for (const std::string name : {"planar_gripper", "pusher"}) {
    const auto model_result = builtin_robot(name);
    ASSERT_TRUE(model_result) << model_result.error().message;
    EXPECT_EQ(model_result->name, name);
    EXPECT_TRUE(validate(*model_result));
  }
}

TEST(BuiltinRobot, NamesThoseThereAreWhenThereIsNone) {
  const auto model_result = builtin_robot("humanoid");
  ASSERT_FALSE(model_result);
  EXPECT_EQ(model_result.error().code, Code::kNotFound);
  for (const char* words : {"humanoid", "planar_gripper", "pusher"}) {
    EXPECT_THAT(model_result.error().message, HasSubstr(words));
  }
}

std::string dot(const std::string& name) {
  return "jostle_robot: 1\nname: " + name + R"(
links: [{name: dot, joints: [{name: x, axis: [1, 0, 0], kind: slide, armature: 1, gain: 1, force_limit: 1}],
         geoms: [{shape: sphere, radius: 0.1, mass: 1}]}]
axes: [{name: x, joints: {x: 1}}]
)";
}

class FindRobot : public testing::Test {
 protected:
  std::string found(const std::string& name) const {
    const auto model_result = find_robot(name, path);
    return model_result ? model_result->name : model_result.error().message;
  }

  TempFolder base, second;
  const RobotPath path{.base = base.path(), .folders = {second.path()}};
};

TEST_F(FindRobot, TakesFilesByTheirNameWithOrWithoutEnding) {
  base.write("dot.yaml", dot("of the base"));
  EXPECT_EQ(found("dot"), "of the base");
  EXPECT_EQ(found("dot.yaml"), "of the base");
  EXPECT_EQ(found((base.path() / "dot").string()), "of the base");
}

TEST_F(FindRobot, TakesFoldersThatHoldARobot) {
  std::filesystem::create_directory(second.path() / "dot");
  second.write("dot/robot.yaml", dot("of a folder"));
  EXPECT_EQ(found("dot"), "of a folder");
}

TEST_F(FindRobot, PrefersBuiltInModelsThenTheBaseThenTheFolders) {
  for (const std::string name : {"dot.yaml", "pusher.yaml"}) second.write(name, dot("of the second"));
  EXPECT_EQ(found("dot"), "of the second");
  base.write("dot.yaml", dot("of the base"));
  EXPECT_EQ(found("dot"), "of the base");
  EXPECT_EQ(found("pusher"), "pusher");
}

TEST_F(FindRobot, TakesUrdfFiles) {
  const auto model_result = find_robot("seven_axis", {.base = kRobotFolder / "seven_axis"});
  ASSERT_TRUE(model_result) << model_result.error().message;
  EXPECT_EQ(model_result->name, "seven_axis");
}

TEST_F(FindRobot, ListsWhereItLooked) {
  const auto model_result = find_robot("dot", path);
  ASSERT_FALSE(model_result);
  EXPECT_EQ(model_result.error().code, Code::kNotFound);
  for (const std::string& words : {std::string("'dot'"), base.path().string(), second.path().string(),
                                   std::string("planar_gripper"), std::string("JOSTLE_MODELS")}) {
    EXPECT_THAT(model_result.error().message, HasSubstr(words));
  }
}

TEST_F(FindRobot, FindsNothingUnderNamesThatNoFileCanHave) {
  for (const std::string& name : {std::string(5000, 'x'), std::string("a\0b", 3), std::string("dot.yaml/x")}) {
    base.write("dot.yaml", dot("of the base"));
    const auto model_result = find_robot(name, path);
    ASSERT_FALSE(model_result);
    EXPECT_EQ(model_result.error().code, Code::kNotFound);
  }
}

// A scene that came over the wire opens no files.
TEST_F(FindRobot, OpensNoFileWithoutAFolder) {
  const std::string name = base.write("dot.yaml", dot("of the base")).string();
  const auto model_result = find_robot(name, {});
  ASSERT_FALSE(model_result);
  EXPECT_EQ(model_result.error().code, Code::kNotFound);
}

TEST_F(FindRobot, NamesFileLineAndFieldOfMistakes) {
  const auto complaint = [&](const std::string& from, const std::string& to) {
    std::string text = dot("wrong");
    text.replace(text.find(from), from.size(), to);
    base.write("dot.yaml", text);
    return found("dot");
  };
  const std::string file = (base.path() / "dot.yaml").string();
  const auto told = [&](auto... words) { return testing::AllOf(HasSubstr(file), HasSubstr(words)...); };
  EXPECT_THAT(complaint("jostle_robot: 1", "jostle_robot: 2"), told(":1: jostle_robot", "got version 2", "wanted 1"));
  EXPECT_THAT(complaint("radius", "radios"), told(":4: links[0].geoms[0].radios", "did you mean radius"));
  EXPECT_THAT(complaint("{x: 1}", "{y: 1}"), told(":5: axes[0].joints", "got 'y'", "one of: x"));
  EXPECT_THAT(complaint("slide", "screw"), told(":3: links[0].joints[0].kind", "got 'screw'", "hinge, slide"));
  EXPECT_THAT(complaint("axes:", "axles:"), told(":5: axles", "did you mean axes"));
  EXPECT_THAT(complaint("gain: 1", "gain: 1000"), told("robot.joints[0] ('x').gain", "got 1000"));
}

// Restores what it was.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    setenv(name, value.c_str(), 1);
  }
  ~Variable() { old_ ? setenv(name_, old_->c_str(), 1) : unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
  std::optional<std::string> old_;
};

TEST(RobotPath, HoldsTheFoldersOfItsVariables) {
  const Variable ours("JOSTLE_MODELS", "/a:/b:"), first("ROS_PACKAGE_PATH", "/c"),
      second("AMENT_PREFIX_PATH", "/d::/e");
  const RobotPath path = robot_path("/scenes");
  EXPECT_EQ(path.base, "/scenes");
  std::vector<std::string> folders;
  for (const auto& folder : path.folders) folders.push_back((folder / "x").string());
  EXPECT_THAT(folders, ElementsAre("/a/x", "/b/x", "/c/x", "/d/share/x", "/e/share/x"));
}

TEST(RobotPath, LooksInTheWorkingFolderForAFileThatNamesNone) { EXPECT_EQ(robot_path("").base, "."); }

}  // namespace
}  // namespace jostle::physics_pool
