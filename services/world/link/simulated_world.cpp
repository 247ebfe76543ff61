#include "services/world/link/simulated_world.hpp"

#include <cmath>
#include <thread>
#include <utility>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::seconds kStandingTransforms{1};  // between equal transforms

}  // namespace

SimulatedWorld::SimulatedWorld(const wire::Participant& participant, physics_pool::WorldPtr world,
                               const SimulatedWorldOptions& options)
    : options_(options),
      world_(world, options.noise),
      still_(static_cast<std::size_t>(world->geometry().layout.nu), 0.0),
      joints_(participant, wire::topics::kJointStates),
      objects_(participant, wire::topics::kObjectStates),
      poses_(participant, wire::topics::kObjectPoses),
      transforms_(participant, wire::topics::kTransforms),
      clock_(participant, wire::topics::kClock) {}

std::vector<double> SimulatedWorld::limits() const {
  return physics_pool::axis_limits(world_.world().scene().robot.model);
}

Result<void> SimulatedWorld::begin(std::span<const double> u, double duration) {
  moved_ = true;
  steps_ = steps_left_ = std::lround(duration / world_.world().time_step());
  world_.begin(u);
  began_ = steady_clock::now();
  return {};
}

Result<void> SimulatedWorld::advance() {
  if (options_.rate > 0) {
    const double steps_made = static_cast<double>(steps_ - steps_left_);
    const std::chrono::duration<double> due(steps_made * world_.world().time_step() / options_.rate);
    std::this_thread::sleep_until(began_ + std::chrono::duration_cast<steady_clock::duration>(due));
  }
  --steps_left_;
  return world_.step();
}

// No action at work: the robot holds still, or the world stands still.
Result<bool> SimulatedWorld::rest() {
  if (!options_.free_running) return false;
  const double time_step = world_.world().time_step();
  world_.begin(still_);
  if (auto ok = world_.step(); !ok) return ok.error();
  const double rate = options_.rate > 0 ? options_.rate : 1.0;
  std::this_thread::sleep_for(std::chrono::duration<double>(time_step / rate));
  return true;
}

void SimulatedWorld::publish() {
  const physics_pool::TaskGeometry& geometry = world_.world().geometry();
  const State& truth = world_.state();
  const double time = world_.time();
  const State seen =
      physics_pool::observed_state(world_.world().scene(), options_.belief, truth,
                                   moved_ ? physics_pool::Measurement::kFeedback : physics_pool::Measurement::kInitial);
  const auto objects = to_message(object_readings(geometry.layout, seen), time);
  // States: when one is lost, the next one follows soon and says as much.
  rosgraph_msgs::msg::Clock clock;
  clock.clock(make_header(time).stamp());
  (void)clock_.write(clock);
  (void)objects_.write(objects);
  (void)poses_.write(pose_array_message(objects));
  // tf2 complains of a transform that it has: while the world stands still, one now and then serves who comes late.
  if (time != transforms_time_ || steady_clock::now() >= next_transforms_) {
    transforms_time_ = time;
    next_transforms_ = steady_clock::now() + kStandingTransforms;
    (void)transforms_.write(transform_message(objects));
  }
  (void)joints_.write(joint_state_message(geometry.layout, truth, time));
}

}  // namespace jostle::world
