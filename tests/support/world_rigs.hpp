#pragma once
/// \file
/// Every implementation of the two ports, each with what it needs to be alive and what a
/// test knows of the world behind it.

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "physics_pool/local/execution_world.hpp"
#include "robot_bridge/safety/guard.hpp"
#include "services/bags/replay/recorded_world.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/world/in_process/in_process_world.hpp"
#include "services/world/link/world_client.hpp"
#include "tests/support/kinematic_world.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/test_domain.hpp"

namespace jostle::tests {

/// A robot, its objects and what is behind them.
class WorldRig {
 public:
  explicit WorldRig(physics_pool::Scene its_scene) : scene(std::move(its_scene)) {}
  virtual ~WorldRig() = default;
  WorldRig(const WorldRig&) = delete;
  WorldRig& operator=(const WorldRig&) = delete;

  virtual robot_bridge::Robot& robot() = 0;
  virtual perception::ObjectSource& objects() = 0;

  /// s of the world's clock, as of the last reading.
  virtual double time() = 0;

  /// Executes, and remembers for truth().
  virtual Result<void> act(std::span<const double> u, double duration) { return robot().execute(u, duration, {}); }

  /// What the world must be like after all that act() did.
  virtual State truth() = 0;

  /// Returns the largest speeds of the robot's axes, m/s or rad/s.
  virtual std::vector<double> limits() const { return physics_pool::axis_limits(scene.robot.model); }

  /// Whether time goes on between actions, and an action takes as long as the machine lets it.
  virtual bool time_goes_on() const { return false; }
  /// Returns how far a robot that should stand still may move meanwhile, m and rad.
  virtual double play() const { return 0.0; }

  /// Until an action that another thread began is at work, as far as one can see that.
  virtual void wait_until_busy() {}

  const physics_pool::Scene scene;
  const StateLayout layout = layout_of(scene);
};

inline physics_pool::WorldPtr compiled(const physics_pool::Scene& scene) {
  auto world_result = physics_pool::World::compile(scene);
  if (!world_result) throw std::runtime_error(world_result.error().message);
  return std::move(world_result).value();
}

/// services/world/in_process.
class InProcessRig final : public WorldRig {
 public:
  explicit InProcessRig(const physics_pool::Scene& its_scene) : WorldRig(its_scene) {}

  robot_bridge::Robot& robot() override { return robot_; }
  perception::ObjectSource& objects() override { return objects_; }
  double time() override { return world_.time(); }
  State truth() override { return world_.state(); }

 private:
  physics_pool::ExecutionWorld world_{compiled(scene)};
  world::SimulatedRobot robot_{world_};
  world::SimulatedObjects objects_{world_, scene};
};

/// A guard around that one.
class GuardedRig final : public WorldRig {
 public:
  explicit GuardedRig(const physics_pool::Scene& its_scene) : WorldRig(its_scene) {}

  robot_bridge::Robot& robot() override { return guard_; }
  perception::ObjectSource& objects() override { return inside_.objects(); }
  double time() override { return inside_.time(); }
  State truth() override { return inside_.truth(); }

 private:
  robot_bridge::GuardOptions options() const {
    robot_bridge::GuardOptions options;
    for (const physics_pool::Axis& axis : scene.robot.model.axes) {
      robot_bridge::GuardedAxis guarded{.limit = axis.limit, .change = axis.limit, .joints = {}};
      for (const auto& [joint, share] : axis.joints)
        guarded.joints.emplace_back(static_cast<std::size_t>(joint), share);
      options.axes.push_back(std::move(guarded));
    }
    options.stray.assign(layout.joints.size(), 0.01);  // m, rad
    return options;
  }

  InProcessRig inside_{scene};
  robot_bridge::Guard guard_{inside_.robot(), options()};
};

/// services/world/link with a jostle_sim behind it. One at a time: a process has one participant.
class ClientRig final : public WorldRig {
 public:
  explicit ClientRig(const physics_pool::Scene& its_scene)
      : WorldRig(its_scene),
        sim_("jostle_sim",
             {folder_.write("scene.yaml", physics_pool::to_yaml(scene)), "--rate", std::to_string(kRate), "--domain",
              std::to_string(test_domain()), "--die-with-parent", std::to_string(getpid())},
             folder_) {}

  robot_bridge::Robot& robot() override { return robot_; }
  perception::ObjectSource& objects() override { return objects_; }
  double time() override { return robot_.time(); }

  Result<void> act(std::span<const double> u, double duration) override {
    auto ok = robot_.execute(u, duration, {});
    if (ok) {
      if (auto done = world::SimulatedRobot(same_).execute(u, duration, {}); !done) return done;
    }
    return ok;
  }
  State truth() override { return same_.state(); }

  void wait_until_busy() override {
    const auto deadline = in(std::chrono::seconds(60));
    for (;;) {
      const auto status = statuses_.take(deadline);
      if (!status) throw std::runtime_error("the world never became busy: " + sim_.err());
      if (status->busy()) return;
    }
  }

 private:
  static constexpr int kRate = 20;  // an action of a minute takes 3 s
  static constexpr world::WorldClientOptions kPatient{.silence = std::chrono::seconds(20),
                                                      .start = std::chrono::seconds(60)};

  TempFolder folder_;
  ProgramProcess sim_;
  const wire::Participant participant_ = wire::Participant::open({.domain = test_domain()}).value();
  wire::Inbox<jostle_msgs::msg::RobotStatus> statuses_{participant_, wire::topics::kRobotStatus, 64};
  world::RobotClient robot_{participant_, kPatient};
  world::ObjectsClient objects_{participant_, robot_, kPatient};
  physics_pool::ExecutionWorld same_{compiled(scene)};  // what the process does, done here
};

/// services/bags/replay: the made-up recording of a robot that goes 1 cm ahead in every
/// action, and of objects that drift.
class RecordedRig : public WorldRig {
 public:
  static constexpr std::size_t kActions = 8;
  static constexpr double kActionTime = 0.2;  // s

  /// `rate`: of RecordedWorld.
  explicit RecordedRig(const physics_pool::Scene& its_scene, double rate = 0.0)
      : WorldRig(its_scene), run_(record()), world_(run_, physics_pool::axis_limits(scene.robot.model), rate) {}

  robot_bridge::Robot& robot() override { return robot_; }
  perception::ObjectSource& objects() override { return objects_; }
  double time() override { return world_.time(); }

  Result<void> act(std::span<const double> u, double duration) override {
    auto ok = robot_.execute(u, duration, {});
    if (ok) ++at_;
    return ok;
  }
  State truth() override { return states_[at_]; }

 private:
  bags::RecordedRun record() {
    bags::RecordedRun run;
    State x = physics_pool::initial_state(scene);
    const auto joints = static_cast<std::ptrdiff_t>(layout.joints.size());
    for (std::size_t i = 0; i <= kActions; ++i) {
      states_.push_back(x);
      const world::Seen seen{.robot = {.stamp = kActionTime * static_cast<double>(i),
                                       .q = {x.q.begin(), x.q.begin() + joints},
                                       .v = {x.v.begin(), x.v.begin() + joints},
                                       .object_in_hand = scene.robot.model.hand ? std::optional(false) : std::nullopt},
                             .objects = world::object_readings(layout, x)};
      run.observations.push_back(world::to_message(seen, kActionTime * static_cast<double>(i)));
      run.observed.push_back(static_cast<bags::Time>(static_cast<double>(i) * kActionTime * 1e9));
      x.q[kJointX] += 0.01;
      for (const ObjectSlot& slot : layout.objects) x.q[static_cast<std::size_t>(slot.q)] += 0.002;
    }
    return run;
  }

  std::vector<State> states_;
  std::size_t at_ = 0;  // actions that act() did
  bags::RecordedRun run_;
  bags::RecordedWorld world_;
  bags::RecordedWorld::Robot robot_{world_};
  bags::RecordedWorld::Objects objects_{world_};
};

/// The same where an action takes an hour.
class SlowlyRecordedRig final : public RecordedRig {
 public:
  explicit SlowlyRecordedRig(const physics_pool::Scene& its_scene) : RecordedRig(its_scene, kActionTime / 3600) {}
};

/// tests/support/kinematic_world.hpp.
class KinematicRig final : public WorldRig {
 public:
  explicit KinematicRig(const physics_pool::Scene& its_scene) : WorldRig(its_scene) {}

  robot_bridge::Robot& robot() override { return robot_; }
  perception::ObjectSource& objects() override { return objects_; }
  double time() override {
    double sum = 0.0;
    for (const double duration : robot_.durations) sum += duration;
    return sum;
  }
  State truth() override { return x_; }

 private:
  State x_ = physics_pool::initial_state(scene);
  KinematicRobot robot_{x_, layout.robot_joints(), layout.nu};
  KinematicObjects objects_{layout, x_};
};

/// One implementation in one scene.
struct WorldCase {
  const char* name;  ///< of the scene
  std::unique_ptr<WorldRig> (*make)();
};

/// The gripper among three objects.
template <class Rig>
std::unique_ptr<WorldRig> gripper_rig() {
  return std::make_unique<Rig>(three_objects());
}

/// The pusher, 1 cm behind its target.
template <class Rig>
std::unique_ptr<WorldRig> pusher_rig() {
  return std::make_unique<Rig>(push_around());
}

template <class Rig>
auto with_gripper() {
  return ::testing::Values(WorldCase{"gripper", &gripper_rig<Rig>});
}

template <class Rig>
auto with_pusher() {
  return ::testing::Values(WorldCase{"pusher", &pusher_rig<Rig>});
}

template <class Rig>
auto in_both_scenes() {
  return ::testing::Values(WorldCase{"gripper", &gripper_rig<Rig>}, WorldCase{"pusher", &pusher_rig<Rig>});
}

inline std::string scene_name(const ::testing::TestParamInfo<WorldCase>& test) { return test.param.name; }

}  // namespace jostle::tests
