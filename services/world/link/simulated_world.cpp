#include "services/world/link/simulated_world.hpp"

#include <cmath>
#include <thread>
#include <utility>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;

std::vector<std::string> names_of(const std::vector<physics_pool::SceneObject>& objects) {
  std::vector<std::string> names;
  for (const physics_pool::SceneObject& object : objects) names.push_back(object.name);
  return names;
}

}  // namespace

SimulatedWorld::SimulatedWorld(const wire::Participant& participant, const physics_pool::WorldPtr& world,
                               const SimulatedWorldOptions& options, ObjectsOut& objects)
    : options_(options),
      world_(world, options.noise),
      still_(static_cast<std::size_t>(world->geometry().layout.nu), 0.0),
      objects_(objects),
      robot_(participant, world->scene().robot.model, world->scene().robot.base, names_of(world->scene().objects)),
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
  // States: when one is lost, the next one follows soon and says as much.
  rosgraph_msgs::msg::Clock clock;
  clock.clock(make_header(time).stamp());
  (void)clock_.write(clock);
  objects_.show(truth, time);
  objects_.tell(object_readings(geometry.layout, seen), time);
  robot_.tell(truth, time);
}

}  // namespace jostle::world
