#pragma once
/// \file
/// Sight: from what a sensor sees to what is published of the objects.

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "perception/estimator/estimator.hpp"
#include "physics_pool/scene/scene.hpp"
#include "services/common/process/trouble.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/vision_topics.hpp"
#include "services/wire/dds/writer.hpp"
#include "services/world/link/objects_out.hpp"

namespace jostle::world {

/// Publishes one estimate of every object. Where the scene is known, it is the nearest one that physics can start from:
/// what may well stand stands, and nothing is inside anything else. One that cannot be made so is not published; the
/// log says which objects are to blame. At first, three seconds are waited for objects that nobody has seen yet.
///
/// Threads  look() on one, everything else on any.
class Sight {
 public:
  /// `scene`: nothing: objects are published as they are estimated, under the names that the sensor gives them.
  Sight(const wire::Participant& participant, std::optional<physics_pool::Scene> scene);

  /// Takes what was seen at `time`, s, and publishes what is known then. A time that is far before the newest begins
  /// anew: the sensor's clock, or the simulated world, was started again.
  void look(double time, const std::vector<perception::Sighting>& seen);

  /// Returns the objects that were not seen for a second of the wall clock.
  std::set<std::string> unseen() const;
  /// Logs which objects are lost and found, if that has changed.
  void say_unseen();
  /// Logs what came of all sightings.
  void say_counts() const;

 private:
  using Clock = std::chrono::steady_clock;

  void tell(const std::vector<perception::Estimate>& estimates);
  bool make_feasible(std::vector<perception::Estimate>& estimates);
  // Whether all of the scene's objects were seen, or enough time has passed.
  bool is_complete(const std::vector<perception::Estimate>& estimates);

  const std::optional<physics_pool::Scene> scene_;
  ObjectTopics topics_;
  wire::Writer<vision_msgs::msg::Detection3DArray> detections_;
  Clock::time_point next_detections_{};
  perception::Estimator estimator_;
  double newest_ = 0.0;  // s
  bool complete_ = false;
  std::optional<Clock::time_point> first_;  // estimate of anything
  common::Trouble bad_{"bad sightings"}, infeasible_{"estimates that cannot be"};
  mutable std::mutex mutex_;  // guards what follows
  std::map<std::string, Clock::time_point> seen_;
  perception::Estimator::Counts counts_;
  std::set<std::string> lost_;
};

}  // namespace jostle::world
