#include "services/studies/bench/cheap_physics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <thread>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::studies {
namespace {

using common::number_or_null;
using physics_pool::End;
using physics_pool::Fidelity;
using physics_pool::Pool;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;
using physics_pool::Scene;
using planners::PbstoOptions;
using planners::Plan;
using std::chrono::steady_clock;

constexpr double kMoved = 0.001;  // m; less is the engine settling
constexpr std::chrono::hours kPatience{1};
constexpr int kDemoObjects = 15;
constexpr double kPeerWork = 5;  // of a peer's search, beside the others

// What a search among so many objects takes, roughly, for the time that is left.
double work_of(int objects) { return std::pow(objects, 1.5); }

// A world and what a planner needs to begin.
struct Task {
  Scene scene;
  physics_pool::WorldPtr world;
  Hash hash;
  std::uint64_t seed = 0;

  // As a controller's first one: what lodges in the hand does not count yet.
  planners::Problem problem(const CheapPhysicsOptions& study, int iterations) const {
    const State x0 = physics_pool::initial_state(scene);
    planners::Problem problem{.world = hash,
                              .x0 = x0,
                              .initial = planners::straight_line(world->geometry(), x0, study.control.initial_steps,
                                                                 study.control.step_duration),
                              .iterations = iterations,
                              .seed = seed,
                              .objective = study.objective};
    problem.objective["obstruction"].weight = 0.0;
    return problem;
  }
};

Result<Task> task_of(Pool& pool, Scene scene, std::uint64_t seed) {
  auto world_result = physics_pool::World::compile(scene);
  if (!world_result) return world_result.error();
  auto hash_result = pool.load(scene);
  if (!hash_result) return hash_result.error();
  return Task{.scene = std::move(scene), .world = *world_result, .hash = *hash_result, .seed = seed};
}

Result<Task> generated(Pool& pool, int objects, std::uint64_t seed) {
  auto scene_result = physics_pool::generate_chapter3({.objects = objects, .seed = seed});
  if (!scene_result) return scene_result.error();
  return task_of(pool, std::move(scene_result).value(), seed);
}

struct TimedPlan {
  Plan plan;
  double seconds = 0.0;
};

Result<TimedPlan> timed_plan(Pool& pool, const PbstoOptions& options, const planners::Problem& problem,
                             std::stop_token stop) {
  planners::Pbsto planner(pool, options);
  const auto start = steady_clock::now();
  auto plan_result = planner.plan(problem, start + kPatience, stop);
  const std::chrono::duration<double> took = steady_clock::now() - start;
  if (!plan_result) return plan_result.error();
  return TimedPlan{.plan = std::move(plan_result).value(), .seconds = took.count()};
}

// Candidates per second of a planner that is never content. A candidate that is
// screened and run again counts once. Losers run to their ends: how many stop early
// depends on how good the straight line is, not on what a rollout costs.
Result<double> speed(Pool& pool, const Task& task, PbstoOptions options, const CheapPhysicsOptions& study,
                     std::stop_token stop) {
  options.min_steps = physics_pool::kMaxSteps;
  options.stop_losers = false;
  planners::Problem problem = task.problem(study, study.iterations);
  problem.objective.success_cost = 0.0;
  auto timed_result = timed_plan(pool, options, problem, stop);
  if (!timed_result) return timed_result.error();
  const int candidates = timed_result->plan.iterations * options.rollouts * options.screening;
  return candidates / timed_result->seconds;
}

// Fidelity at which candidates are ranked first, and at which the plan is chosen.
Fidelity first_rank(const PbstoOptions& options) {
  return {.freeze = options.freeze, .time_step = options.screening > 1 ? options.screening_time_step : 0.0};
}
Fidelity last_choice(const PbstoOptions& options) { return {.freeze = options.freeze}; }

// Noisy samples of the straight line, all to their ends.
Result<std::vector<RolloutOutcome>> samples(Pool& pool, const Task& task, const CheapPhysicsOptions& study,
                                            const Fidelity& fidelity, std::stop_token stop) {
  const PbstoOptions& options = study.levers.front().options;
  const planners::Problem problem = task.problem(study, 0);
  RolloutBatch batch{
      .world = task.hash,
      .x0 = problem.x0,
      .nominal = problem.initial,
      .u_before = std::vector<double>(options.sigma.size(), 0.0),
      .step_duration = options.step_duration,
      .law = {.sigma = options.sigma, .limit = options.limit, .scales = options.scales, .seed = task.seed},
      .samples = study.samples,
      .objective = study.objective,
      .stop_losers = false,
      .want_all_trajectories = true,
      .fidelity = fidelity};
  auto reply_result = pool.run(batch, steady_clock::now() + kPatience, stop);
  if (!reply_result) return reply_result.error();
  return std::move(reply_result->outcomes);
}

double way(const StateLayout& layout, const State& a, const State& b, std::size_t object) {
  const auto q = static_cast<std::size_t>(layout.objects[object].q);
  return std::hypot(a.q[q] - b.q[q], a.q[q + 1] - b.q[q + 1], a.q[q + 2] - b.q[q + 2]);
}

// How far objects that full physics moved end from where it left them.
void add_pose_errors(const StateLayout& layout, const std::vector<RolloutOutcome>& full,
                     const std::vector<RolloutOutcome>& cheap, std::vector<double>& errors) {
  for (std::size_t k = 0; k < full.size(); ++k) {
    if (full[k].end != End::kCompleted || cheap[k].end != End::kCompleted) continue;
    const State &start = full[k].trajectory.front(), &end = full[k].trajectory.back();
    for (std::size_t i = 0; i < layout.objects.size(); ++i) {
      if (way(layout, start, end, i) < kMoved) continue;
      errors.push_back(way(layout, end, cheap[k].trajectory.back(), i));
    }
  }
}

double correlation(const std::vector<RolloutOutcome>& a, const std::vector<RolloutOutcome>& b) {
  std::vector<double> costs_a, costs_b;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (a[k].end != End::kCompleted || b[k].end != End::kCompleted) continue;
    costs_a.push_back(a[k].cost);
    costs_b.push_back(b[k].cost);
  }
  return rank_correlation(costs_a, costs_b);
}

// Whether the plan, executed without looking, brings the full world's target into
// the hand and drops nothing.
bool succeeds(const Task& task, const Plan& plan, const CheapPhysicsOptions& study) {
  physics_pool::ExecutionWorld world(task.world);
  const long steps = std::lround(study.control.step_duration / task.world->time_step());
  for (int t = 0; t < plan.controls.steps(); ++t) {
    world.begin(plan.controls.step(t));
    for (long i = 0; i < steps; ++i) {
      if (!world.step()) return false;
    }
  }
  const physics_pool::TaskGeometry& geometry = task.world->geometry();
  return physics_pool::at_goal(geometry, world.state(), study.objective) &&
         physics_pool::count_dropped(geometry, world.state(), study.objective.value("drop", "height")) == 0;
}

// Results by lever and size, made when first asked for.
class Results {
 public:
  explicit Results(const std::vector<Lever>& levers) : levers_(levers) {}

  LeverResult& of(std::size_t lever, int objects) {
    const auto [entry, is_new] = results_.try_emplace({lever, objects});
    if (is_new) entry->second = {.name = levers_[lever].name, .objects = objects};
    return entry->second;
  }

  std::vector<LeverResult> all() const {
    std::vector<LeverResult> list;
    for (const auto& [key, result] : results_) list.push_back(result);
    return list;
  }

 private:
  const std::vector<Lever>& levers_;
  std::map<std::pair<std::size_t, int>, LeverResult> results_;
};

class Study {
 public:
  Study(Pool& pool, const CheapPhysicsOptions& options, std::stop_token stop)
      : pool_(pool), options_(options), stop_(std::move(stop)), results_(options.levers) {}

  Result<CheapPhysics> run() {
    announce();
    const auto measured = measure_all();
    if (!measured && !stop_.stop_requested()) return measured.error();
    return CheapPhysics{.levers = results_.all(), .demo = std::move(demo_), .complete = measured.has_value()};
  }

 private:
  bool wants(const char* part) const { return std::ranges::find(options_.parts, part) != options_.parts.end(); }

  int executed_worlds(int objects) const {
    return objects == options_.executed_objects ? options_.executed_worlds : options_.worlds;
  }

  void announce() const {
    if (!options_.line) return;
    const std::size_t levers = options_.levers.size();
    for (const int objects : options_.sizes) {
      const auto expect = [&](const char* part, std::size_t steps) {
        if (wants(part)) options_.line->expect(steps * levers, work_of(objects));
      };
      const auto worlds = static_cast<std::size_t>(options_.worlds);
      expect("speed", worlds * static_cast<std::size_t>(options_.repeats));
      expect("truth", worlds);
      expect("success", static_cast<std::size_t>(executed_worlds(objects)));
    }
    if (wants("demo")) {
      options_.line->expect(options_.demo.size() * static_cast<std::size_t>(options_.demo_seeds) * levers,
                            work_of(kDemoObjects));
    }
  }

  void step(int objects) const {
    if (options_.line) options_.line->step("", work_of(objects));
  }

  template <class... T>
  void tell(fmt::format_string<T...> format, T&&... values) const {
    if (options_.line) options_.line->news(fmt::format(format, std::forward<T>(values)...));
  }

  Result<void> measure_all() {
    for (const int objects : options_.sizes) {
      const int executed = executed_worlds(objects);
      for (int seed = 1; seed <= std::max(options_.worlds, executed); ++seed) {
        auto task_result = generated(pool_, objects, static_cast<std::uint64_t>(seed));
        if (!task_result) return task_result.error();
        if (seed <= options_.worlds && wants("speed")) {
          if (auto ok = measure_speed(*task_result, objects); !ok) return ok;
        }
        if (seed <= options_.worlds && wants("truth")) {
          if (auto ok = measure_truth(*task_result, objects); !ok) return ok;
        }
        if (seed > executed || !wants("success")) continue;
        if (auto ok = measure_success(*task_result, objects); !ok) return ok;
      }
    }
    for (const Scene& scene : wants("demo") ? options_.demo : std::vector<Scene>{}) {
      if (auto ok = measure_demo(scene); !ok) return ok;
    }
    return {};
  }

  Result<void> measure_speed(const Task& task, int objects) {
    for (const Lever& lever : options_.levers) {
      if (auto ok = warm_up(task, lever.options); !ok) return ok;
    }
    for (int repeat = 0; repeat < options_.repeats; ++repeat) {
      double plain = 0.0;
      for (std::size_t i = 0; i < options_.levers.size(); ++i) {
        auto speed_result = speed(pool_, task, options_.levers[i].options, options_, stop_);
        if (!speed_result) return speed_result.error();
        if (i == 0) plain = *speed_result;
        results_.of(i, objects).ratios.push_back(*speed_result / plain);
        step(objects);
      }
      tell("{} objects, world {}: {:.1f} candidates/s with full physics", objects, task.seed, plain);
    }
    return {};
  }

  // What the first rollouts in a world pay for once, nobody should: each thread gets one, or a few where they are
  // screened.
  Result<void> warm_up(const Task& task, PbstoOptions brief) {
    brief.rollouts = static_cast<int>(pool_.status().workers.size());
    CheapPhysicsOptions once = options_;
    once.iterations = 1;
    auto speed_result = speed(pool_, task, brief, once, stop_);
    if (!speed_result) return speed_result.error();
    return {};
  }

  Result<void> measure_truth(const Task& task, int objects) {
    auto full_result = samples(pool_, task, options_, {}, stop_);
    if (!full_result) return full_result.error();
    for (std::size_t i = 0; i < options_.levers.size(); ++i) {
      const PbstoOptions& lever = options_.levers[i].options;
      auto ranked_result = samples(pool_, task, options_, first_rank(lever), stop_);
      if (!ranked_result) return ranked_result.error();
      auto chosen_result = samples(pool_, task, options_, last_choice(lever), stop_);
      if (!chosen_result) return chosen_result.error();
      LeverResult& result = results_.of(i, objects);
      const double rank = correlation(*full_result, *ranked_result);
      if (std::isfinite(rank)) result.correlations.push_back(rank);
      add_pose_errors(task.world->geometry().layout, *full_result, *chosen_result, result.pose_errors);
      step(objects);
    }
    return {};
  }

  Result<void> measure_success(const Task& task, int objects) {
    const int most = objects > options_.executed_objects ? options_.large_iterations : options_.control.many_iterations;
    std::optional<TimedPlan> first;
    std::string line;
    for (std::size_t i = 0; i < options_.levers.size(); ++i) {
      const PbstoOptions& lever = options_.levers[i].options;
      auto timed_result = timed_plan(pool_, lever, task.problem(options_, most), stop_);
      if (!timed_result) return timed_result.error();
      const Plan& plan = timed_result->plan;
      if (!first) first = *timed_result;
      LeverResult& result = results_.of(i, objects);
      const bool executed = plan.at_goal && succeeds(task, plan, options_);
      ++result.worlds;
      result.planned += plan.at_goal ? 1 : 0;
      result.executed += executed ? 1 : 0;
      result.denials += plan.denials;
      result.same_plans += plan.controls == first->plan.controls ? 1 : 0;
      if (plan.at_goal && first->plan.at_goal) result.time_ratios.push_back(first->seconds / timed_result->seconds);
      line += fmt::format("  {} {} {:.1f} s", options_.levers[i].name,
                          executed       ? "grasps"
                          : plan.at_goal ? "misses"
                                         : "no plan",
                          timed_result->seconds);
      step(objects);
    }
    tell("{} objects, world {}:{}", objects, task.seed, line);
    return {};
  }

  Result<void> measure_demo(const Scene& scene) {
    for (int seed = 1; seed <= options_.demo_seeds; ++seed) {
      auto task_result = task_of(pool_, scene, static_cast<std::uint64_t>(seed));
      if (!task_result) return task_result.error();
      for (const Lever& lever : options_.levers) {
        auto timed_result =
            timed_plan(pool_, lever.options, task_result->problem(options_, options_.control.many_iterations), stop_);
        if (!timed_result) return timed_result.error();
        demo_.push_back({.lever = lever.name,
                         .seed = task_result->seed,
                         .planned = timed_result->plan.at_goal,
                         .seconds = timed_result->seconds});
        step(kDemoObjects);
      }
      tell("demo, seed {}", seed);
    }
    return {};
  }

  Pool& pool_;
  const CheapPhysicsOptions& options_;
  const std::stop_token stop_;
  Results results_;
  std::vector<DemoPlan> demo_;
};

// Rank of every value, 1 for the smallest, ties at their mean.
std::vector<double> ranks(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> result(values.size());
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    while (end < order.size() && values[order[end]] == values[order[begin]]) ++end;
    const double rank = static_cast<double>(begin + end + 1) / 2;
    for (std::size_t i = begin; i < end; ++i) result[order[i]] = rank;
  }
  return result;
}

// Seconds that a lever took, by seed; a search that found nothing counts with its time.
std::vector<double> demo_seconds(const CheapPhysics& results, const std::string& lever) {
  std::vector<double> seconds;
  for (const DemoPlan& plan : results.demo) {
    if (plan.lever == lever) seconds.push_back(plan.seconds);
  }
  return seconds;
}

}  // namespace

std::vector<Lever> usual_levers(const PbstoOptions& shipped) {
  PbstoOptions plain = shipped;
  plain.rollouts = PbstoOptions{}.rollouts;
  plain.screening = 1;
  plain.freeze = plain.stop_hopeless = false;
  PbstoOptions freeze = plain, screening = shipped, hopeless = plain;
  freeze.freeze = hopeless.stop_hopeless = true;
  screening.freeze = screening.stop_hopeless = false;
  return {{"plain", plain}, {"freeze", freeze}, {"screening", screening}, {"hopeless", hopeless}, {"all", shipped}};
}

double rank_correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const std::vector<double> x = ranks(a), y = ranks(b);
  const double mean = (static_cast<double>(x.size()) + 1) / 2;
  double xy = 0.0, xx = 0.0, yy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean) * (y[i] - mean);
    xx += (x[i] - mean) * (x[i] - mean);
    yy += (y[i] - mean) * (y[i] - mean);
  }
  return xx > 0 && yy > 0 ? xy / std::sqrt(xx * yy) : std::nan("");
}

Result<CheapPhysics> measure_cheap_physics(Pool& pool, const CheapPhysicsOptions& options, std::stop_token stop) {
  return Study(pool, options, std::move(stop)).run();
}

std::string to_text(const CheapPhysics& results) {
  std::vector<std::vector<std::string>> speed{
      {"lever", "objects", "candidates/s, ratio", "rank", "pose error, mm: median, 90 %"}};
  std::vector<std::vector<std::string>> success{
      {"lever", "objects", "grasps", "95 % interval", "time to plan", "denied", "same plan"}};
  for (const LeverResult& r : results.levers) {
    const common::Interval interval = common::median_interval(r.ratios);
    std::string ratio = common::number_text(common::median(r.ratios), 2);
    if (r.ratios.size() > 1) ratio += fmt::format(" ({:.2f} .. {:.2f})", interval.low, interval.high);
    if (!r.ratios.empty() || !r.correlations.empty() || !r.pose_errors.empty()) {
      speed.push_back({r.name, std::to_string(r.objects), ratio, common::number_text(common::median(r.correlations), 2),
                       r.pose_errors.empty() ? "-"
                                             : fmt::format("{:.2f}, {:.1f}", 1e3 * common::median(r.pose_errors),
                                                           1e3 * common::quantile(r.pose_errors, 0.9))});
    }
    if (r.worlds == 0) continue;
    const common::Share share = common::wilson_interval(r.executed, r.worlds);
    const double time = common::median(r.time_ratios);
    success.push_back({r.name, std::to_string(r.objects), fmt::format("{}/{}", r.executed, r.worlds),
                       common::interval_text(share.low, share.high),
                       std::isfinite(time) ? fmt::format("{:.2f} x faster", time) : "-", std::to_string(r.denials),
                       fmt::format("{}/{}", r.same_plans, r.worlds)});
  }
  std::string text;
  if (speed.size() > 1) {
    text +=
        common::table(speed) +
        "Ratios are to the first lever. Rank: correlation of costs with full physics. Pose error: where objects end\n"
        "that full physics moved.\n";
  }
  if (success.size() > 1) {
    text +=
        (text.empty() ? "" : "\n") + common::table(success) +
        "Grasps: plans that work with full physics. Denied: successes that it did not confirm. Time to plan: median\n"
        "over the worlds in which both planned, against the first lever.\n";
  }
  for (const LeverResult& r : results.levers) {
    const std::vector<double> seconds = demo_seconds(results, r.name);
    if (r.objects == results.levers.front().objects && !seconds.empty()) {
      const auto planned = std::ranges::count_if(
          results.demo, [&](const DemoPlan& plan) { return plan.lever == r.name && plan.planned; });
      text += fmt::format("demo, {:<10} median {:.2f} s of {} seeds, {} of which found a plan; {:.2f} s with seed 1\n",
                          r.name, common::median(seconds), seconds.size(), planned, seconds.front());
    }
  }
  return text;
}

nlohmann::json to_json(const CheapPhysics& results) {
  nlohmann::json json{{"levers", nlohmann::json::array()}, {"demo", nlohmann::json::array()}};
  for (const LeverResult& r : results.levers) {
    const common::Share share = common::wilson_interval(r.executed, r.worlds);
    const common::Interval interval = common::median_interval(r.ratios);
    json["levers"].push_back(
        {{"name", r.name},
         {"objects", r.objects},
         {"candidates_ratio", number_or_null(common::median(r.ratios))},
         {"candidates_ratio_interval", {number_or_null(interval.low), number_or_null(interval.high)}},
         {"candidates_ratios", r.ratios},
         {"rank_correlation", number_or_null(common::median(r.correlations))},
         {"pose_error_median", number_or_null(common::median(r.pose_errors))},
         {"pose_error_90", number_or_null(common::quantile(r.pose_errors, 0.9))},
         {"poses", r.pose_errors.size()},
         {"success_rate", r.worlds ? nlohmann::json(double(r.executed) / r.worlds) : nlohmann::json()},
         {"success_interval", {number_or_null(share.low), number_or_null(share.high)}},
         {"planned", r.planned},
         {"executed", r.executed},
         {"worlds", r.worlds},
         {"plan_time_ratio", number_or_null(common::median(r.time_ratios))},
         {"plan_time_ratios", r.time_ratios},
         {"denials", r.denials},
         {"same_plans", r.same_plans}});
  }
  for (const DemoPlan& plan : results.demo) {
    json["demo"].push_back(
        {{"lever", plan.lever}, {"seed", plan.seed}, {"planned", plan.planned}, {"plan_seconds", plan.seconds}});
  }
  return json;
}

namespace {

// After a stop request it has the curves that were finished.
Result<std::vector<Curve>> compare_peers(Pool& pool, const PbstoOptions& shipped, const CheapPhysicsOptions& options,
                                         std::stop_token stop) {
  std::vector<Scene> scenes;
  for (const int objects : options.sizes) {
    for (int seed = 1; seed <= options.worlds; ++seed) {
      auto scene_result =
          physics_pool::generate_chapter3({.objects = objects, .seed = static_cast<std::uint64_t>(seed)});
      if (!scene_result) return scene_result.error();
      scenes.push_back(std::move(scene_result).value());
    }
  }
  const ConvergenceOptions convergence{.rollouts = options.peer_rollouts,
                                       .steps = options.control.initial_steps,
                                       .step_duration = shipped.step_duration,
                                       .fidelity = last_choice(shipped),
                                       .objective = options.objective};
  const auto work = [&](std::size_t objects) { return kPeerWork * work_of(static_cast<int>(objects)); };
  for (const Scene& scene : scenes) {
    if (options.line) options.line->expect(convergence.contenders.size(), work(scene.objects.size()));
  }
  std::vector<Curve> finished;
  const auto keep = [&](const Curve& curve, std::size_t, std::size_t) {
    const auto scene = std::ranges::find(scenes, curve.world, &Scene::name);
    finished.push_back(curve);
    if (options.line)
      options.line->step(fmt::format("{} in {}", curve.method, curve.world), work(scene->objects.size()));
  };
  auto curves_result = measure_convergence(pool, scenes, convergence, keep, stop);
  if (!curves_result && !stop.stop_requested()) return curves_result.error();
  return finished;
}

}  // namespace

Result<void> bench_cheap_physics(CheapPhysicsOptions options, const CheapPhysicsFiles& files,
                                 const std::filesystem::path& parameters, std::stop_token stop) {
  auto parameters_result = task::load_parameters(parameters);
  if (!parameters_result) return parameters_result.error();
  auto demo_result = physics_pool::load_scene(common::data_file("scenes/clutter.yaml"));
  if (!demo_result) return demo_result.error();
  const PbstoOptions& shipped = parameters_result->planner;
  options.levers = usual_levers(shipped);
  options.control = parameters_result->controller.control;
  options.objective = parameters_result->objective;
  options.demo = {*demo_result};
  physics_pool::ThreadPool pool(static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u)));
  auto results = measure_cheap_physics(pool, options, stop);
  if (!results) return results.error();
  const bool wants_peers = results->complete && std::ranges::find(options.parts, "peers") != options.parts.end();
  nlohmann::json json = to_json(*results);
  const auto save = [&] { return files.json.empty() ? Result<void>{} : common::write_results(files.json, json); };
  if (wants_peers) {
    if (auto ok = save(); !ok) return ok;  // before the peers: half of an hour is worth keeping
    auto curves_result = compare_peers(pool, shipped, options, stop);
    if (!curves_result) return curves_result.error();
    json["peers"] = to_json(*curves_result)["curves"];
    if (!files.plot.empty() && !curves_result->empty()) {
      if (auto ok = plot_convergence(*curves_result, files.plot); !ok) return ok;
    }
  }
  if (options.line) options.line->end();
  if (stop.stop_requested()) fmt::print("Partial: interrupted.\n");
  fmt::print("{}", to_text(*results));
  if (stop.stop_requested()) json["partial"] = true;
  if (auto ok = save(); !ok) return ok;
  return stop.stop_requested() ? Result<void>(Error{Code::kCancelled, "interrupted"}) : Result<void>();
}

}  // namespace jostle::studies
