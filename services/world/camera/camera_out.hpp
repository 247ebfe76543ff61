#pragma once
/// \file
/// A simulated camera above a simulated world.

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "idl/msg/camera.h"
#include "perception/rendering/renderer.hpp"
#include "services/wire/dds/camera_topics.hpp"
#include "services/world/camera/scene_tags.hpp"
#include "services/world/link/objects_out.hpp"

namespace jostle::world {

/// Returns what stands in a world as a camera sees it: surface, objects with their tags, robot, fixtures. Meshes of a
/// robot do not show. `x`: of `scene`.
perception::View view_of(const physics_pool::Scene& scene, const std::vector<ObjectTag>& tags, const State& x,
                         const Pose& X_WC);

/// A CameraOut renders the world as overhead() sees it and publishes images and intrinsics on /camera/image_raw and
/// /camera/camera_info: the newest state whenever the last image is finished, stamped with the state's time. A world
/// that stands still is shown once a second. Where objects are is not told.
///
/// Threads  one calls; its own renders.
class CameraOut final : public ObjectsOut {
 public:
  static constexpr const char* kName = "camera";

  /// Throws SetupError. `tags`: those of tags_of().
  CameraOut(const wire::Participant& participant, physics_pool::Scene scene, std::vector<ObjectTag> tags,
            std::uint64_t seed);

  void tell(const std::vector<perception::ObjectReading>&, double) override {}
  void show(const State& truth, double time) override;

 private:
  struct Moment {
    State x;
    double time = 0.0;  // s
  };
  void work(const std::stop_token& stop);
  void publish(const Moment& moment);

  const physics_pool::Scene scene_;
  const std::vector<ObjectTag> tags_;
  const Pose X_WC_;
  const perception::SceneCamera camera_;
  std::uint64_t seed_;  // of the next image
  wire::Writer<sensor_msgs::msg::Image> images_;
  wire::Writer<sensor_msgs::msg::CameraInfo> infos_;

  std::mutex mutex_;  // guards newest_
  std::condition_variable_any shown_;
  std::optional<Moment> newest_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace jostle::world
