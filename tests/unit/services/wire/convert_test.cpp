// There and back again, bit for bit.

#include "services/wire/convert/pool.hpp"

#include <gmock/gmock.h>

#include <limits>

namespace jostle::tests {
namespace {

using namespace physics_pool;
using ::testing::HasSubstr;
using wire::from_wire;
using wire::to_wire;

// Doubles that lose something in anything but a copy of their bits.
const std::vector<double> kAwkward{
    0.0, -0.0, 0.1, 1e-310, -kInfinity, kInfinity, std::numeric_limits<double>::max(), 1.0 / 3.0};

RolloutBatch odd_batch() {
  RolloutBatch batch;
  batch.world = {.high = UINT64_MAX, .low = 3};
  batch.x0 = {.q = kAwkward, .v = {1, 2}};
  batch.nominal = {.nu = 4, .values = kAwkward};
  batch.u_before = {1, 2, 3, -0.0};
  batch.step_duration = 0.7;
  batch.rest = 0.3;
  batch.law = {.sigma = {1, 2},
               .limit = {3, 4},
               .scales = {5, 6, 7},
               .seed = UINT64_MAX - 1,
               .stream = 17,
               .persistence = 0.3,
               .draws = {9, UINT32_MAX}};
  batch.first_sample = UINT32_MAX - 5;
  batch.samples = 5;
  batch.objective = {.terms = {{.kind = "goal", .weight = 1, .values = {2}},
                               {.kind = "unheard of", .weight = -0.0},
                               {.kind = "edge", .weight = 6, .values = {7, 8, 9}}},
                     .success_cost = 14};
  batch.noise = {.sigma = 0.003, .slope = 0.4, .seed = UINT64_MAX};
  batch.incumbent = 0.1;
  batch.stop_losers = false;
  batch.stop_hopeless = true;
  batch.stop_on_success = true;
  batch.min_steps = 9;
  batch.want_all_trajectories = true;
  batch.fidelity = {.freeze = true, .time_step = 0.008};
  batch.priority = Priority::kUrgent;
  batch.wait = std::chrono::nanoseconds(123456789);
  return batch;
}

TEST(ConvertBatch, SurvivesTheWire) {
  const RolloutBatch wanted = odd_batch();
  const RolloutBatch got = from_wire(to_wire(wanted));

  EXPECT_EQ(got.world, wanted.world);
  EXPECT_EQ(hash_of(got.x0.q), hash_of(wanted.x0.q));
  EXPECT_EQ(got.x0.v, wanted.x0.v);
  EXPECT_EQ(got.nominal.nu, wanted.nominal.nu);
  EXPECT_EQ(hash_of(got.nominal.values), hash_of(wanted.nominal.values));
  EXPECT_EQ(hash_of(got.u_before), hash_of(wanted.u_before));
  EXPECT_EQ(got.step_duration, wanted.step_duration);
  EXPECT_EQ(got.rest, wanted.rest);
  EXPECT_EQ(got.law.sigma, wanted.law.sigma);
  EXPECT_EQ(got.law.limit, wanted.law.limit);
  EXPECT_EQ(got.law.scales, wanted.law.scales);
  EXPECT_EQ(got.law.seed, wanted.law.seed);
  EXPECT_EQ(got.law.stream, wanted.law.stream);
  EXPECT_EQ(got.law.persistence, wanted.law.persistence);
  EXPECT_EQ(got.law.draws, wanted.law.draws);
  EXPECT_EQ(got.first_sample, wanted.first_sample);
  EXPECT_EQ(got.samples, wanted.samples);
  EXPECT_EQ(got.objective, wanted.objective);
  EXPECT_EQ(got.noise, wanted.noise);
  EXPECT_EQ(got.incumbent, wanted.incumbent);
  EXPECT_EQ(got.stop_losers, wanted.stop_losers);
  EXPECT_EQ(got.stop_on_success, wanted.stop_on_success);
  EXPECT_EQ(got.min_steps, wanted.min_steps);
  EXPECT_EQ(got.want_all_trajectories, wanted.want_all_trajectories);
  EXPECT_EQ(got.stop_hopeless, wanted.stop_hopeless);
  EXPECT_EQ(got.fidelity, wanted.fidelity);
  EXPECT_EQ(got.priority, wanted.priority);
  EXPECT_EQ(got.wait, wanted.wait);
}

TEST(ConvertBatch, KeepsInfinityAndTheAbsenceOfAWait) {
  const RolloutBatch got = from_wire(to_wire(RolloutBatch{}));
  EXPECT_EQ(got.incumbent, kInfinity);
  EXPECT_FALSE(got.wait);
}

RolloutOutcome odd_outcome() {
  return {.sample = 7,
          .end = End::kSucceeded,
          .cost = 0.1,
          .steps = 2,
          .engine_steps = std::uint64_t{1} << 40,
          .thawed = 3,
          .at_goal = true,
          .step_costs = {0.1, -0.0},
          .facts = {{.robot_hit_fixture = true}, {}},
          .trajectory = {{.q = {1, 2, 3}, .v = {4}}, {.q = {5, 6, -0.0}, .v = {kInfinity}}},
          .reason = "a reason"};
}

TEST(ConvertOutcome, SurvivesTheWire) {
  const RolloutOutcome wanted = odd_outcome();
  const auto got_result = from_wire(to_wire(wanted));

  ASSERT_TRUE(got_result);
  EXPECT_EQ(got_result->sample, wanted.sample);
  EXPECT_EQ(got_result->end, wanted.end);
  EXPECT_EQ(got_result->cost, wanted.cost);
  EXPECT_EQ(got_result->steps, wanted.steps);
  EXPECT_EQ(got_result->engine_steps, wanted.engine_steps);
  EXPECT_EQ(got_result->thawed, wanted.thawed);
  EXPECT_EQ(got_result->at_goal, wanted.at_goal);
  EXPECT_EQ(hash_of(got_result->step_costs), hash_of(wanted.step_costs));
  EXPECT_EQ(got_result->facts, wanted.facts);
  EXPECT_EQ(got_result->trajectory, wanted.trajectory);
  EXPECT_EQ(got_result->reason, wanted.reason);
}

TEST(ConvertOutcome, KeepsTheWorkersRefusal) {
  auto wire = to_wire(odd_outcome());
  wire.error("x0: bad");
  wire.error_code(static_cast<std::uint8_t>(Code::kUnknownWorld));

  const auto got_result = from_wire(wire);

  ASSERT_FALSE(got_result);
  EXPECT_EQ(got_result.error().code, Code::kUnknownWorld);
  EXPECT_EQ(got_result.error().message, "x0: bad");
}

TEST(ConvertOutcome, RefusesWhatMakesNoSense) {
  const std::pair<const char*, std::function<void(jostle_msgs::msg::AssignmentResult&)>> cases[] = {
      {"end", [](auto& wire) { wire.end(200); }},
      {"cost", [](auto& wire) { wire.cost(std::numeric_limits<double>::quiet_NaN()); }},
      {"step_costs", [](auto& wire) { wire.steps(3); }},
      {"facts", [](auto& wire) { wire.facts().pop_back(); }},
      {"trajectory", [](auto& wire) { wire.trajectory().pop_back(); }},
      {"trajectory", [](auto& wire) { wire.nq(0), wire.nv(0); }},
  };
  for (const auto& [field, spoil] : cases) {
    auto wire = to_wire(odd_outcome());
    spoil(wire);
    const auto got_result = from_wire(wire);
    ASSERT_FALSE(got_result) << field;
    EXPECT_THAT(got_result.error().message, HasSubstr(std::string("result.") + field + ": got"));
  }
}

}  // namespace
}  // namespace jostle::tests
