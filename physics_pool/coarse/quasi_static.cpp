#include "physics_pool/coarse/quasi_static.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::physics_pool {
namespace {

using Eigen::Vector2d;

constexpr double kGravity = 9.81;  // m/s^2, the engine's

Vector2d across(const Vector2d& v) { return {-v.y(), v.x()}; }

// How two bodies move apart where a force acts on the contact between them:
// d = B·f in the contact's axes, normal first.
class Response {
 public:
  explicit Response(const Contact& contact)
      : normal_(contact.normal), tangent_(across(contact.normal)), depth_(contact.depth) {}

  // One of the bodies; `arm` leads from its centre to the contact.
  void add(double mobility, double turning, const Vector2d& arm) {
    const Vector2d lever = across(arm);
    const double n = lever.dot(normal_), t = lever.dot(tangent_);
    nn_ += mobility + turning * n * n;
    nt_ += turning * n * t;
    tt_ += mobility + turning * t * t;
  }

  // What ends the overlap and, if friction can, moves the contact by `slip` along the
  // tangent; else it slides along the edge of the motion cone.
  Vector2d force(double slip, double friction) const {
    const double determinant = nn_ * tt_ - nt_ * nt_;
    double fn = (tt_ * depth_ - nt_ * slip) / determinant, ft = (nn_ * slip - nt_ * depth_) / determinant;
    if (!(std::abs(ft) <= friction * fn)) {
      const double edge = std::copysign(friction, ft);
      constexpr double kLeast = 1e-3;  // a contact that would wedge
      fn = depth_ / std::max(nn_ + edge * nt_, kLeast * nn_);
      ft = edge * fn;
    }
    return fn * normal_ + ft * tangent_;
  }

 private:
  Vector2d normal_, tangent_;
  double depth_;
  double nn_ = 0.0, nt_ = 0.0, tt_ = 0.0;
};

}  // namespace

QuasiStaticModel::QuasiStaticModel(const Scene& scene, const QuasiStaticOptions& options)
    : layout_{static_cast<int>(scene.objects.size())},
      options_(options),
      pusher_{.radius = disc_radius(scene.robot.model).value()} {
  for (const SceneObject& object : scene.objects) {
    const Outline shape = outline(object);
    const double c = shape.radius > 0 ? shape.radius : std::hypot(shape.half_x, shape.half_y);
    const double mobility = 1 / std::max(object.friction * object.mass * kGravity, 1e-6);
    sliders_.push_back(
        {.outline = shape, .friction = object.friction, .mobility = mobility, .turning = mobility / (c * c)});
  }
  poses_.resize(sliders_.size());
  before_.resize(sliders_.size());
}

void QuasiStaticModel::advance(std::span<double> states, std::span<const double> controls, double duration) {
  const auto width = static_cast<std::size_t>(layout_.size());
  for (std::size_t k = 0; k * width < states.size(); ++k) {
    advance_one(&states[k * width], &controls[2 * k], duration);
  }
}

void QuasiStaticModel::advance_one(double* x, const double* u, double duration) {
  for (int i = 0; i < layout_.sliders; ++i) {
    const double* pose = x + layout_.pose(i);
    poses_[static_cast<std::size_t>(i)] = PlanarPose(pose[0], pose[1], pose[2]);
  }
  const Vector2d start(x[0], x[1]), way(u[0] * duration, u[1] * duration);
  const double wanted = std::ceil(way.norm() / options_.step);
  // False for NaN, which then runs through a few substeps and comes out as NaN.
  const int substeps = wanted <= options_.max_substeps ? std::max(static_cast<int>(wanted), options_.min_substeps)
                       : std::isfinite(wanted)         ? options_.max_substeps
                                                       : options_.min_substeps;
  const Vector2d moved = way / substeps;
  for (int step = 1; step <= substeps; ++step) {
    before_ = poses_;
    pusher_pose_.place = start + way * (static_cast<double>(step) / substeps);
    yield(moved);
  }
  const double h = duration / substeps;
  for (int i = 0; i < layout_.sliders; ++i) {
    const PlanarPose& pose = poses_[static_cast<std::size_t>(i)];
    const PlanarPose& last = before_[static_cast<std::size_t>(i)];
    double* const q = x + layout_.pose(i);
    double* const v = x + layout_.velocity(i);
    q[0] = pose.place.x();
    q[1] = pose.place.y();
    q[2] = pose.turn;
    v[0] = (pose.place.x() - last.place.x()) / h;
    v[1] = (pose.place.y() - last.place.y()) / h;
    v[2] = (pose.turn - last.turn) / h;
  }
  x[0] += way.x();
  x[1] += way.y();
  x[layout_.pusher_velocity()] = u[0];
  x[layout_.pusher_velocity() + 1] = u[1];
}

// One substep: the pusher has moved, and everything yields to it.
void QuasiStaticModel::yield(const Vector2d& moved) {
  for (int sweep = 0; sweep < options_.sweeps; ++sweep) {
    bool touching = false;
    for (std::size_t i = 0; i < sliders_.size(); ++i) {
      for (const Contact& contact : find_contacts(sliders_[i].outline, poses_[i], pusher_, pusher_pose_)) {
        part_from_pusher(i, contact, moved);
        touching = true;
      }
    }
    if (!options_.sliders_touch) return;  // one contact each: solved
    for (std::size_t i = 0; i < sliders_.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        for (const Contact& contact : find_contacts(sliders_[i].outline, poses_[i], sliders_[j].outline, poses_[j])) {
          part(i, j, contact);
          touching = true;
        }
      }
    }
    if (!touching) return;
  }
}

// How far a point fixed to a slider has come during this substep.
Vector2d QuasiStaticModel::carried(std::size_t i, const Vector2d& point) const {
  const PlanarPose& now = poses_[i];
  const PlanarPose& then = before_[i];
  return now.place - then.place + (now.turn - then.turn) * across(point - now.place);
}

void QuasiStaticModel::apply(std::size_t i, const Vector2d& point, const Vector2d& force) {
  const Slider& slider = sliders_[i];
  PlanarPose& pose = poses_[i];
  const Vector2d lever = across(point - pose.place);
  pose.place += slider.mobility * force;
  pose.turn_to(pose.turn + slider.turning * lever.dot(force));
}

void QuasiStaticModel::part_from_pusher(std::size_t i, const Contact& contact, const Vector2d& moved) {
  const Vector2d tangent = across(contact.normal);
  // The part of the way on which they were in touch.
  const double approach = contact.normal.dot(moved);
  const double share = approach > contact.depth ? contact.depth / approach : 1.0;
  Response response(contact);
  response.add(sliders_[i].mobility, sliders_[i].turning, contact.point - poses_[i].place);
  apply(i, contact.point,
        response.force(share * tangent.dot(moved) - tangent.dot(carried(i, contact.point)), sliders_[i].friction));
}

void QuasiStaticModel::part(std::size_t i, std::size_t j, const Contact& contact) {
  Response response(contact);
  for (const std::size_t k : {i, j}) {
    response.add(sliders_[k].mobility, sliders_[k].turning, contact.point - poses_[k].place);
  }
  const Vector2d slid = carried(i, contact.point) - carried(j, contact.point);
  const Vector2d force =
      response.force(-across(contact.normal).dot(slid), std::max(sliders_[i].friction, sliders_[j].friction));
  apply(i, contact.point, force);
  apply(j, contact.point, -force);
}

}  // namespace jostle::physics_pool
