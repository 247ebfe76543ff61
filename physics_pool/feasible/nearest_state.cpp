#include "physics_pool/feasible/nearest_state.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <set>

#include "idl/types/transform.hpp"
#include "physics_pool/coarse/touching.hpp"

namespace jostle::physics_pool {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double kForesight = 0.03;  // m; pairs that are farther apart are not asked
constexpr int kRounds = 60, kSweeps = 200, kStarts = 12;
constexpr double kMostTurn = 0.2;  // rad of one round
constexpr double kSettled = 1e-7;  // m and rad between two rounds
constexpr double kMostTilt = 0.6;  // rad; no covariance makes more of it stand

// A body as the plane shows it.
struct Footprint {
  Outline outline;
  double height = 0.0;     // m, of the origin above the surface
  Vector3d up{0, 0, 1};    // in the body's frame
  Vector3d side{1, 0, 0};  // in the body's frame: the outline's x axis
};

// What an object looks like that stands as nearly as it is turned now.
Footprint footprint(const SceneObject& object, const Matrix3d& R_WB) {
  const Vector3d z = R_WB.transpose().col(2);  // the world's, in the body's frame
  if (object.shape == Shape::kCylinder) {
    if (std::abs(z.z()) > std::sqrt(0.5))
      return {.outline = outline(object), .height = object.height / 2, .up = {0, 0, std::copysign(1.0, z.z())}};
    return {.outline = {.half_x = object.height / 2, .half_y = object.radius},
            .height = object.radius,
            .up = Vector3d(z.x(), z.y(), 0).normalized(),
            .side = {0, 0, 1}};
  }
  Eigen::Index axis = 0;
  z.cwiseAbs().maxCoeff(&axis);
  const Eigen::Index x = axis == 0 ? 1 : 0, y = axis == 2 ? 1 : 2;
  const auto half = [&](Eigen::Index i) { return object.size.at(static_cast<std::size_t>(i)) / 2; };
  return {.outline = {.half_x = half(x), .half_y = half(y)},
          .height = half(axis),
          .up = std::copysign(1.0, z[axis]) * Vector3d::Unit(axis),
          .side = Vector3d::Unit(x)};
}

// An object that stands; x: its place in the plane and the turn of its outline.
struct Body {
  std::size_t index = 0;  // among the measured
  Outline outline;
  double top = 0.0, reach = 0.0;  // m
  Matrix3d R_WB;                  // upright, as turned by `start`
  double height = 0.0;            // m, of the origin
  Vector3d measured, x;           // conditioned on standing; now
  Matrix3d covariance, information;
  double standing = 0.0;  // squared Mahalanobis distance of making it stand
};

struct Wall {  // an upright fixture
  std::string name;
  Outline outline;
  PlanarPose pose;
  double bottom = 0.0, top = 0.0, reach = 0.0;
};

PlanarPose planar(const Vector3d& x) { return {x.x(), x.y(), x.z()}; }

// One linear inequality: J_a dx_a + J_b dx_b >= bound.
struct Row {
  int a = -1, b = -1;
  Vector3d ja{0, 0, 0}, jb{0, 0, 0};
  double bound = 0.0, inverse = 0.0, multiplier = 0.0;
};

Result<Matrix6d> covariance_of(const MeasuredObject& object, const NearestOptions& options) {
  const auto& [p, q] = object.X_WB;
  const Eigen::Map<const Matrix6d> given(object.covariance.data());
  const Quaterniond R(q[0], q[1], q[2], q[3]);
  if (!Vector3d(p.data()).allFinite() || !(std::abs(R.norm() - 1) < 1e-3))
    return invalid(fmt::format("pose of '{}'", object.name), "what is none", "finite metres and a unit quaternion");
  Matrix6d covariance = (given + given.transpose()) / 2;
  covariance.diagonal().head<3>().array() += options.slack * options.slack;
  covariance.diagonal().tail<3>().array() += options.turning_slack * options.turning_slack;
  if (!covariance.allFinite() || Eigen::LLT<Matrix6d>(covariance).info() != Eigen::Success)
    return invalid(fmt::format("covariance of '{}'", object.name), "what is none",
                   "a symmetric matrix without negative eigenvalues");
  return covariance;
}

// Nothing if it does not stand.
std::optional<Body> standing(const SceneObject& object, const Surface& surface, const Pose& pose,
                             const Matrix6d& covariance, double most) {
  const Eigen::Isometry3d X_WB = transform(pose);
  const Footprint print = footprint(object, X_WB.linear());
  const Vector3d up = X_WB.linear() * print.up, axis = up.cross(Vector3d::UnitZ());
  const double tilt = std::atan2(axis.norm(), up.z());
  if (tilt > kMostTilt) return std::nullopt;
  const Vector3d raise = axis.norm() > 0 ? Vector3d(tilt / axis.norm() * axis) : Vector3d(0, 0, 0);
  // Of (x, y, z, and rotations about them): held are z and the tilt, free are x, y and the turn.
  constexpr std::array<int, 3> kHeld{2, 3, 4}, kFree{0, 1, 5};
  const Vector3d off(print.height - X_WB.translation().z(), raise.x(), raise.y());
  const Matrix3d held = covariance(kHeld, kHeld), across = covariance(kFree, kHeld);
  const Eigen::LDLT<Matrix3d> solver(held);
  Body body;
  body.standing = off.dot(solver.solve(off));
  if (body.standing > most) return std::nullopt;
  const Vector3d along = across * solver.solve(off);
  body.covariance = covariance(kFree, kFree) - across * solver.solve(across.transpose());
  body.information = body.covariance.inverse();
  body.outline = print.outline;
  body.height = print.height;
  body.top = 2 * print.height;
  body.reach = reach_of(print.outline);
  const Matrix3d upright = (raise.norm() > 0 ? Eigen::AngleAxisd(raise.norm(), raise.normalized()).toRotationMatrix()
                                             : Matrix3d(Matrix3d::Identity())) *
                           X_WB.linear();
  body.R_WB = Eigen::AngleAxisd(along.z(), Vector3d::UnitZ()) * upright;
  const Vector3d side = body.R_WB * print.side;
  body.measured = {X_WB.translation().x() + along.x(), X_WB.translation().y() + along.y(),
                   std::atan2(side.y(), side.x())};
  body.x = body.measured;
  if (!surface.carries(body.x.x(), body.x.y())) return std::nullopt;
  return body;
}

std::vector<Wall> walls_of(const Scene& scene) {
  std::vector<Wall> walls;
  for (const Fixture& fixture : scene.fixtures) {
    const SceneObject body{
        .shape = fixture.shape, .size = fixture.size, .radius = fixture.radius, .height = fixture.height};
    const double half = body.rest_height();
    const auto& q = fixture.pose.orientation;
    if (uprightness(q.data()) < 1 - 1e-6) continue;
    const Outline shape = outline(body);
    walls.push_back({.name = fixture.name,
                     .outline = shape,
                     .pose = {fixture.pose.position[0], fixture.pose.position[1], yaw_of(q.data())},
                     .bottom = fixture.pose.position[2] - half,
                     .top = fixture.pose.position[2] + half,
                     .reach = reach_of(shape)});
  }
  return walls;
}

class Problem {
 public:
  Problem(std::vector<Body> bodies, const Scene& scene, const NearestOptions& options)
      : bodies_(std::move(bodies)), walls_(walls_of(scene)), surface_(scene.surface), options_(options) {}

  // Goes to the nearest minimum from where the bodies are.
  void settle() {
    for (int round = 0; round < kRounds; ++round) {
      find_rows();
      if (clear_ && round > 0 && change_ < kSettled) break;
      solve();
      step(round < kRounds / 2 ? 1.0 : 0.5);
    }
    find_rows();
  }

  void start(std::mt19937_64* random) {
    std::normal_distribution<double> normal;
    for (Body& body : bodies_) {
      body.x = body.measured;
      if (!random) continue;
      const Vector3d draw(normal(*random), normal(*random), normal(*random));
      body.x += Matrix3d(body.covariance.llt().matrixL()) * draw;
    }
  }

  double moved(const Body& body) const {
    const Vector3d by = body.x - body.measured;
    return body.standing + by.dot(body.information * by);
  }

  // Indices of bodies that overlap, that were moved too far, or off the surface.
  std::set<std::size_t> to_blame() const {
    std::set<std::size_t> bad = overlapping_;
    for (const Body& body : bodies_) {
      if (moved(body) > options_.most || !surface_.carries(body.x.x(), body.x.y())) bad.insert(body.index);
    }
    return bad;
  }

  const std::vector<Body>& bodies() const { return bodies_; }

 private:
  void add(int a, int b, const Touches& touches, const Vector2d& place_b) {
    const auto lever = [](const Vector2d& arm, const Vector2d& n) { return arm.x() * n.y() - arm.y() * n.x(); };
    Body& first = bodies_[static_cast<std::size_t>(a)];
    for (int i = 0; i < touches.count; ++i) {
      const Touch& touch = touches.values.at(static_cast<std::size_t>(i));
      const Vector2d& n = touch.normal;
      Row row{.a = a, .b = b, .ja = {n.x(), n.y(), lever(touch.point - first.x.head<2>(), n)}};
      // From where they were measured, not from where they are.
      row.bound = options_.gap - touch.gap + row.ja.dot(first.x - first.measured);
      double yield = row.ja.dot(first.covariance * row.ja);
      if (b >= 0) {
        const Body& second = bodies_[static_cast<std::size_t>(b)];
        row.jb = {-n.x(), -n.y(), -lever(touch.point - place_b, n)};
        row.bound += row.jb.dot(second.x - second.measured);
        yield += row.jb.dot(second.covariance * row.jb);
      }
      row.inverse = 1 / yield;
      rows_.push_back(row);
      if (touch.gap > 0) continue;
      clear_ = false;
      overlapping_.insert(first.index);
      if (b >= 0) overlapping_.insert(bodies_[static_cast<std::size_t>(b)].index);
    }
  }

  void find_rows() {
    rows_.clear();
    overlapping_.clear();
    clear_ = true;
    const auto near = [](const Vector2d& a, double reach_a, const Vector2d& b, double reach_b) {
      return (a - b).norm() < reach_a + reach_b + kForesight;
    };
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const Body& a = bodies_[i];
      for (std::size_t j = 0; j < i; ++j) {
        const Body& b = bodies_[j];
        if (!near(a.x.head<2>(), a.reach, b.x.head<2>(), b.reach)) continue;
        add(static_cast<int>(i), static_cast<int>(j),
            find_touches(a.outline, planar(a.x), b.outline, planar(b.x), kForesight), b.x.head<2>());
      }
      for (const Wall& wall : walls_) {
        if (wall.bottom >= a.top || wall.top <= 0 || !near(a.x.head<2>(), a.reach, wall.pose.place, wall.reach))
          continue;
        add(static_cast<int>(i), -1, find_touches(a.outline, planar(a.x), wall.outline, wall.pose, kForesight),
            wall.pose.place);
      }
    }
  }

  // Least by the covariances, of what keeps all gaps as the rows have them.
  void solve() {
    goal_.assign(bodies_.size(), Vector3d(0, 0, 0));
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      double largest = 0.0;
      for (Row& row : rows_) {
        const auto a = static_cast<std::size_t>(row.a), b = static_cast<std::size_t>(std::max(row.b, 0));
        double reached = row.ja.dot(goal_[a]);
        if (row.b >= 0) reached += row.jb.dot(goal_[b]);
        const double now = std::max(row.multiplier + (row.bound - reached) * row.inverse, 0.0);
        const double by = now - row.multiplier;
        if (by == 0.0) continue;
        row.multiplier = now;
        goal_[a] += by * (bodies_[a].covariance * row.ja);
        if (row.b >= 0) goal_[b] += by * (bodies_[b].covariance * row.jb);
        largest = std::max(largest, std::abs(by) / row.inverse);
      }
      if (largest < kSettled) break;
    }
  }

  void step(double share) {
    change_ = 0.0;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      Body& body = bodies_[i];
      Vector3d by = share * (body.measured + goal_[i] - body.x);
      by.z() = std::clamp(by.z(), -kMostTurn, kMostTurn);
      body.x += by;
      change_ = std::max(change_, by.cwiseAbs().maxCoeff());
    }
  }

  std::vector<Body> bodies_;
  const std::vector<Wall> walls_;
  const Surface& surface_;
  const NearestOptions options_;
  std::vector<Row> rows_;
  std::vector<Vector3d> goal_;  // of each body, from where it was measured
  std::set<std::size_t> overlapping_;
  bool clear_ = true;
  double change_ = std::numeric_limits<double>::infinity();
};

}  // namespace

Result<std::vector<PlacedObject>> nearest_state(const Scene& scene, std::span<const MeasuredObject> measured,
                                                const NearestOptions& options) {
  std::vector<PlacedObject> placed;
  std::vector<Body> bodies;
  for (const MeasuredObject& object : measured) {
    const auto found = std::ranges::find(scene.objects, object.name, &SceneObject::name);
    if (found == scene.objects.end())
      return invalid("objects", fmt::format("'{}'", object.name), fmt::format("one of scene '{}'", scene.name));
    const auto covariance_result = covariance_of(object, options);
    if (!covariance_result) return covariance_result.error();
    placed.push_back({.name = object.name, .X_WB = object.X_WB});
    auto body = standing(*found, scene.surface, object.X_WB, *covariance_result, options.most);
    if (!body) continue;
    body->index = placed.size() - 1;
    bodies.push_back(*std::move(body));
  }
  Problem problem(std::move(bodies), scene, options);
  std::mt19937_64 random(1);
  std::set<std::size_t> to_blame;
  bool found = false;
  for (int i = 0; i < kStarts && !found; ++i) {
    problem.start(i == 0 ? nullptr : &random);
    problem.settle();
    const auto bad = problem.to_blame();
    if (i == 0) to_blame = bad;
    found = bad.empty();
  }
  if (!found) {
    std::vector<std::string> names;
    for (const std::size_t index : to_blame) names.push_back(fmt::format("'{}'", placed[index].name));
    return invalid(fmt::format("objects {}", fmt::join(names, ", ")),
                   "poses that no state without overlaps explains within their covariances",
                   "such a state: look whether they are what the scene says, and whether the sensors agree");
  }
  for (const Body& body : problem.bodies()) {
    PlacedObject& object = placed[body.index];
    const Matrix3d R = Eigen::AngleAxisd(body.x.z() - body.measured.z(), Vector3d::UnitZ()) * body.R_WB;
    Eigen::Isometry3d X_WB = Eigen::Isometry3d::Identity();
    X_WB.linear() = R;
    X_WB.translation() = Vector3d(body.x.x(), body.x.y(), body.height);
    object.X_WB = pose_of(X_WB);
    object.stands = true;
    object.moved = problem.moved(body);
  }
  return placed;
}

}  // namespace jostle::physics_pool
