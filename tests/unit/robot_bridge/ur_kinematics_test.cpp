#include "robot_bridge/ur/kinematics.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <map>
#include <numbers>
#include <random>

namespace jostle::robot_bridge::ur {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using testing::Each;
using testing::SizeIs;

constexpr double kPi = std::numbers::pi;
constexpr int kPoses = 10'000;

const Dh& dh() { return Dh::ur5(); }

double distance(const Isometry3d& a, const Isometry3d& b) {
  const Eigen::AngleAxisd turn(a.linear().transpose() * b.linear());
  return std::max((a.translation() - b.translation()).norm(), std::abs(turn.angle()));
}

// The largest difference of a joint, whole turns aside.
double difference(const Joints& a, const Joints& b) {
  double largest = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j)
    largest = std::max(largest, std::abs(std::remainder(a[j] - b[j], 2 * kPi)));
  return largest;
}

class RandomJoints {
 public:
  Joints next() {
    Joints q;
    for (double& angle : q) angle = uniform_(generator_);
    return q;
  }

 private:
  std::mt19937_64 generator_{1};
  std::uniform_real_distribution<double> uniform_{-kPi, kPi};
};

// The maker's table gives these for two postures.
TEST(UrKinematics, HaveTheFlangeWhereTheMakerHasIt) {
  const Vector3d zeros = flange_pose(dh(), {}).translation();
  EXPECT_NEAR((zeros - Vector3d(-0.81725, -0.19145, -0.005491)).norm(), 0.0, 1e-6);
  const Vector3d up = flange_pose(dh(), {0, -kPi / 2, 0, -kPi / 2, 0, 0}).translation();
  EXPECT_NEAR((up - Vector3d(0, -0.19145, 1.0011)).norm(), 0.0, 1e-4);
}

TEST(UrKinematics, HaveAJacobianThatIsTheirDerivative) {
  constexpr double kStep = 1e-6;
  RandomJoints random;
  for (int i = 0; i < 100; ++i) {
    const Joints q = random.next();
    const auto J = jacobian(dh(), q);
    for (std::size_t j = 0; j < q.size(); ++j) {
      Joints more = q, less = q;
      more[j] += kStep;
      less[j] -= kStep;
      const Isometry3d a = flange_pose(dh(), less), b = flange_pose(dh(), more);
      const Eigen::AngleAxisd turn(b.linear() * a.linear().transpose());
      Eigen::Matrix<double, 6, 1> numeric;
      numeric << (b.translation() - a.translation()) / (2 * kStep), turn.axis() * turn.angle() / (2 * kStep);
      EXPECT_LT((numeric - J.col(static_cast<Eigen::Index>(j))).norm(), 1e-6);
    }
  }
}

// Every solution brings the flange there, no two are the same, and the posture that the pose was made from is one.
TEST(UrInverse, FindsEverySolutionOfReachablePoses) {
  RandomJoints random;
  std::map<std::size_t, int> counts;
  double worst = 0.0;
  for (int i = 0; i < kPoses; ++i) {
    const Joints q = random.next();
    const Isometry3d X = flange_pose(dh(), q);
    const auto solutions = inverse(dh(), X);
    ++counts[solutions.size()];
    bool has_its_own = false;
    for (std::size_t a = 0; a < solutions.size(); ++a) {
      worst = std::max(worst, distance(flange_pose(dh(), solutions[a]), X));
      EXPECT_THAT(solutions[a], Each(testing::AllOf(testing::Gt(-kPi), testing::Le(kPi))));
      has_its_own = has_its_own || difference(solutions[a], q) < 1e-6;
      for (std::size_t b = 0; b < a; ++b) EXPECT_GT(difference(solutions[a], solutions[b]), 1e-9);
    }
    EXPECT_TRUE(has_its_own) << "pose " << i;
  }
  EXPECT_LT(worst, 1e-9) << "m and rad";
  // What is known of the arm: 77 % of poses can be reached in 8 ways, 5 % in 6, 15 % in 4, 3 % in 2.
  EXPECT_NEAR(counts[8] / double(kPoses), 0.77, 0.02);
  EXPECT_NEAR(counts[6] / double(kPoses), 0.05, 0.02);
  EXPECT_NEAR(counts[4] / double(kPoses), 0.15, 0.02);
  EXPECT_NEAR(counts[2] / double(kPoses), 0.03, 0.02);
}

TEST(UrInverse, OfPosesOutOfReachIsEmpty) {
  Isometry3d X = Isometry3d::Identity();
  X.translation() = Vector3d(1.2, 0, 0.3);
  EXPECT_THAT(inverse(dh(), X), SizeIs(0));
  X.translation() = Vector3d(0, 0, 0.3);  // the wrist's centre on the shoulder's axis
  EXPECT_THAT(inverse(dh(), X), SizeIs(0));
}

// Joints 4 and 6 turn about one line: one of them is free, and takes the value it is given.
TEST(UrInverse, OfAStraightWristKeepsTheFreeJoint) {
  const Joints q{0.3, -1.2, 1.5, -0.4, 0.0, 0.7};
  const Isometry3d X = flange_pose(dh(), q);
  const auto solutions = inverse(dh(), X, 0.7);
  bool has_its_own = false;
  for (const Joints& solution : solutions) {
    EXPECT_LT(distance(flange_pose(dh(), solution), X), 1e-6);
    has_its_own = has_its_own || difference(solution, q) < 1e-5;
  }
  EXPECT_TRUE(has_its_own);
}

TEST(UrInverse, NearASingularPostureStillReachesThePose) {
  for (const double elbow : {1e-3, 1e-5}) {
    const Isometry3d X = flange_pose(dh(), {0.1, -0.8, elbow, 0.5, 1.0, 0.2});
    const auto solutions = inverse(dh(), X);
    ASSERT_FALSE(solutions.empty());
    for (const Joints& solution : solutions) EXPECT_LT(distance(flange_pose(dh(), solution), X), 1e-9);
  }
}

TEST(UrNearest, ChoosesTheSolutionNextToTheSeedWholeTurnsIncluded) {
  const Joints q{0.3, -1.2, 1.5, -0.4, 0.9, 3.0};
  const auto solutions = inverse(dh(), flange_pose(dh(), q));
  Joints seed = q;
  seed[5] += 2 * kPi - 6.1;  // nearer to q[5] - 2 pi than to q[5] by no means: the turn is undone
  seed[0] += 0.01;
  const auto found = nearest(solutions, seed, 2 * kPi);
  ASSERT_TRUE(found);
  EXPECT_LT(difference(*found, q), 1e-9);
  EXPECT_LE(std::abs((*found)[5] - seed[5]), kPi);
  EXPECT_FALSE(nearest({}, seed, 2 * kPi));
}

TEST(UrNearest, LeavesAJointWhereATurnWouldPassItsLimit) {
  const std::vector<Joints> solutions{Joints{0, 0, 0, 0, 0, 3.0}};
  const auto found = nearest(solutions, Joints{0, 0, 0, 0, 0, -3.2}, 3.1);
  ASSERT_TRUE(found);
  EXPECT_EQ((*found)[5], 3.0);
}

}  // namespace
}  // namespace jostle::robot_bridge::ur
