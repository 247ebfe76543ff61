#include "services/wire/convert/pool.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace jostle::wire {
namespace {

namespace msg = jostle_msgs::msg;
using physics_pool::End;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

constexpr std::uint8_t kHitFixture = 1;  // of TaskResult::facts
constexpr std::int64_t kSimulate = -1;   // of BatchDescription::wait

std::vector<msg::Term> to_wire(const std::vector<physics_pool::Term>& terms) {
  std::vector<msg::Term> wire;
  for (const physics_pool::Term& term : terms) {
    msg::Term& one = wire.emplace_back();
    one.kind(term.kind);
    one.weight(term.weight);
    one.values(term.values);
  }
  return wire;
}

std::vector<physics_pool::Term> from_wire(std::vector<msg::Term>&& wire) {
  std::vector<physics_pool::Term> terms;
  terms.reserve(wire.size());
  for (msg::Term& term : wire)
    terms.push_back({.kind = std::move(term.kind()), .weight = term.weight(), .values = std::move(term.values())});
  return terms;
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
  wire.rest(batch.rest);
  wire.sigma(batch.law.sigma);
  wire.limit(batch.law.limit);
  wire.scales(batch.law.scales);
  wire.seed(batch.law.seed);
  wire.stream(batch.law.stream);
  wire.persistence(batch.law.persistence);
  wire.draws(batch.law.draws);
  wire.first_sample(batch.first_sample);
  wire.samples(batch.samples);
  wire.terms(to_wire(batch.objective.terms));
  wire.success_cost(batch.objective.success_cost);
  wire.noise().sigma(batch.noise.sigma);
  wire.noise().slope(batch.noise.slope);
  wire.noise().seed(batch.noise.seed);
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

RolloutBatch from_wire(msg::BatchDescription wire) {
  RolloutBatch batch{.objective = {.terms = from_wire(std::move(wire.terms())), .success_cost = wire.success_cost()}};
  batch.world = from_wire(wire.world());
  batch.x0 = {.q = std::move(wire.q()), .v = std::move(wire.v())};
  batch.nominal = {.nu = wire.nu(), .values = std::move(wire.nominal())};
  batch.u_before = std::move(wire.u_before());
  batch.step_duration = wire.step_duration();
  batch.rest = wire.rest();
  batch.law = {.sigma = std::move(wire.sigma()),
               .limit = std::move(wire.limit()),
               .scales = std::move(wire.scales()),
               .seed = wire.seed(),
               .stream = wire.stream(),
               .persistence = wire.persistence(),
               .draws = std::move(wire.draws())};
  batch.first_sample = wire.first_sample();
  batch.samples = wire.samples();
  batch.noise = {.sigma = wire.noise().sigma(), .slope = wire.noise().slope(), .seed = wire.noise().seed()};
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
  for (const physics_pool::StepFacts& facts : outcome.facts)
    wire.facts().push_back(facts.robot_hit_fixture ? kHitFixture : 0);
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

Result<RolloutOutcome> from_wire(msg::AssignmentResult wire) {
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
  if (wire.facts().size() != wire.steps()) {
    return wrong("facts", fmt::format("{} values", wire.facts().size()), fmt::format("steps = {}", wire.steps()));
  }
  std::vector<physics_pool::StepFacts> facts;
  for (const std::uint8_t bits : wire.facts()) facts.push_back({.robot_hit_fixture = (bits & kHitFixture) != 0});
  auto trajectory_result = trajectory_from_wire(wire);
  if (!trajectory_result) return trajectory_result.error();
  return RolloutOutcome{.sample = wire.sample(),
                        .end = static_cast<End>(wire.end()),
                        .cost = wire.cost(),
                        .steps = wire.steps(),
                        .engine_steps = wire.engine_steps(),
                        .thawed = wire.thawed(),
                        .at_goal = wire.at_goal(),
                        .step_costs = std::move(wire.step_costs()),
                        .facts = std::move(facts),
                        .trajectory = std::move(trajectory_result).value(),
                        .reason = std::move(wire.reason())};
}

}  // namespace jostle::wire
