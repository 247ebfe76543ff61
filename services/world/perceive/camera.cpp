#include "services/world/perceive/camera.hpp"

#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <map>
#include <set>
#include <vector>

#include "idl/types/transform.hpp"
#include "perception/tags/detector.hpp"
#include "perception/tags/pose.hpp"
#include "perception/tracking/tracker.hpp"
#include "physics_pool/scene/scene.hpp"
#include "services/common/process/trouble.hpp"
#include "services/wire/dds/camera_topics.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/world/camera/messages.hpp"
#include "services/world/camera/scene_tags.hpp"
#include "services/world/link/messages.hpp"
#include "services/world/link/objects_out.hpp"

namespace jostle::world {
namespace {

using Clock = std::chrono::steady_clock;
using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr auto kTick = std::chrono::milliseconds(100);
constexpr auto kUnseen = std::chrono::seconds(1);                // worth a word
constexpr auto kStandardForms = std::chrono::milliseconds(100);  // between two messages of them
constexpr double kMostTilt = 15.0 * M_PI / 180;                  // of what stands
constexpr double kMostRise = 0.02;                               // m

// X_WB of an object, upright on the surface if it stands.
Pose settled(const ObjectTag& tag, const Isometry3d& X_WB, const Vector3d& p_WC) {
  const bool stands =
      X_WB.linear()(2, 2) > std::cos(kMostTilt) && std::abs(X_WB.translation().z() - tag.height) < kMostRise;
  if (!stands) return pose_of(X_WB);
  const Vector3d p_WT = (X_WB * transform(tag.X_BT)).translation();
  const double top = tag.height + tag.X_BT.position[2];
  const double share = (top - p_WC.z()) / (p_WT.z() - p_WC.z());
  const Vector3d p = p_WC + share * (p_WT - p_WC);
  const Pose measured = pose_of(X_WB);
  return {.position = {p.x(), p.y(), tag.height}, .orientation = turned_about_z(yaw_of(measured.orientation.data()))};
}

class Looker {
 public:
  Looker(const wire::Participant& participant, std::vector<ObjectTag> tags, const Pose& X_WC)
      : tags_(std::move(tags)), X_WC_(transform(X_WC)), topics_(participant, kStandardForms) {
    for (const ObjectTag& tag : tags_) seen_[tag.object] = Clock::now();
  }

  void look(const perception::Camera& camera, const perception::GreyImage& image, double time) {
    for (const perception::Detection& detection : detector_.detect(image)) {
      const auto tag = std::ranges::find(tags_, detection.id, &ObjectTag::id);
      if (tag == tags_.end()) continue;
      const perception::TagView view{.corners = detection.corners, .size = tag->size, .X_BT = tag->X_BT};
      const auto estimate = perception::estimate_pose(camera, {&view, 1});
      if (!estimate) {
        bad_.warn("tag {}: {}", detection.id, estimate.error().message);
        continue;
      }
      const Pose X_WB = settled(*tag, X_WC_ * transform(estimate->best.X_CB), X_WC_.translation());
      if (tracker_.take(tag->object, X_WB.position, X_WB.orientation, time)) seen_[tag->object] = Clock::now();
    }
    const auto readings = tracker_.readings(time);
    if (!readings.empty()) topics_.tell(readings, time);
  }

  // Says which objects are lost and found.
  void say_unseen() {
    std::set<std::string> lost;
    for (const auto& [name, when] : seen_) {
      if (Clock::now() - when > kUnseen + kUnseen) lost.insert(name);
    }
    if (lost == lost_) return;
    lost.empty() ? spdlog::info("every object is seen")
                 : spdlog::warn("not seen: {}; kept where they were", fmt::join(lost, ", "));
    lost_ = std::move(lost);
  }

 private:
  const std::vector<ObjectTag> tags_;
  const Isometry3d X_WC_;
  perception::Detector detector_;
  perception::Tracker tracker_;
  ObjectTopics topics_;
  common::Trouble bad_{"tags without a pose"};
  std::map<std::string, Clock::time_point> seen_;
  std::set<std::string> lost_;
};

}  // namespace

Result<void> look_through_camera(const wire::Participant& participant, const CameraOptions& options,
                                 std::stop_token stop) {
  auto scene_result = physics_pool::load_scene(options.scene);
  if (!scene_result) return scene_result.error();
  auto tags_result = tags_of(*scene_result);
  if (!tags_result) return tags_result.error();
  Looker looker(participant, std::move(tags_result).value(), options.X_WC.value_or(overhead(*scene_result)));
  wire::Inbox<sensor_msgs::msg::Image> images(participant, wire::camera_image(options.name), 1);
  wire::Inbox<sensor_msgs::msg::CameraInfo> infos(participant, wire::camera_info(options.name), 1);
  common::Trouble bad("bad messages of the camera");
  std::optional<perception::Camera> camera;
  std::uint64_t frames = 0;
  spdlog::info("looking at {}/image_raw, domain {}", options.name, participant.domain());
  while (!stop.stop_requested()) {
    auto image = images.take(Clock::now() + kTick, stop);
    for (const sensor_msgs::msg::CameraInfo& info : infos.take_all()) {
      auto camera_result = from_message(info);
      if (camera_result)
        camera = *camera_result;
      else
        bad.warn("{}", camera_result.error().message);
    }
    if (!image || !camera) continue;
    const auto image_result = from_message(*image);
    if (!image_result) {
      bad.warn("{}", image_result.error().message);
      continue;
    }
    if (image_result->width != camera->width || image_result->height != camera->height) {
      bad.warn("image: got {}x{} pixels, wanted {}x{} as camera_info says", image_result->width, image_result->height,
               camera->width, camera->height);
      continue;
    }
    if (frames++ == 0) spdlog::info("frames come from {}", options.name);
    looker.look(*camera, *image_result, seconds(image->header()));
    looker.say_unseen();
  }
  spdlog::info("{} frames, {} bad messages", frames, bad.count());
  return {};
}

}  // namespace jostle::world
