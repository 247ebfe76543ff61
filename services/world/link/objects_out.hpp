#pragma once
/// \file
/// Where measurements of objects go: topics, or a simulated motion capture.

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/hash.hpp"
#include "idl/types/state.hpp"
#include "perception/api/object_source.hpp"
#include "perception/natnet/server.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"
#include "services/world/link/mocap_faults.hpp"
#include "services/world/link/robot_out.hpp"

namespace jostle::world {

/// Takes measurements for whoever wants to know. Threads  one.
class ObjectsOut {
 public:
  virtual ~ObjectsOut() = default;
  /// `time`: s of the clock that stamps are of.
  virtual void tell(const std::vector<perception::ObjectReading>& objects, double time) = 0;
  /// Shows the true state of the world to who makes pictures of it.
  virtual void show(const State& /*truth*/, double /*time*/) {}
};

/// Publishes states, and in standard forms poses and transforms.
class ObjectTopics final : public ObjectsOut {
 public:
  /// `scene`: scene_hash() of the simulated scene that they are of; empty: of a real world.
  /// `pause`: between two messages of the standard forms, by the wall clock.
  ObjectTopics(const wire::Participant& participant, const Hash& scene, std::chrono::milliseconds pause = {});
  void tell(const std::vector<perception::ObjectReading>& objects, double time) override;

 private:
  const std::string scene_;
  const std::chrono::milliseconds pause_;
  std::chrono::steady_clock::time_point next_{};
  TransformPace pace_;
  wire::Writer<jostle_msgs::msg::ObjectStates> states_;
  wire::Writer<geometry_msgs::msg::PoseArray> poses_;
  wire::Writer<tf2_msgs::msg::TFMessage> transforms_;
};

/// Cameras of a simulated motion capture: each object is a rigid body of its name, seen with the faults that were
/// ordered, and `jostle perceive mocap` reads them. The frames' timestamps are the times that tell() is given.
class MocapCameras final : public ObjectsOut {
 public:
  /// `address`: IPv4 of this host, on whose NatNet ports they serve. `layout`: has the objects.
  /// Error kUnavailable: the port is taken.
  static Result<std::unique_ptr<MocapCameras>> start(const std::string& address, const StateLayout& layout,
                                                     const MocapFaultOptions& faults);
  void tell(const std::vector<perception::ObjectReading>& objects, double time) override;

 private:
  MocapCameras(std::unique_ptr<perception::natnet::Server> server, std::vector<std::string> names,
               const MocapFaultOptions& faults)
      : server_(std::move(server)), names_(std::move(names)), faults_(faults) {}

  std::unique_ptr<perception::natnet::Server> server_;
  const std::vector<std::string> names_;  // the id of a body is its place here, from 1
  MocapFaults faults_;
};

}  // namespace jostle::world
