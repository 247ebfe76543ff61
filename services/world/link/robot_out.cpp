#include "services/world/link/robot_out.hpp"

#include <utility>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using physics_pool::RobotFrame;
using std::chrono::steady_clock;

constexpr std::chrono::seconds kStanding{1};  // between equal transforms

std::vector<std::string> with_world(std::vector<std::string> names) {
  names.emplace_back(kWorldFrame);
  return names;
}

StateLayout layout_of(const physics_pool::RobotModel& model) {
  StateLayout layout;
  for (const physics_pool::Joint& joint : model.joints) layout.joints.push_back(joint.name);
  return layout;
}

}  // namespace

bool TransformPace::is_due(double time) {
  const auto now = steady_clock::now();
  if (time == time_ && now < next_) return false;
  time_ = time;
  next_ = now + kStanding;
  return true;
}

RobotTopics::RobotTopics(const wire::Participant& participant, physics_pool::RobotModel model, const Pose& base,
                         std::vector<std::string> taken)
    : model_(std::move(model)),
      frames_(physics_pool::robot_frames(model_, base, with_world(std::move(taken)))),
      layout_(layout_of(model_)),
      joints_(participant, wire::topics::kJointStates),
      transforms_(participant, wire::topics::kTransforms),
      static_transforms_(participant, wire::topics::kStaticTransforms),
      description_(participant, wire::topics::kRobotDescription) {
  std_msgs::msg::String description;
  description.data(physics_pool::to_urdf(model_, frames_));
  // The first samples of their writers: there is room.
  (void)description_.write(description);
  tf2_msgs::msg::TFMessage message;
  for (const RobotFrame& frame : frames_) {
    if (frame.joint < 0) message.transforms().push_back(transform_of(frame, {}, 0.0));
  }
  (void)static_transforms_.write(message);
}

void RobotTopics::tell(const State& x, double time) {
  // States: when one is lost, the next one follows soon and says as much.
  (void)joints_.write(joint_state_message(layout_, x, time));
  if (!pace_.is_due(time)) return;
  tf2_msgs::msg::TFMessage message;
  for (const RobotFrame& frame : frames_) {
    if (frame.joint >= 0) message.transforms().push_back(transform_of(frame, x.q, time));
  }
  (void)transforms_.write(message);
}

geometry_msgs::msg::TransformStamped RobotTopics::transform_of(const RobotFrame& frame, std::span<const double> q,
                                                               double time) const {
  const Pose X_PF = pose_of(physics_pool::frame_pose(model_, frame, q));
  geometry_msgs::msg::TransformStamped message;
  message.header(
      make_header(time, frame.parent < 0 ? kWorldFrame : frames_[static_cast<std::size_t>(frame.parent)].name));
  message.child_frame_id(frame.name);
  message.transform().translation().x(X_PF.position[0]);
  message.transform().translation().y(X_PF.position[1]);
  message.transform().translation().z(X_PF.position[2]);
  message.transform().rotation().w(X_PF.orientation[0]);
  message.transform().rotation().x(X_PF.orientation[1]);
  message.transform().rotation().y(X_PF.orientation[2]);
  message.transform().rotation().z(X_PF.orientation[3]);
  return message;
}

}  // namespace jostle::world
