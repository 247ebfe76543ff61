#pragma once
/// \file
/// CoarseModel: cheap physics of a pusher and its sliders in the plane.

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// Where things are in a planar state, the x of Sec. 7.1.1:
///
///   [q^P, q^S1, …, q^SN, dq^P, dq^S1, …, dq^SN]
///
/// with q^P = (x, y) of the pusher and q^S = (x, y, theta) of a slider, in the
/// world's plane; m, rad, m/s, rad/s. Sliders are the scene's objects, in order.
struct PlanarLayout {
  int sliders = 0;

  int size() const { return 2 * half(); }
  int half() const { return 2 + 3 * sliders; }           ///< poses, or velocities
  int pose(int slider) const { return 2 + 3 * slider; }  ///< first of x, y, theta
  int velocity(int slider) const { return half() + pose(slider); }
  int pusher_velocity() const { return half(); }
};

/// A coarse model is C of Eq. 6.2: x <- C(x, u, Delta_t), a pure function, for K states at a time.
///
/// Frames   as PlanarLayout; u = (u_x, u_y), the pusher's velocity, m/s.
/// Threads  one at a time. Nothing is allocated after construction for K <= kMaxBatch.
/// Failure  none: what cannot be predicted comes out non-finite, for the caller to see.
class CoarseModel {
 public:
  static constexpr int kMaxBatch = 256;

  virtual ~CoarseModel() = default;

  /// The name by which make_coarse_model knows it.
  virtual std::string_view name() const = 0;
  virtual PlanarLayout layout() const = 0;

  /// `states` [K][layout().size()] and `controls` [K][2], row-major, K <= kMaxBatch.
  virtual void advance(std::span<double> states, std::span<const double> controls, double duration) = 0;
};

/// Makes a coarse model by `name`: kinematic (Eq. 6.5-6.8), limit-surface, planar, or learned:FILE (Sec. 7.2).
/// Errors   kInvalidArgument  unknown name, a scene without a pusher, or a model that
///          does not fit the scene; says which and what would
///          kIo               a file that cannot be read
Result<std::unique_ptr<CoarseModel>> make_coarse_model(const std::string& name, const Scene& scene);

/// Writes the planar part of a state of a pusher's scene. theta is the yaw of the slider's
/// x axis in (-pi, pi].
void to_planar(const StateLayout& layout, const State& x, std::span<double> planar);

}  // namespace jostle::physics_pool
