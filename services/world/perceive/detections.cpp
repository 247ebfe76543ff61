#include "services/world/perceive/detections.hpp"

#include <algorithm>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

geometry_msgs::msg::Vector3 box_of(const physics_pool::Scene* scene, const std::string& name) {
  geometry_msgs::msg::Vector3 size;
  if (!scene) return size;
  const auto found = std::ranges::find(scene->objects, name, &physics_pool::SceneObject::name);
  if (found == scene->objects.end()) return size;
  const bool is_box = found->shape == physics_pool::Shape::kBox;
  size.x(is_box ? found->size[0] : 2 * found->radius);
  size.y(is_box ? found->size[1] : 2 * found->radius);
  size.z(is_box ? found->size[2] : found->height);
  return size;
}

}  // namespace

vision_msgs::msg::Detection3DArray detections_message(const std::vector<perception::Estimate>& estimates, double time,
                                                      const physics_pool::Scene* scene) {
  vision_msgs::msg::Detection3DArray message;
  message.header(make_header(time));
  for (const perception::Estimate& estimate : estimates) {
    const auto& [name, p, q, linear, angular] = estimate.reading;
    geometry_msgs::msg::Pose pose;
    pose.position().x(p[0]);
    pose.position().y(p[1]);
    pose.position().z(p[2]);
    pose.orientation().w(q[0]);
    pose.orientation().x(q[1]);
    pose.orientation().y(q[2]);
    pose.orientation().z(q[3]);
    vision_msgs::msg::ObjectHypothesisWithPose result;
    result.hypothesis().class_id(name);
    result.hypothesis().score(estimate.seen ? 1.0 : 0.0);
    result.pose().pose(pose);
    result.pose().covariance(estimate.covariance);
    vision_msgs::msg::Detection3D detection;
    detection.header(make_header(estimate.last_seen));
    detection.id(name);
    detection.results().push_back(std::move(result));
    detection.bbox().center(pose);
    detection.bbox().size(box_of(scene, name));
    message.detections().push_back(std::move(detection));
  }
  return message;
}

}  // namespace jostle::world
