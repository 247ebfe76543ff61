#include "services/wire/convert/pool.hpp"

#include <fmt/format.h>

#include <cmath>

namespace jostle::wire {
namespace {

namespace msg = jostle_msgs::msg;
using physics_pool::End;
using physics_pool::Objective;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

constexpr std::int64_t kSimulate = -1;  // of BatchDescription::wait

msg::ObjectiveWeights to_wire(const Objective& objective) {
  msg::ObjectiveWeights wire;
  wire.goal(objective.goal);
  wire.angle(objective.angle);
  wire.acceleration(objective.acceleration);
  wire.disturbance(objective.disturbance);
  wire.disturbance_rotation(objective.disturbance_rotation);
  wire.edge(objective.edge);
  wire.edge_rate(objective.edge_rate);
  wire.edge_exponent_max(objective.edge_exponent_max);
  wire.edge_margin(objective.edge_margin);
  wire.topple(objective.topple);
  wire.topple_angle(objective.topple_angle);
  wire.drop(objective.drop);
  wire.drop_height(objective.drop_height);
  wire.obstruction(objective.obstruction);
  wire.obstacle_target(objective.obstacle_target);
  wire.obstacle_pusher(objective.obstacle_pusher);
  wire.obstacle_nearest(objective.obstacle_nearest);
  wire.collision(objective.collision);
  wire.intrusion(objective.intrusion);
  wire.success_cost(objective.success_cost);
  return wire;
}

Objective from_wire(const msg::ObjectiveWeights& wire) {
  return {.goal = wire.goal(),
          .angle = wire.angle(),
          .acceleration = wire.acceleration(),
          .disturbance = wire.disturbance(),
          .disturbance_rotation = wire.disturbance_rotation(),
          .edge = wire.edge(),
          .edge_rate = wire.edge_rate(),
          .edge_exponent_max = wire.edge_exponent_max(),
          .edge_margin = wire.edge_margin(),
          .topple = wire.topple(),
          .topple_angle = wire.topple_angle(),
          .drop = wire.drop(),
          .drop_height = wire.drop_height(),
          .obstruction = wire.obstruction(),
          .obstacle_target = wire.obstacle_target(),
          .obstacle_pusher = wire.obstacle_pusher(),
          .obstacle_nearest = wire.obstacle_nearest(),
          .collision = wire.collision(),
          .intrusion = wire.intrusion(),
          .success_cost = wire.success_cost()};
}

Error wrong(const char* field, const std::string& got, const std::string& wanted) {
  return {Code::kInvalidArgument, fmt::format("result.{}: got {}, wanted {}", field, got, wanted)};
}

Result<Trajectory> trajectory_from_wire(const msg::AssignmentResult& wire) {
  const std::size_t nq = wire.nq(), nv = wire.nv(), size = wire.trajectory().size();
  if (size == 0) return Trajectory{};
  if (nq + nv == 0 || size % (nq + nv) != 0) {
    return wrong("trajectory", fmt::format("{} values", size), fmt::format("a multiple of nq + nv = {}", nq + nv));
  }
  Trajectory trajectory;
  for (auto at = wire.trajectory().begin(); at != wire.trajectory().end();) {
    const auto v = at + static_cast<std::ptrdiff_t>(nq), end = v + static_cast<std::ptrdiff_t>(nv);
    trajectory.push_back({.q = {at, v}, .v = {v, end}});
    at = end;
  }
  return trajectory;
}

}  // namespace

msg::WorldHash to_wire(const Hash& hash) {
  msg::WorldHash wire;
  wire.high(hash.high);
  wire.low(hash.low);
  return wire;
}

Hash from_wire(const msg::WorldHash& wire) { return {.high = wire.high(), .low = wire.low()}; }

msg::BatchDescription to_wire(const RolloutBatch& batch) {
  msg::BatchDescription wire;
  wire.world(to_wire(batch.world));
  wire.q(batch.x0.q);
  wire.v(batch.x0.v);
  wire.nu(batch.nominal.nu);
  wire.nominal(batch.nominal.values);
  wire.u_before(batch.u_before);
  wire.step_duration(batch.step_duration);
  wire.sigma(batch.law.sigma);
  wire.limit(batch.law.limit);
  wire.scales(batch.law.scales);
  wire.seed(batch.law.seed);
  wire.stream(batch.law.stream);
  wire.persistence(batch.law.persistence);
  wire.draws(batch.law.draws);
  wire.first_sample(batch.first_sample);
  wire.samples(batch.samples);
  wire.objective(to_wire(batch.objective));
  wire.incumbent(batch.incumbent);
  wire.stop_losers(batch.stop_losers);
  wire.stop_hopeless(batch.stop_hopeless);
  wire.stop_on_success(batch.stop_on_success);
  wire.min_steps(batch.min_steps);
  wire.want_all_trajectories(batch.want_all_trajectories);
  wire.freeze(batch.fidelity.freeze);
  wire.time_step(batch.fidelity.time_step);
  wire.priority(static_cast<std::uint8_t>(batch.priority));
  wire.wait(batch.wait ? batch.wait->count() : kSimulate);
  return wire;
}

RolloutBatch from_wire(const msg::BatchDescription& wire) {
  RolloutBatch batch;
  batch.world = from_wire(wire.world());
  batch.x0 = {.q = wire.q(), .v = wire.v()};
  batch.nominal = {.nu = wire.nu(), .values = wire.nominal()};
  batch.u_before = wire.u_before();
  batch.step_duration = wire.step_duration();
  batch.law = {.sigma = wire.sigma(),
               .limit = wire.limit(),
               .scales = wire.scales(),
               .seed = wire.seed(),
               .stream = wire.stream(),
               .persistence = wire.persistence(),
               .draws = wire.draws()};
  batch.first_sample = wire.first_sample();
  batch.samples = wire.samples();
  batch.objective = from_wire(wire.objective());
  batch.incumbent = wire.incumbent();
  batch.stop_losers = wire.stop_losers();
  batch.stop_hopeless = wire.stop_hopeless();
  batch.stop_on_success = wire.stop_on_success();
  batch.min_steps = wire.min_steps();
  batch.want_all_trajectories = wire.want_all_trajectories();
  batch.fidelity = {.freeze = wire.freeze(), .time_step = wire.time_step()};
  batch.priority = static_cast<physics_pool::Priority>(wire.priority());  // any octet: validate judges
  if (wire.wait() != kSimulate) batch.wait = std::chrono::nanoseconds(wire.wait());
  return batch;
}

msg::AssignmentResult to_wire(const RolloutOutcome& outcome) {
  msg::AssignmentResult wire;
  wire.sample(outcome.sample);
  wire.end(static_cast<std::uint8_t>(outcome.end));
  wire.cost(outcome.cost);
  wire.steps(outcome.steps);
  wire.engine_steps(outcome.engine_steps);
  wire.thawed(outcome.thawed);
  wire.at_goal(outcome.at_goal);
  wire.step_costs(outcome.step_costs);
  wire.reason(outcome.reason);
  if (!outcome.trajectory.empty()) {
    wire.nq(static_cast<std::uint32_t>(outcome.trajectory.front().q.size()));
    wire.nv(static_cast<std::uint32_t>(outcome.trajectory.front().v.size()));
  }
  std::vector<double>& flat = wire.trajectory();
  for (const State& x : outcome.trajectory) {
    flat.insert(flat.end(), x.q.begin(), x.q.end());
    flat.insert(flat.end(), x.v.begin(), x.v.end());
  }
  return wire;
}

Result<RolloutOutcome> from_wire(const msg::AssignmentResult& wire) {
  if (!wire.error().empty()) {
    const bool known = wire.error_code() <= static_cast<std::uint8_t>(Code::kInternal);
    return Error{known ? static_cast<Code>(wire.error_code()) : Code::kInternal, wire.error()};
  }
  if (wire.end() > static_cast<std::uint8_t>(End::kSkipped)) {
    return wrong("end", std::to_string(wire.end()), "a value of End");
  }
  if (std::isnan(wire.cost())) return wrong("cost", "NaN", "a cost or +inf");
  if (wire.step_costs().size() != wire.steps()) {
    return wrong("step_costs", fmt::format("{} values", wire.step_costs().size()),
                 fmt::format("steps = {}", wire.steps()));
  }
  auto trajectory_result = trajectory_from_wire(wire);
  if (!trajectory_result) return trajectory_result.error();
  return RolloutOutcome{.sample = wire.sample(),
                        .end = static_cast<End>(wire.end()),
                        .cost = wire.cost(),
                        .steps = wire.steps(),
                        .engine_steps = wire.engine_steps(),
                        .thawed = wire.thawed(),
                        .at_goal = wire.at_goal(),
                        .step_costs = wire.step_costs(),
                        .trajectory = std::move(trajectory_result).value(),
                        .reason = wire.reason()};
}

}  // namespace jostle::wire
