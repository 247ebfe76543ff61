#include "perception/estimator/pose_filter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace jostle::perception {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kLeastShare = 1e-3;  // of each mode: it can always come back

Vector3d log_of(const Quaterniond& q) {
  const Vector3d v = q.w() < 0 ? Vector3d(-q.vec()) : Vector3d(q.vec());
  const double length = v.norm();
  if (length < 1e-12) return 2 * v;
  return 2 * std::atan2(length, std::abs(q.w())) / length * v;
}

Quaterniond exp_of(const Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-12) return Quaterniond(1, w.x() / 2, w.y() / 2, w.z() / 2).normalized();
  return Quaterniond(Eigen::AngleAxisd(angle, w / angle));
}

void displace(PoseBelief& pose, const Vector6d& by) {
  pose.p += by.head<3>();
  pose.R = (exp_of(by.tail<3>()) * pose.R).normalized();
}

double squared(double value) { return value * value; }

// What a measurement is off, and by what it may be.
struct Innovation {
  Vector6d off;
  Eigen::LLT<Matrix6d> spread;

  Innovation(const PoseBelief& expected, const Matrix6d& covariance, const PoseBelief& measured)
      : off(difference(expected, measured)), spread(covariance + measured.covariance) {}

  double distance() const { return off.dot(spread.solve(off)); }
  double log_likelihood() const {
    return -0.5 * distance() - spread.matrixLLT().diagonal().array().log().sum() - 3 * std::log(2 * M_PI);
  }
};

// One component of an Ornstein-Uhlenbeck velocity and of its integral, after dt.
struct Drift {
  double reach, decay;  // dp/dv, dv/dv
  double pp, pv, vv;    // covariance that is added

  Drift(double sigma, double persistence, double dt) {
    const double a = std::exp(-dt / persistence), variance = squared(sigma);
    reach = persistence * (1 - a);
    decay = a;
    pp = variance * squared(persistence) * std::max(2 * dt / persistence - 3 + 4 * a - a * a, 0.0);
    pv = variance * persistence * squared(1 - a);
    vv = variance * (1 - a * a);
  }
};

}  // namespace

Vector6d difference(const PoseBelief& a, const PoseBelief& b) {
  Vector6d off;
  off << b.p - a.p, log_of(b.R * a.R.conjugate());
  return off;
}

PoseFilter::PoseFilter(const PoseBelief& measured, const MotionModel& model)
    : model_(model), still_(measured), moving_(moving_from_rest()) {}

// Something set it in motion.
PoseFilter::Moving PoseFilter::moving_from_rest() const {
  Moving moving{.pose = still_};
  moving.covariance.topLeftCorner<6, 6>() = still_.covariance;
  moving.covariance.diagonal().segment<3>(6).setConstant(squared(model_.speed));
  moving.covariance.diagonal().tail<3>().setConstant(squared(model_.turning));
  return moving;
}

void PoseFilter::mix(double dt) {
  const double starts = 1 - std::exp(-dt / model_.rest_lasts), stops = 1 - std::exp(-dt / model_.motion_lasts);
  const double rest = rest_share_, motion = 1 - rest_share_;
  const double now_rest = rest * (1 - starts) + motion * stops;
  const double stopped = motion * stops / now_rest, started = rest * starts / (1 - now_rest);
  const Moving from_rest = moving_from_rest();
  const auto spread = [](double share, const auto& off) { return share * (1 - share) * off * off.transpose(); };

  const Vector6d way = difference(still_, moving_.pose);
  const Matrix6d in_motion = moving_.covariance.topLeftCorner<6, 6>();
  still_.covariance = (1 - stopped) * still_.covariance + stopped * in_motion + spread(stopped, way);
  displace(still_, stopped * way);

  Vector12d back;
  back << difference(moving_.pose, from_rest.pose), -moving_.v, -moving_.w;
  moving_.covariance = (1 - started) * moving_.covariance + started * from_rest.covariance + spread(started, back);
  displace(moving_.pose, started * back.head<6>());
  moving_.v *= 1 - started;
  moving_.w *= 1 - started;
  rest_share_ = now_rest;
}

void PoseFilter::predict(double dt) {
  if (!(dt > 0)) return;
  mix(dt);
  still_.covariance.diagonal().head<3>().array() += squared(model_.creep) * dt;
  still_.covariance.diagonal().tail<3>().array() += squared(model_.turning_creep) * dt;

  const Drift way(model_.speed, model_.persistence, dt), turn(model_.turning, model_.persistence, dt);
  Vector6d moved;
  moved << way.reach * moving_.v, turn.reach * moving_.w;
  displace(moving_.pose, moved);
  Matrix12d F = Matrix12d::Identity(), Q = Matrix12d::Zero();
  F.block<3, 3>(3, 3) = exp_of(moved.tail<3>()).toRotationMatrix();
  const Drift* drifts[] = {&way, &turn};
  for (int i = 0; i < 6; ++i) {
    const Drift& drift = *drifts[i / 3];
    F(i, i + 6) = drift.reach;
    F(i + 6, i + 6) = drift.decay;
    Q(i, i) = drift.pp;
    Q(i, i + 6) = Q(i + 6, i) = drift.pv;
    Q(i + 6, i + 6) = drift.vv;
  }
  moving_.covariance = F * moving_.covariance * F.transpose() + Q;
  moving_.v *= way.decay;
  moving_.w *= turn.decay;
}

double PoseFilter::distance(const PoseBelief& measured) const {
  return std::min(Innovation(still_, still_.covariance, measured).distance(),
                  Innovation(moving_.pose, moving_.covariance.topLeftCorner<6, 6>(), measured).distance());
}

double PoseFilter::update(const PoseBelief& measured) {
  const Innovation rest(still_, still_.covariance, measured);
  const Innovation motion(moving_.pose, moving_.covariance.topLeftCorner<6, 6>(), measured);

  const Matrix6d gain = rest.spread.solve(still_.covariance).transpose();
  displace(still_, gain * rest.off);
  const Matrix6d left = Matrix6d::Identity() - gain;
  still_.covariance = left * still_.covariance * left.transpose() + gain * measured.covariance * gain.transpose();

  const Eigen::Matrix<double, 12, 6> gains = motion.spread.solve(moving_.covariance.topRows<6>()).transpose();
  const Vector12d change = gains * motion.off;
  displace(moving_.pose, change.head<6>());
  moving_.v += change.segment<3>(6);
  moving_.w += change.tail<3>();
  Matrix12d kept = Matrix12d::Identity();
  kept.leftCols<6>() -= gains;
  moving_.covariance = kept * moving_.covariance * kept.transpose() + gains * measured.covariance * gains.transpose();

  const double at_rest = std::log(rest_share_) + rest.log_likelihood();
  const double in_motion = std::log(1 - rest_share_) + motion.log_likelihood();
  const double most = std::max(at_rest, in_motion);
  const double total = most + std::log(std::exp(at_rest - most) + std::exp(in_motion - most));
  rest_share_ = std::clamp(std::exp(at_rest - total), kLeastShare, 1 - kLeastShare);
  return total;
}

PoseBelief PoseFilter::pose() const {
  const double share = 1 - rest_share_;
  PoseBelief mean = still_;
  const Vector6d way = difference(still_, moving_.pose);
  mean.covariance = rest_share_ * still_.covariance + share * moving_.covariance.topLeftCorner<6, 6>() +
                    share * rest_share_ * way * way.transpose();
  displace(mean, share * way);
  return mean;
}

Vector3d PoseFilter::linear() const { return rests() ? Vector3d(0, 0, 0) : moving_.v; }
Vector3d PoseFilter::angular() const { return rests() ? Vector3d(0, 0, 0) : moving_.w; }

}  // namespace jostle::perception
