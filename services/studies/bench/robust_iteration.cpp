#include <fmt/format.h>

#include <thread>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "planners/robustness/robust_sto.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using physics_pool::BatchReply;
using physics_pool::RolloutBatch;

constexpr std::chrono::milliseconds kRollout{250};  // that a rollout waits: one of an arm in a shelf takes as long
constexpr int kSteps = 5;                           // N
constexpr int kIterations = 4;

// A pool whose rollouts wait instead of simulating. They come back with trajectories in which nothing moves, so that
// the planner has as much to do with them as with real ones.
class Waiting final : public physics_pool::Pool {
 public:
  explicit Waiting(physics_pool::Pool& pool) : pool_(pool) {}

  Result<Hash> load(const physics_pool::Scene& scene) override { return pool_.load(scene); }

  Result<BatchReply> run(const RolloutBatch& batch, TimePoint deadline, std::stop_token stop) override {
    auto replies_result = run_all(std::span(&batch, 1), deadline, std::move(stop));
    if (!replies_result) return replies_result.error();
    return std::move(replies_result->front());
  }

  Result<std::vector<BatchReply>> run_all(std::span<const RolloutBatch> batches, TimePoint deadline,
                                          std::stop_token stop) override {
    std::vector<RolloutBatch> waiting(batches.begin(), batches.end());
    for (RolloutBatch& batch : waiting) batch.wait = kRollout;
    auto replies_result = pool_.run_all(waiting, deadline, std::move(stop));
    if (!replies_result) return replies_result;
    for (std::size_t i = 0; i < batches.size(); ++i) {
      for (physics_pool::RolloutOutcome& outcome : (*replies_result)[i].outcomes) {
        outcome.trajectory.assign(static_cast<std::size_t>(batches[i].nominal.steps()) + 1, batches[i].x0);
        outcome.cost = 1e3;  // no plan is feasible, so that all iterations are made
      }
    }
    return replies_result;
  }

  physics_pool::PoolStatus status() const override { return pool_.status(); }

 private:
  physics_pool::Pool& pool_;
};

struct Shape {
  int starts = 4, worlds = 4, lanes = 64;

  int rollouts() const { return 4 * (starts * (worlds + 1) + 1); }
};

planners::PbstoOptions optimizer() {
  planners::PbstoOptions options{.rollouts = 4, .step_duration = 0.2};
  options.sigma.assign(7, 0.1);
  options.limit.assign(7, 1.0);
  options.freeze = true;
  return options;
}

planners::Problem problem_of(const physics_pool::Scene& scene, Hash world) {
  planners::Problem problem{.world = world, .x0 = initial_state(scene)};
  for (int t = 0; t < kSteps; ++t) problem.initial.append(std::vector(7, 0.0));
  problem.iterations = kIterations;
  problem.objective.success_cost = 0.0;
  return problem;
}

// What an iteration takes, the first candidate's evaluation not counted, ms.
Result<Sample> time_iteration(physics_pool::Pool& pool, const physics_pool::Scene& scene, const Shape& shape, int made,
                              std::stop_token stop) {
  const physics_pool::TaskGeometry geometry(scene);
  auto world_result = pool.load(scene);
  if (!world_result) return world_result.error();
  planners::Problem problem = problem_of(scene, *world_result);
  problem.iterations = made;
  std::vector<std::chrono::steady_clock::time_point> times;
  planners::RobustSto planner(pool, scene, geometry, optimizer(), {.starts = shape.starts, .worlds = shape.worlds},
                              [&](const planners::Progress&) { times.push_back(std::chrono::steady_clock::now()); });
  auto plan_result = planner.plan(problem, std::chrono::steady_clock::now() + kPatience, std::move(stop));
  if (!plan_result) return plan_result.error();
  const double seconds = std::chrono::duration<double>(times.back() - times.front()).count() / made;
  return Sample{.value = 1e3 * seconds, .hash = hash_of_states(plan_result->states)};
}

Result<void> measure(const Shape& shape, const physics_pool::Scene& scene, const Settings& settings) {
  physics_pool::ThreadPool threads(shape.lanes);
  Waiting pool(threads);
  Hash answer;
  auto result = compare({"iteration",
                         [&]() -> Result<Sample> {
                           auto sample = time_iteration(pool, scene, shape, kIterations, settings.stop);
                           if (sample) answer = sample->hash;
                           return sample;
                         }},
                        {"one rollout",
                         [&]() -> Result<Sample> {
                           std::this_thread::sleep_for(kRollout);
                           return Sample{.value = static_cast<double>(kRollout.count()), .hash = answer};
                         }},
                        settings.turns());
  if (!result) return result.error();
  result->name = fmt::format("robust-iteration/{}-on-{}", shape.rollouts(), shape.lanes);
  result->unit = "ms";
  // More rollouts than threads take a second round.
  const int rounds = (shape.rollouts() + shape.lanes - 1) / shape.lanes;
  result->aim = Aim{Aim::Kind::kAtMost, 1.2 * rounds};
  result->details = {{"rollouts", shape.rollouts()}, {"lanes", shape.lanes}, {"rounds", rounds}};
  settings.keep(*std::move(result));
  return {};
}

// The same with physics, on as many threads as there are cores.
Result<void> measure_physics(const physics_pool::Scene& scene, const Settings& settings) {
  const int cores = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u));
  physics_pool::ThreadPool pool(cores);
  const Shape all{.lanes = cores}, one{.starts = 0, .worlds = 0, .lanes = cores};
  Hash answer;
  auto result = compare({"iteration",
                         [&]() -> Result<Sample> {
                           auto sample = time_iteration(pool, scene, all, 1, settings.stop);
                           if (sample) answer = sample->hash;
                           return sample;
                         }},
                        {"iteration by J alone",
                         [&]() -> Result<Sample> {
                           auto sample = time_iteration(pool, scene, one, 1, settings.stop);
                           if (sample) sample->hash = answer;
                           return sample;
                         }},
                        settings.turns());
  if (!result) return result.error();
  result->name = fmt::format("robust-iteration/physics-on-{}", cores);
  result->unit = "ms";
  result->details = {{"rollouts", all.rollouts()}, {"lanes", cores}};
  settings.keep(*std::move(result));
  return {};
}

}  // namespace

Result<void> measure_robust_iteration(const Settings& settings) {
  constexpr Shape kShapes[]{{.lanes = 84}, {.lanes = 64}, {.starts = 2, .worlds = 6, .lanes = 64}};
  settings.announce(static_cast<int>(std::size(kShapes)) + 1);
  auto scene_result = physics_pool::generate_chapter4_arm({.seed = 1});
  if (!scene_result) return scene_result.error();
  for (const Shape& shape : kShapes) {
    if (auto ok = measure(shape, *scene_result, settings); !ok) return ok;
  }
  return measure_physics(*scene_result, settings);
}

}  // namespace jostle::studies
