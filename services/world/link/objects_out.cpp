#include "services/world/link/objects_out.hpp"

#include <algorithm>
#include <utility>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;
namespace natnet = perception::natnet;

}  // namespace

ObjectTopics::ObjectTopics(const wire::Participant& participant, const Hash& scene, std::chrono::milliseconds pause)
    : scene_(scene.empty() ? "" : to_string(scene)),
      pause_(pause),
      states_(participant, wire::topics::kObjectStates),
      poses_(participant, wire::topics::kObjectPoses),
      transforms_(participant, wire::topics::kTransforms) {}

// States: when one is lost, the next one follows soon and says as much.
void ObjectTopics::tell(const std::vector<perception::ObjectReading>& objects, double time) {
  auto message = to_message(objects, time);
  message.scene(scene_);
  (void)states_.write(message);
  const auto now = steady_clock::now();
  if (now < next_) return;
  next_ = now + pause_;
  (void)poses_.write(pose_array_message(message));
  if (!pace_.is_due(time)) return;
  (void)transforms_.write(transform_message(message));
}

Result<std::unique_ptr<MocapCameras>> MocapCameras::start(const std::string& address, const StateLayout& layout,
                                                          const MocapFaultOptions& faults) {
  std::vector<natnet::Model> models;
  std::vector<std::string> names;
  for (const ObjectSlot& object : layout.objects) {
    names.push_back(object.name);
    models.push_back({.id = static_cast<std::int32_t>(names.size()), .name = object.name});
  }
  auto server_result = natnet::Server::listen({.address = address}, std::move(models));
  if (!server_result) return server_result.error();
  return std::unique_ptr<MocapCameras>(new MocapCameras(std::move(server_result).value(), std::move(names), faults));
}

void MocapCameras::tell(const std::vector<perception::ObjectReading>& objects, double time) {
  natnet::Frame frame{.timestamp = time};
  for (const perception::ObjectReading& object : objects) {
    const auto place = std::ranges::find(names_, object.name) - names_.begin();
    natnet::Body body{.id = static_cast<std::int32_t>(place) + 1};
    std::ranges::transform(object.position, body.position.begin(),
                           [](double value) { return static_cast<float>(value); });
    std::ranges::transform(object.orientation, body.orientation.begin(),
                           [](double value) { return static_cast<float>(value); });
    frame.bodies.push_back(body);
  }
  faults_.spoil(frame);
  const std::chrono::duration<double> latency(faults_.latency());
  server_->publish(std::move(frame), std::chrono::duration_cast<std::chrono::nanoseconds>(latency));
}

}  // namespace jostle::world
