#include "physics_pool/coarse/coarse_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "idl/text/nearest.hpp"
#include "physics_pool/coarse/kinematic.hpp"
#include "physics_pool/coarse/learned/learned_model.hpp"
#include "physics_pool/coarse/quasi_static.hpp"

namespace jostle::physics_pool {

Result<std::unique_ptr<CoarseModel>> make_coarse_model(const std::string& name, const Scene& scene) {
  if (!disc_radius(scene.robot.model)) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("scene '{}': robot.model: got '{}', wanted a disc that moves in the plane, as the pusher is: "
                    "coarse models know no other robot",
                    scene.name, scene.robot.model.name)};
  }
  constexpr std::string_view kLearned = "learned:";
  constexpr std::array kModels{"kinematic", "limit-surface", "planar", "learned"};
  if (name.starts_with(kLearned)) return load_learned_model(name.substr(kLearned.size()), scene);
  std::unique_ptr<CoarseModel> model;
  if (name == "kinematic") model = std::make_unique<KinematicModel>(scene);
  if (name == "limit-surface") {
    model = std::make_unique<QuasiStaticModel>(scene, QuasiStaticOptions{.sliders_touch = false});
  }
  if (name == "planar") model = std::make_unique<QuasiStaticModel>(scene, QuasiStaticOptions{});
  if (model) return model;
  return Error{Code::kInvalidArgument,
               fmt::format("coarse model: got '{}', wanted kinematic, limit-surface, planar, learned or learned:FILE{}",
                           name, did_you_mean(name, kModels))};
}

void to_planar(const StateLayout& layout, const State& x, std::span<double> planar) {
  const PlanarLayout at{static_cast<int>(layout.objects.size())};
  const StateView view(layout, x);
  std::copy_n(x.q.begin(), 2, planar.begin());
  std::copy_n(x.v.begin(), 2, planar.begin() + at.pusher_velocity());
  for (int i = 0; i < at.sliders; ++i) {
    const ObjectView object = view.object(static_cast<std::size_t>(i));
    double* pose = &planar[static_cast<std::size_t>(at.pose(i))];
    pose[0] = object.position()[0];
    pose[1] = object.position()[1];
    pose[2] = object.yaw();
    double* velocity = &planar[static_cast<std::size_t>(at.velocity(i))];
    velocity[0] = object.linear_velocity()[0];
    velocity[1] = object.linear_velocity()[1];
    velocity[2] = object.angular_velocity()[2];  // about the body's z axis, which is upright
  }
}

}  // namespace jostle::physics_pool
