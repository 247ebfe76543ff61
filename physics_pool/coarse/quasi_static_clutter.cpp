#include "physics_pool/coarse/quasi_static_clutter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "idl/types/transform.hpp"
#include "physics_pool/scene/outline.hpp"

namespace jostle::physics_pool {
namespace {

using Eigen::Vector2d;

constexpr double kGravity = 9.81;        // m/s^2, the engine's
constexpr double kRecovery = 0.002;      // m, of an overlap that one substep takes back, at most
constexpr double kSlowest = 1e-5;        // m/s; dampers of what is slower stay as they are
constexpr double kLeastShare = 0.02;     // of the hand's speed, the slowest damper
constexpr double kFallen = 0.5;          // m below its place, what has left the surface
constexpr double kUpright = 1.0 - 1e-9;  // cosine of the largest tilt that counts as none
constexpr double kTurning = 0.1;         // m, lever of the hand's turning where the length of a substep is chosen
constexpr double kForeseen = 0.002;      // m beyond a substep's way, within which contacts are foreseen
constexpr std::size_t kContactsPerBody = 12;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }
Vector2d across(const Vector2d& v) { return {-v.y(), v.x()}; }

bool is_upright(const Pose& pose) { return uprightness(pose.orientation.data()) > kUpright; }

PlanarPose in_plane(const Pose& pose) { return {pose.position[0], pose.position[1], yaw_of(pose.orientation.data())}; }

PlanarPose compose(const PlanarPose& a, const PlanarPose& b) {
  PlanarPose c;
  c.place = a.place + a.rotate(b.place.x(), b.place.y());
  c.turn = a.turn + b.turn;
  c.cosine = a.cosine * b.cosine - a.sine * b.sine;
  c.sine = a.sine * b.cosine + a.cosine * b.sine;
  return c;
}

// The norm of order 3.
double norm3(const Vector2d& v) {
  const double x = std::abs(v.x()), y = std::abs(v.y());
  return std::cbrt(x * x * x + y * y * y);
}

bool share_heights(double low_a, double high_a, double low_b, double high_b) {
  return low_a < high_b && low_b < high_a;
}

}  // namespace

Result<QuasiStaticClutter> QuasiStaticClutter::make(const Scene& scene, const ClutterOptions& options) {
  QuasiStaticClutter model;
  model.options_ = options;
  model.surface_ = scene.surface;
  if (auto ok = model.take_robot(scene); !ok) return ok.error();
  if (auto ok = model.take_fixtures(scene); !ok) return ok.error();
  const StateLayout layout = layout_of(scene);
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const SceneObject& object = scene.objects[i];
    const Outline shape = outline(object);
    model.bodies_.push_back({.outline = shape,
                             .reach = reach_of(shape),
                             .low = 0.0,
                             .high = object.top(),
                             .friction = object.friction,
                             .mass = object.mass,
                             .support = std::max(object.friction * object.mass * kGravity, 1e-6),
                             .lever = reach_of(shape),
                             .rest_height = object.rest_height(),
                             .q = layout.objects[i].q,
                             .v = layout.objects[i].v});
  }
  model.objects_.resize(model.bodies_.size());
  model.most_contacts_ = kContactsPerBody * (model.bodies_.size() + 4);
  model.make_room();
  return model;
}

Result<void> QuasiStaticClutter::take_robot(const Scene& scene) {
  const RobotModel& robot = scene.robot.model;
  const auto refuse = [&](const std::string& what, const std::string& wanted) {
    return invalid(fmt::format("robot '{}'", robot.name), what, wanted + ": the coarse model is planar");
  };
  if (robot.joints.size() > kMostJoints)
    return refuse(fmt::format("{} joints", robot.joints.size()), fmt::format("at most {}", kMostJoints));
  if (!is_upright(scene.robot.base)) return refuse("a tilted base", "an upright one");
  base_ = in_plane(scene.robot.base);
  for (const Joint& joint : robot.joints) {
    const bool is_slide = joint.kind == JointKind::kSlide;
    const double vertical = std::abs(joint.axis[2]);
    if (is_slide ? vertical > 1e-9 : vertical < kUpright)
      return refuse(fmt::format("joint '{}', which leaves the plane", joint.name), "joints that move in the plane");
    if (joint.gain <= 0) return refuse(fmt::format("joint '{}', which nothing drives", joint.name), "driven joints");
    drives_.push_back({.is_slide = is_slide,
                       .axis = is_slide ? Vector2d(joint.axis[0], joint.axis[1]) : Vector2d(joint.axis[2], 0),
                       .low = joint.low,
                       .high = joint.high,
                       .yield = 1 / joint.gain});
  }
  std::vector<double> heights;
  for (std::size_t l = 0; l < robot.links.size(); ++l) {
    const Link& link = robot.links[l];
    if (!is_upright(link.pose)) return refuse(fmt::format("link '{}', which is tilted", link.name), "upright links");
    PlanarLink planar{.parent = link.parent, .in_parent = in_plane(link.pose), .joints = link.joints};
    if (link.parent >= 0) planar.chain = links_[index(link.parent)].chain;
    for (const int joint : link.joints) planar.chain |= 1u << joint;
    links_.push_back(std::move(planar));
    heights.push_back(link.pose.position[2] +
                      (link.parent < 0 ? scene.robot.base.position[2] : heights[index(link.parent)]));
    for (const RobotGeom& geom : link.geoms) {
      if (geom.shape == GeomShape::kMesh || !is_upright(geom.pose))
        return refuse(fmt::format("geom '{}', a mesh or tilted", geom.name), "upright boxes, cylinders and spheres");
      const bool is_box = geom.shape == GeomShape::kBox;
      const Outline shape =
          is_box ? Outline{.half_x = geom.size[0] / 2, .half_y = geom.size[1] / 2} : Outline{.radius = geom.radius};
      const double half = is_box ? geom.size[2] / 2 : geom.shape == GeomShape::kSphere ? geom.radius : geom.height / 2;
      const double middle = heights.back() + geom.pose.position[2];
      pieces_.push_back({.outline = shape,
                         .reach = reach_of(shape),
                         .low = middle - half,
                         .high = middle + half,
                         .link = static_cast<int>(l),
                         .in_link = in_plane(geom.pose),
                         .pose = {}});
    }
  }
  link_poses_.resize(links_.size());
  for (const Axis& axis : robot.axes) axes_.push_back(axis.joints);
  return {};
}

Result<void> QuasiStaticClutter::take_fixtures(const Scene& scene) {
  for (const Fixture& fixture : scene.fixtures) {
    if (!is_upright(fixture.pose))
      return invalid("fixture '" + fixture.name + "'", "a tilted one", "upright ones: the coarse model is planar");
    const bool is_box = fixture.shape == Shape::kBox;
    const Outline shape = is_box ? Outline{.half_x = fixture.size[0] / 2, .half_y = fixture.size[1] / 2}
                                 : Outline{.radius = fixture.radius};
    const double half = (is_box ? fixture.size[2] : fixture.height) / 2, middle = fixture.pose.position[2];
    fixtures_.push_back({.outline = shape,
                         .reach = reach_of(shape),
                         .low = middle - half,
                         .high = middle + half,
                         .in_link = {},
                         .pose = in_plane(fixture.pose)});
  }
  return {};
}

void QuasiStaticClutter::advance(State& x, std::span<const double> u, double duration) {
  const std::size_t joints = drives_.size();
  free_.fill(0.0);
  held_.fill(0.0);
  for (std::size_t i = 0; i < u.size(); ++i) {
    for (const auto& [joint, factor] : axes_[i]) free_[index(joint)] += factor * u[i];
  }
  approach_ = 0.0;
  for (std::size_t j = 0; j < joints; ++j) {
    q_[j] = x.q[j];
    v_[j] = free_[j];
    approach_ += std::abs(free_[j]) * (drives_[j].is_slide ? 1.0 : kTurning);
  }
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Body& body = bodies_[i];
    const double* q = &x.q[index(body.q)];
    const double* v = &x.v[index(body.v)];
    Motion& object = objects_[i];
    object.pose = PlanarPose(q[0], q[1], yaw_of(q + 3));
    object.turned = 0.0;
    object.v = {v[0], v[1]};
    object.w = v[5];
    object.speed = std::hypot(norm3(object.v), body.lever * object.w);
    if (object.speed < kSlowest) object.speed = 0.0;
    object.gone = q[2] < body.rest_height - kForeseen * 10;
    object.moved = false;
  }
  make_room();  // again: a copy of an empty vector has none
  contacts_.clear();
  const double way = approach_ * duration;
  const int substeps =
      std::clamp(std::isfinite(way) ? static_cast<int>(std::ceil(way / options_.step)) : 1, 1, options_.max_substeps);
  h_ = duration / substeps;
  margin_ = way / substeps + kForeseen;
  for (int step = 0; step < substeps; ++step) {
    place_robot();
    find_contacts();
    solve(h_);
    integrate(h_);
  }
  for (std::size_t j = 0; j < joints; ++j) {
    x.q[j] = q_[j];
    x.v[j] = v_[j];
  }
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Motion& object = objects_[i];
    double* const q = &x.q[index(bodies_[i].q)];
    double* const v = &x.v[index(bodies_[i].v)];
    std::fill_n(v, 6, 0.0);
    if (!object.moved) continue;
    q[0] = object.pose.place.x();
    q[1] = object.pose.place.y();
    const double c = std::cos(object.turned / 2), s = std::sin(object.turned / 2);
    const std::array<double, 4> r{q[3], q[4], q[5], q[6]};
    q[3] = c * r[0] - s * r[3];
    q[4] = c * r[1] - s * r[2];
    q[5] = c * r[2] + s * r[1];
    q[6] = c * r[3] + s * r[0];
    if (object.gone) {
      q[2] = bodies_[i].rest_height - kFallen;
      continue;
    }
    v[0] = object.v.x();
    v[1] = object.v.y();
    v[5] = object.w;
  }
}

void QuasiStaticClutter::make_room() {
  contacts_.reserve(most_contacts_);
  before_.reserve(most_contacts_);
  queue_.reserve(bodies_.size());
}

void QuasiStaticClutter::place_robot() {
  for (std::size_t l = 0; l < links_.size(); ++l) {
    const PlanarLink& link = links_[l];
    PlanarPose pose = compose(link.parent < 0 ? base_ : link_poses_[index(link.parent)], link.in_parent);
    for (const int joint : link.joints) {
      const auto j = index(joint);
      const Drive& drive = drives_[j];
      if (drive.is_slide) {
        arrows_[j] = pose.rotate(drive.axis.x(), drive.axis.y());
        pose.place += q_[j] * arrows_[j];
      } else {
        arrows_[j] = pose.place;
        pose.turn_to(pose.turn + drive.axis.x() * q_[j]);
      }
    }
    link_poses_[l] = pose;
  }
  for (Piece& piece : pieces_) piece.pose = compose(link_poses_[index(piece.link)], piece.in_link);
}

// Whoever is touched by the robot, or moves, may touch others.
void QuasiStaticClutter::find_contacts() {
  std::swap(contacts_, before_);
  contacts_.clear();
  queue_.clear();
  const auto near = [this](const PlanarPose& a, double reach_a, const PlanarPose& b, double reach_b) {
    const double range = reach_a + reach_b + margin_;
    return (a.place - b.place).squaredNorm() < range * range;
  };
  const auto activate = [this](std::size_t i) {
    if (objects_[i].active) return;
    objects_[i].active = true;
    queue_.push_back(static_cast<int>(i));
  };
  for (Motion& object : objects_) object.active = object.asked = false;
  for (std::size_t p = 0; p < pieces_.size(); ++p) {
    const Piece& piece = pieces_[p];
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const Body& body = bodies_[i];
      if (objects_[i].gone || !near(objects_[i].pose, body.reach, piece.pose, piece.reach)) continue;
      if (!share_heights(piece.low, piece.high, body.low, body.high)) continue;
      const Touches touches = find_touches(body.outline, objects_[i].pose, piece.outline, piece.pose, margin_);
      if (touches.count == 0) continue;
      touch(static_cast<int>(i), -1, static_cast<int>(p), touches);
      activate(i);
    }
    for (std::size_t f = 0; f < fixtures_.size(); ++f) {
      const Piece& fixture = fixtures_[f];
      if (!share_heights(piece.low, piece.high, fixture.low, fixture.high)) continue;
      if (!near(piece.pose, piece.reach, fixture.pose, fixture.reach)) continue;
      touch(-1, static_cast<int>(f), static_cast<int>(p),
            find_touches(piece.outline, piece.pose, fixture.outline, fixture.pose, margin_));
    }
  }
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (objects_[i].speed > 0 && !objects_[i].gone && objects_[i].v.squaredNorm() > kSlowest * kSlowest) activate(i);
  }
  for (std::size_t n = 0; n < queue_.size(); ++n) {
    const auto i = index(queue_[n]);
    const Body& body = bodies_[i];
    objects_[i].asked = true;
    for (std::size_t j = 0; j < bodies_.size(); ++j) {
      const Motion& other = objects_[j];
      if (i == j || other.gone || other.asked || !near(objects_[i].pose, body.reach, other.pose, bodies_[j].reach))
        continue;
      const Touches touches = find_touches(body.outline, objects_[i].pose, bodies_[j].outline, other.pose, margin_);
      if (touches.count == 0) continue;
      touch(static_cast<int>(i), static_cast<int>(j), -1, touches);
      activate(j);
    }
    for (std::size_t f = 0; f < fixtures_.size(); ++f) {
      const Piece& fixture = fixtures_[f];
      if (!share_heights(body.low, body.high, fixture.low, fixture.high)) continue;
      if (!near(objects_[i].pose, body.reach, fixture.pose, fixture.reach)) continue;
      touch(static_cast<int>(i), -2 - static_cast<int>(f), -1,
            find_touches(body.outline, objects_[i].pose, fixture.outline, fixture.pose, margin_));
    }
  }
}

// Notes contacts of object a with object b, with a fixture (b = -2 - its number) or with the robot's piece; or, without
// an object (a = -1), of a piece with fixture b.
void QuasiStaticClutter::touch(int a, int b, int piece, const Touches& touches) {
  for (int t = 0; t < touches.count && contacts_.size() < most_contacts_; ++t) {
    const Touch& at = touches.values[index(t)];
    Pressing contact;
    contact.a = a;
    contact.b = a >= 0 && b >= 0 ? b : -1;
    contact.robot = piece < 0 ? 0.0 : a < 0 ? 1.0 : -1.0;
    contact.key = (((a + 1) * 1024 + (b + 512)) * 64 + (piece + 1)) * 2 + t;
    contact.target = at.gap >= 0 ? -at.gap : std::min(-at.gap, kRecovery);  // m the two have to part, over h
    double friction = a >= 0 ? bodies_[index(a)].friction : 1.0;
    if (contact.b >= 0) friction = std::max(friction, bodies_[index(contact.b)].friction);
    contact.friction = options_.contact_friction * friction;
    const std::array<Vector2d, 2> directions{at.normal, across(at.normal)};
    for (std::size_t row = 0; row < 2; ++row) {
      const Vector2d& d = directions[row];
      if (a >= 0) contact.ja[row] = {d.x(), d.y(), cross(at.point - objects_[index(a)].pose.place, d)};
      if (contact.b >= 0)
        contact.jb[row] = {-d.x(), -d.y(), -cross(at.point - objects_[index(contact.b)].pose.place, d)};
      if (piece < 0) continue;
      const std::uint32_t chain = links_[index(pieces_[index(piece)].link)].chain;
      for (std::size_t j = 0; j < drives_.size(); ++j) {
        if ((chain >> j & 1u) == 0) continue;
        const double along =
            drives_[j].is_slide ? d.dot(arrows_[j]) : drives_[j].axis.x() * cross(at.point - arrows_[j], d);
        contact.jr[row][j] = contact.robot * along;
      }
    }
    for (const Pressing& old : before_) {
      if (old.key != contact.key) continue;
      contact.normal_force = old.normal_force;
      contact.tangent_force = old.tangent_force;
      break;
    }
    contacts_.push_back(contact);
  }
}

void QuasiStaticClutter::solve(double h) {
  // What is jammed must be able to come loose in a few substeps.
  const double least = std::max(kLeastShare * approach_, kSlowest);
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    Motion& object = objects_[i];
    if (object.active && object.speed == 0) object.speed = std::max(approach_, kSlowest);
  }
  if (contacts_.empty()) {
    for (Motion& object : objects_) {
      object.v.setZero();
      object.w = object.speed = 0.0;
    }
  }
  for (int weighting = 0; weighting < options_.weightings; ++weighting) {
    weigh();
    prepare();
    for (int i = 0; i < options_.sweeps; ++i) sweep(h);
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      Motion& object = objects_[i];
      if (!object.active) continue;
      object.speed = std::max(std::hypot(norm3(object.v), bodies_[i].lever * object.w), least);
    }
  }
}

// Dampers from speeds: D is f_max/2·(share_x·v_x^2 + share_y·v_y^2 + c^2·omega^2)/speed, where a share is how much of
// the gradient of the norm of order 3 an axis has.
void QuasiStaticClutter::weigh() {
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    Motion& object = objects_[i];
    if (!object.active) continue;
    const Body& body = bodies_[i];
    const double length = norm3(object.v), damper = body.support * options_.support_friction / object.speed;
    const auto share = [&](double v) {
      return length > kSlowest ? std::max(std::abs(v) / length, options_.across) : 1.0;
    };
    const double creep = options_.creep / body.mass, c2 = body.lever * body.lever;
    object.yield = {1 / (damper * share(object.v.x())) + creep, 1 / (damper * share(object.v.y())) + creep,
                    (1 / damper + creep) / c2};
  }
}

// With new dampers the same forces make other velocities.
void QuasiStaticClutter::prepare() {
  for (Motion& object : objects_) {
    if (!object.active) continue;
    object.v.setZero();
    object.w = 0.0;
  }
  for (std::size_t j = 0; j < drives_.size(); ++j) v_[j] = free_[j] + drives_[j].yield * held_[j];
  for (Pressing& contact : contacts_) {
    for (std::size_t row = 0; row < 2; ++row) {
      double sum = 0.0;
      for (std::size_t k = 0; k < 3; ++k) {
        if (contact.a >= 0) sum += objects_[index(contact.a)].yield[k] * contact.ja[row][k] * contact.ja[row][k];
        if (contact.b >= 0) sum += objects_[index(contact.b)].yield[k] * contact.jb[row][k] * contact.jb[row][k];
      }
      if (contact.robot != 0) {
        for (std::size_t j = 0; j < drives_.size(); ++j)
          sum += drives_[j].yield * contact.jr[row][j] * contact.jr[row][j];
      }
      contact.inverse[row] = sum > 0 ? 1 / sum : 0.0;
    }
    push(contact, 0, contact.normal_force);
    push(contact, 1, contact.tangent_force);
  }
}

void QuasiStaticClutter::sweep(double h) {
  for (std::size_t j = 0; j < drives_.size(); ++j) {
    const Drive& drive = drives_[j];
    if (!std::isfinite(drive.high)) continue;
    // What the joint would do without the force that holds it in its range.
    const double loose = v_[j] - drive.yield * held_[j];
    const double force = (std::clamp(loose, (drive.low - q_[j]) / h, (drive.high - q_[j]) / h) - loose) / drive.yield;
    v_[j] += drive.yield * (force - held_[j]);
    held_[j] = force;
  }
  for (Pressing& contact : contacts_) {
    const double fn =
        std::max(0.0, contact.normal_force + (contact.target / h - relative(contact, 0)) * contact.inverse[0]);
    push(contact, 0, fn - contact.normal_force);
    contact.normal_force = fn;
    const double most = contact.friction * fn;
    const double ft = std::clamp(contact.tangent_force - relative(contact, 1) * contact.inverse[1], -most, most);
    push(contact, 1, ft - contact.tangent_force);
    contact.tangent_force = ft;
  }
}

double QuasiStaticClutter::relative(const Pressing& contact, std::size_t row) const {
  double sum = 0.0;
  const auto add = [&](int i, const std::array<double, 3>& j) {
    if (i < 0) return;
    const Motion& object = objects_[index(i)];
    sum += j[0] * object.v.x() + j[1] * object.v.y() + j[2] * object.w;
  };
  add(contact.a, contact.ja[row]);
  add(contact.b, contact.jb[row]);
  if (contact.robot != 0) {
    for (std::size_t j = 0; j < drives_.size(); ++j) sum += contact.jr[row][j] * v_[j];
  }
  return sum;
}

void QuasiStaticClutter::push(const Pressing& contact, std::size_t row, double force) {
  const auto add = [&](int i, const std::array<double, 3>& j) {
    if (i < 0) return;
    Motion& object = objects_[index(i)];
    object.v.x() += object.yield[0] * j[0] * force;
    object.v.y() += object.yield[1] * j[1] * force;
    object.w += object.yield[2] * j[2] * force;
  };
  add(contact.a, contact.ja[row]);
  add(contact.b, contact.jb[row]);
  if (contact.robot != 0) {
    for (std::size_t j = 0; j < drives_.size(); ++j) v_[j] += drives_[j].yield * contact.jr[row][j] * force;
  }
}

void QuasiStaticClutter::integrate(double h) {
  for (std::size_t j = 0; j < drives_.size(); ++j) {
    q_[j] += h * v_[j];
    if (std::isfinite(drives_[j].high)) q_[j] = std::clamp(q_[j], drives_[j].low, drives_[j].high);
  }
  for (Motion& object : objects_) {
    if (!object.active) {
      object.v.setZero();
      object.w = object.speed = 0.0;
      continue;
    }
    if (object.v.isZero(0.0) && object.w == 0) {
      object.speed = 0.0;
      continue;
    }
    object.moved = true;
    object.pose.place += h * object.v;
    object.turned += h * object.w;
    object.pose.turn_to(object.pose.turn + h * object.w);
    if (!surface_.carries(object.pose.place.x(), object.pose.place.y())) object.gone = true;
  }
}

}  // namespace jostle::physics_pool
