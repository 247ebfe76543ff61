// Where the links of a robot are: against closed forms, and against the engine.

#include "physics_pool/robot/kinematics.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "physics_pool/local/engine.hpp"
#include "physics_pool/local/simulator.hpp"
#include "tests/support/arms.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

Isometry3d moved(double x, double y, double z) { return Isometry3d(Eigen::Translation3d(x, y, z)); }
Isometry3d turned(double angle, const Vector3d& axis) { return Isometry3d(Eigen::AngleAxisd(angle, axis)); }

void expect_near(const Isometry3d& X, const Isometry3d& wanted, double tolerance) {
  EXPECT_LT((X.matrix() - wanted.matrix()).cwiseAbs().maxCoeff(), tolerance) << X.matrix() << "\nbut wanted\n"
                                                                             << wanted.matrix();
}

// Closed forms.

TEST(LinkPose, IsThatOfTheHandCalculationForTwoLinks) {
  const RobotModel model = two_links();
  for (const double a : {-1.2, 0.0, 0.7}) {
    for (const double b : {-2.0, 0.0, 0.4}) {
      const std::vector<double> q{a, b};
      const double elbow_x = kUpper * std::cos(a), elbow_y = kUpper * std::sin(a);
      expect_near(link_pose(model, Isometry3d::Identity(), q, 0), moved(0, 0, 0.04) * turned(a, Vector3d::UnitZ()),
                  1e-15);
      expect_near(link_pose(model, Isometry3d::Identity(), q, 1),
                  moved(elbow_x, elbow_y, 0.04) * turned(a + b, Vector3d::UnitZ()), 1e-15);
      expect_near(link_pose(model, Isometry3d::Identity(), q, 2),
                  moved(elbow_x + kLower * std::cos(a + b), elbow_y + kLower * std::sin(a + b), 0.04) *
                      turned(a + b, Vector3d::UnitZ()),
                  1e-15);
    }
  }
}

TEST(LinkPose, LetsTheJointsOfALinkActOneAfterTheOther) {
  const RobotModel model = builtin_robot("planar_gripper").value();
  const std::vector<double> q{0.1, -0.2, 0.5, 0.03, 0.01};
  const Isometry3d palm = moved(0.1, -0.2, 0.035) * turned(0.5, Vector3d::UnitZ());
  expect_near(link_pose(model, Isometry3d::Identity(), q, 0), palm, 1e-15);
  expect_near(link_pose(model, Isometry3d::Identity(), q, 1), palm * moved(0, 0.0075 + 0.03, -0.015), 1e-15);
  expect_near(link_pose(model, Isometry3d::Identity(), q, 2), palm * moved(0, -0.0075 - 0.01, -0.015), 1e-15);
}

TEST(LinkPose, SlidesAlongAxesThatEarlierJointsHaveTurned) {
  RobotModel model;
  model.joints = {{.kind = JointKind::kHinge, .axis = {0, 0, 1}}, {.kind = JointKind::kSlide, .axis = {1, 0, 0}}};
  model.links = {{.joints = {0, 1}}};
  const std::vector<double> q{kPi / 2, 0.3};
  EXPECT_LT((link_pose(model, Isometry3d::Identity(), q, 0).translation() - Vector3d(0, 0.3, 0)).norm(), 1e-15);
}

TEST(LinkPose, StandsOnTheBase) {
  const RobotModel model = seven_axis();
  const Isometry3d base = moved(1, 2, 3) * turned(0.4, Vector3d(1, 2, 2) / 3);
  const std::vector<double> q{0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.01, 0.02};
  for (int i = 0; i < static_cast<int>(model.links.size()); ++i) {
    expect_near(link_pose(model, base, q, i), base * link_pose(model, Isometry3d::Identity(), q, i), 1e-14);
  }
}

TEST(LinkPose, IsStraightUpForAnArmAtZero) {
  const RobotModel model = seven_axis();
  const std::vector<double> q(kSevenAxisJoints, 0.0);
  // 0.32 m to the shoulder, 0.38 m to the elbow, 0.34 m to the wrist and 0.18 m to the tool.
  expect_near(tool_pose(model, Isometry3d::Identity(), q), moved(0, 0, 1.22) * turned(-kPi / 2, Vector3d::UnitY()),
              1e-15);
}

TEST(ToolPose, IsTheHandsFrameWhereThereIsOne) {
  RobotModel model = builtin_robot("planar_gripper").value();
  const std::vector<double> q{0.1, -0.2, 0.5, 0.03, 0.01};
  const Isometry3d palm = link_pose(model, Isometry3d::Identity(), q, 0);
  expect_near(tool_pose(model, Isometry3d::Identity(), q), palm, 1e-15);
  model.hand->pose = {.position = {0.1, 0, 0}, .orientation = turned_about_z(0.3)};
  expect_near(tool_pose(model, Isometry3d::Identity(), q), palm * moved(0.1, 0, 0) * turned(0.3, Vector3d::UnitZ()),
              1e-15);
}

TEST(ToolPose, IsTheLastLinksWhereThereIsNoHand) {
  const std::vector<double> q{0.3, -0.8};
  expect_near(tool_pose(two_links(), moved(-0.4, 0, 0), q), link_pose(two_links(), moved(-0.4, 0, 0), q, 2), 1e-15);
}

// The tool moves as the derivative of its pose says: with the axis crossed with the way from the joint.
TEST(LinkPose, MovesEveryJointAboutOrAlongItsAxis) {
  const RobotModel model = seven_axis();
  const std::vector<double> q{0.3, 0.8, -0.5, 1.1, 0.4, -0.7, 0.9, 0.02, 0.01};
  constexpr double kStep = 1e-6;
  for (int link = 0; link < static_cast<int>(model.links.size()); ++link) {
    for (const int j : model.links[static_cast<std::size_t>(link)].joints) {
      const Joint& joint = model.joints[static_cast<std::size_t>(j)];
      const auto point = [&](double step) -> Vector3d {
        std::vector<double> near = q;
        near[static_cast<std::size_t>(j)] += step;
        return link_pose(model, Isometry3d::Identity(), near, link) * Vector3d(0.1, 0.2, 0.3);
      };
      const Isometry3d X = link_pose(model, Isometry3d::Identity(), q, link);
      const Vector3d axis = X.linear() * Vector3d(joint.axis[0], joint.axis[1], joint.axis[2]);
      const Vector3d wanted = joint.kind == JointKind::kSlide ? axis : axis.cross(point(0) - X.translation());
      EXPECT_LT(((point(kStep) - point(-kStep)) / (2 * kStep) - wanted).norm(), 1e-8) << joint.name;
    }
  }
}

// The engine.

Isometry3d frame(const mjtNum* position, const mjtNum* matrix) {
  Isometry3d X;
  X.makeAffine();
  X.translation() = Eigen::Map<const Vector3d>(position);
  X.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(matrix);
  return X;
}

WorldPtr compiled(const Scene& scene) {
  auto world_result = World::compile(scene);
  if (!world_result) throw std::runtime_error(world_result.error().message);
  return std::move(world_result).value();
}

// A robot far from everything, on a base that leans.
Scene alone(RobotModel model) {
  Scene scene = target_only();
  scene.task.kind = "reach";
  scene.robot = {.model = std::move(model), .base = pose_of(moved(-3, 1, 2) * turned(0.6, Vector3d(2, 1, -2) / 3))};
  scene.robot.q = scene.robot.model.start();
  return scene;
}

struct Robot {
  const char* name;
  RobotModel (*model)();
};

void PrintTo(const Robot& value, std::ostream* out) { *out << value.name; }

class Engine : public testing::TestWithParam<Robot> {
 protected:
  void at(const std::vector<double>& q) {
    std::ranges::copy(q, data->qpos);
    mj_kinematics(world->model(), data.get());
  }
  // Random numbers within the limits of the joints.
  std::vector<double> posture() {
    std::vector<double> q;
    for (const Joint& joint : model.joints) {
      const double low = std::max(joint.low, -2.0), high = std::min(joint.high, 2.0);
      q.push_back(std::uniform_real_distribution(low, high)(random));
    }
    return q;
  }
  Isometry3d link(const std::vector<double>& q, std::size_t i) const {
    return link_pose(model, transform(world->scene().robot.base), q, static_cast<int>(i));
  }

  // Body 0 is the world; of these robots every link is followed by its children.
  static int body_of(std::size_t link) { return static_cast<int>(link) + 1; }

  const RobotModel model = GetParam().model();
  const WorldPtr world = compiled(alone(model));
  const DataPtr data{mj_makeData(world->model())};
  std::mt19937 random{5};
};

TEST_P(Engine, HasTheLinksWhereTheyAre) {
  for (int posture_number = 0; posture_number < 20; ++posture_number) {
    const std::vector<double> q = posture();
    at(q);
    for (std::size_t i = 0; i < model.links.size(); ++i) {
      const int body = body_of(i);
      expect_near(link(q, i), frame(data->xpos + 3 * body, data->xmat + 9 * body), 1e-12);
    }
  }
}

TEST_P(Engine, HasTheShapesWhereTheyAre) {
  const mjModel& m = *world->model();
  for (int posture_number = 0; posture_number < 20; ++posture_number) {
    const std::vector<double> q = posture();
    at(q);
    for (std::size_t i = 0; i < model.links.size(); ++i) {
      const int body = body_of(i);
      ASSERT_EQ(m.body_geomnum[body], static_cast<int>(model.links[i].geoms.size()));
      for (std::size_t k = 0; k < model.links[i].geoms.size(); ++k) {
        const RobotGeom& geom = model.links[i].geoms[k];
        const int id = m.body_geomadr[body] + static_cast<int>(k);
        const Isometry3d wanted = link(q, i) * transform(geom.pose);
        const Isometry3d X = frame(data->geom_xpos + 3 * id, data->geom_xmat + 9 * id);
        if (geom.shape != GeomShape::kMesh) {
          expect_near(X, wanted, 1e-12);
          continue;
        }
        // The engine moves a mesh's frame into its middle; its points, which are floats there, stay where they were.
        const int mesh = m.geom_dataid[id];
        ASSERT_EQ(m.mesh_vertnum[mesh], static_cast<int>(geom.vertices.size() / 3));
        for (int v = 0; v < m.mesh_vertnum[mesh]; ++v) {
          const Vector3d p =
              Eigen::Map<const Eigen::Vector3f>(m.mesh_vert + 3 * (m.mesh_vertadr[mesh] + v)).cast<double>();
          EXPECT_LT((X * p - wanted * Vector3d(geom.vertices.data() + 3 * v)).norm(), 1e-6);
        }
      }
    }
  }
}

TEST_P(Engine, HasTheToolWhereItIs) {
  const TaskGeometry& geometry = world->geometry();
  State x = initial_state(world->scene());
  const std::vector<double> q = posture();
  std::ranges::copy(q, x.q.begin());
  at(q);
  const int body = body_of(model.hand ? static_cast<std::size_t>(model.hand->link) : model.links.size() - 1);
  Isometry3d wanted = frame(data->xpos + 3 * body, data->xmat + 9 * body);
  if (model.hand) wanted = wanted * transform(model.hand->pose);
  expect_near(tool_pose(geometry, x), wanted, 1e-12);
}

const std::vector<Robot> kRobots{{"PlanarGripper", [] { return builtin_robot("planar_gripper").value(); }},
                                 {"Pusher", [] { return builtin_robot("pusher").value(); }},
                                 {"TwoLinks", two_links},
                                 {"SevenAxis", seven_axis}};

INSTANTIATE_TEST_SUITE_P(Robots, Engine, testing::ValuesIn(kRobots),
                         [](const auto& param) { return std::string(param.param.name); });

// A hinge along z through a link that weighs 2 kg, 0.3 m off the axis. About it: R M R^T's zz, by Steiner m d^2 more.
TEST(EngineInertia, IsThatOfTheLinkHoweverItsFrameIsTurned) {
  for (const double angle : {0.0, 0.8, kPi / 2}) {
    RobotModel model = two_links();
    model.links.pop_back();
    model.links.pop_back();
    model.joints.pop_back();
    model.axes.pop_back();
    const Vector3d axis = Vector3d(1, 2, 2) / 3;
    const Isometry3d X_LC = moved(0.3, 0, 0.1) * turned(angle, axis);
    const std::array<double, 6> moments{0.1, 0.2, 0.25, 0.02, -0.03, 0.01};
    model.links[0].inertia = {.mass = 2, .pose = pose_of(X_LC), .moments = moments};
    Scene scene = alone(model);
    scene.robot.base = {};
    scene.robot.base.position = {-3, 0, 0};
    const WorldPtr world = compiled(scene);
    const DataPtr data(mj_makeData(world->model()));
    mj_forward(world->model(), data.get());
    const auto& [xx, yy, zz, xy, xz, yz] = moments;
    const Eigen::Matrix3d M = (Eigen::Matrix3d() << xx, xy, xz, xy, yy, yz, xz, yz, zz).finished();
    const Eigen::Matrix3d R = X_LC.linear();
    const double about_axis = (R * M * R.transpose())(2, 2) + 2 * 0.3 * 0.3 + model.joints[0].armature;
    EXPECT_NEAR(data->qM[0], about_axis, 1e-7);  // the engine finds the principal axes by iteration
  }
}

// What only the engine's own names stand against.
TEST(EngineNames, LetALinkBeCalledWorld) {
  Scene scene = alone(seven_axis());
  scene.robot.model.links[0].name = "world";  // as many URDF files call their root
  const auto world_result = World::compile(scene);
  EXPECT_TRUE(world_result) << world_result.error().message;
}

TEST(EngineNames, LetAGeomBeCalledAsSomethingOfTheScene) {
  Scene scene = alone(seven_axis());
  scene.robot.model.links[0].geoms[0].name = "floor";
  const auto world_result = World::compile(scene);
  EXPECT_TRUE(world_result) << world_result.error().message;
}

// An arm in motion.

class ArmInMotion : public testing::Test {
 protected:
  State after(double seconds) {
    Simulator simulator(compiled(scene));
    State x = initial_state(scene);
    const Advance advance = simulator.advance(x, u, static_cast<int>(std::lround(seconds / scene.physics.time_step)));
    EXPECT_EQ(advance.diverged, "");
    return x;
  }

  Scene scene = seven_axis_reach();
  std::vector<double> u = std::vector<double>(kSevenAxisControls, 0.0);
};

TEST_F(ArmInMotion, HoldsItselfUpWhereverItIs) {
  for (const std::vector<double>& q : {scene.robot.q, std::vector<double>{0, -1, 0, 1, 0, 0, 0, 0, 0},
                                       std::vector<double>{1, 1.2, 0, 0, 0.3, 0, 0, 0.02, 0.02}}) {
    scene.robot.q = q;
    const State x = after(1.0);
    for (std::size_t i = 0; i < q.size(); ++i) EXPECT_NEAR(x.q[i], q[i], 1e-9);
  }
}

TEST_F(ArmInMotion, MovesEachAxisAsFarAsVelocityTimesTime) {
  for (int axis = 0; axis < kFinger; ++axis) {
    u.assign(u.size(), 0.0);
    u[static_cast<std::size_t>(axis)] = -0.1;  // away from the box
    const State x = after(0.5);
    for (int j = 0; j < kFinger; ++j) {
      const auto i = static_cast<std::size_t>(j);
      // A drive reaches its speed in 10 ms and the arm's inertia, and pulls its neighbours along while it does.
      EXPECT_NEAR(x.q[i] - scene.robot.q[i], j == axis ? -0.05 : 0.0, 0.005) << "joint " << j << " by axis " << axis;
    }
  }
}

TEST_F(ArmInMotion, MovesBothFingersByOneAxis) {
  scene.objects[1].y = 0.2;  // the box would be in the way
  u[kFinger] = 0.05;
  const State x = after(0.4);
  EXPECT_NEAR(x.q[kFinger], 0.02, 1e-3);
  EXPECT_NEAR(x.q[kFingerFollower], x.q[kFinger], 1e-6);
}

// What the file of the scene promises.
TEST_F(ArmInMotion, PushesTheBoxWithSmallVelocitiesOfItsFirstOrThirdAxis) {
  const auto box = static_cast<std::size_t>(layout_of(scene).objects[1].q);
  const State start = initial_state(scene);
  for (const int axis : {kAxis1, kAxis3}) {
    u.assign(u.size(), 0.0);
    u[static_cast<std::size_t>(axis)] = 0.1;
    const State x = after(0.6);
    EXPECT_GT(x.q[box + 1] - start.q[box + 1], 0.01);
    EXPECT_NEAR(x.q[box + 2], start.q[box + 2], 1e-3);
  }
  u.assign(u.size(), 0.0);
  const State x = after(0.6);
  for (std::size_t i = 0; i < x.q.size(); ++i) EXPECT_NEAR(x.q[i], start.q[i], 1e-4);
}

}  // namespace
}  // namespace jostle::physics_pool
