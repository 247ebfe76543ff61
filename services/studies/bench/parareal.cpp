// Parareal: how cheap its coarse models are, and how much of Eq. 6.4 is left of it.

#include <fmt/format.h>

#include <array>
#include <map>
#include <mutex>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/levels.hpp"
#include "physics_pool/parareal/parareal_pool.hpp"
#include "services/common/process/files.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using namespace physics_pool;

constexpr double kDuration = 1.0;  // Delta_t, s
constexpr double kSpeed = 0.025;   // m/s

// The author's pusher against `sliders` of his cylinders, at the middle of the first: it
// stays in contact, so that all slices cost the same, as Eq. 6.4 assumes.
Scene sliders_in_a_row(int sliders, const std::string& integrator) {
  Scene scene;
  scene.name = "parareal benchmark";
  scene.surface = Surface::table(4.0, 4.0);
  scene.robot = pusher({.x = -0.066});
  for (int i = 0; i < sliders; ++i) {
    scene.objects.push_back({.name = fmt::format("slider{}", i),
                             .shape = Shape::kCylinder,
                             .radius = 0.05115,
                             .height = 0.0245,
                             .mass = 0.5,
                             .friction = 0.2,
                             .x = 0.105 * i,
                             .y = i % 2 ? 0.03 : 0.0});
  }
  scene.task = {.kind = "push", .target = "slider0"};
  scene.physics.time_step = 0.001;
  scene.physics.integrator = integrator;
  return scene;
}

RolloutBatch straight_push(const Scene& scene, int steps) {
  RolloutBatch batch;
  batch.world = scene_hash(scene);
  batch.x0 = initial_state(scene);
  batch.nominal.nu = 2;
  for (int t = 0; t < steps; ++t) batch.nominal.append(std::vector{kSpeed, 0.0});
  batch.u_before = {0.0, 0.0};
  batch.step_duration = kDuration;
  batch.law = {.sigma = {0.0, 0.0}, .limit = {1.0, 1.0}};
  batch.stop_losers = false;
  batch.want_all_trajectories = true;
  return batch;
}

// What both sides are asked; a coarse model's answer is another one.
Hash question(const RolloutBatch& batch) {
  std::vector<double> all = batch.x0.q;
  all.insert(all.end(), batch.nominal.values.begin(), batch.nominal.values.end());
  return hash_of(all);
}

Result<Measurement> measure_coarse(const std::string& model, int sliders, const std::string& integrator,
                                   const Settings& settings) {
  const Scene scene = sliders_in_a_row(sliders, integrator);
  const RolloutBatch batch = straight_push(scene, 1);
  auto coarse_result = make_coarse_model(common::coarse_model_name(model), scene);
  if (!coarse_result) return coarse_result.error();
  auto world_result = World::compile(scene);
  if (!world_result) return world_result.error();
  BareLoops loop(*world_result, 1);
  const auto states = [&](int count) {
    const PlanarLayout layout{sliders};
    std::vector<double> one(static_cast<std::size_t>(layout.size())), all;
    to_planar(layout_of(scene), batch.x0, one);
    for (int k = 0; k < count; ++k) all.insert(all.end(), one.begin(), one.end());
    return all;
  };
  constexpr int kRepeats = 500;
  const auto time_model = [&]() -> Result<Sample> {
    const std::vector<double> start = states(1);
    std::vector<double> x = start;
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < kRepeats; ++i) {
      x = start;
      (*coarse_result)->advance(x, batch.nominal.step(0), kDuration);
    }
    return Sample{.value = 1e6 * seconds_since(begin) / kRepeats, .hash = question(batch)};
  };
  const auto time_fine = [&]() -> Result<Sample> {
    const auto begin = std::chrono::steady_clock::now();
    loop.run(batch);
    return Sample{.value = 1e6 * seconds_since(begin), .hash = question(batch)};
  };
  auto result = compare({"fine model", time_fine}, {model, time_model}, settings.turns());
  if (!result) return result.error();
  result->name = fmt::format("coarse-models/{}/{}/{}", model, sliders, integrator);
  result->unit = "us per step of 1 s";
  result->aim = Aim{Aim::Kind::kAtLeast, 228.0};  // the thesis's figure
  constexpr int kBatch = 20;
  std::vector<double> many = states(kBatch), controls;
  for (int k = 0; k < kBatch; ++k) controls.insert(controls.end(), {kSpeed, 0.0});
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 50; ++i) {
    std::vector<double> x = many;
    (*coarse_result)->advance(x, controls, kDuration);
  }
  result->details = {{"us_per_state_in_batches_of_20", 1e6 * seconds_since(begin) / (50 * kBatch)}};
  return result;
}

/// What Eq. 6.4 is calculated from.
struct Costs {
  double coarse = 0.0, fine = 0.0;  // c_c and c_f, s
};

Result<Costs> measure_costs(Pool& pool, const Scene& scene, const RolloutBatch& batch, const std::string& model) {
  Costs costs;
  const RolloutBatch slice = slice_batch(batch, batch.x0, batch.nominal.step(0));
  std::vector<double> times;
  for (int i = 0; i < 5; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    auto reply_result = pool.run(slice, begin + kPatience);
    if (!reply_result) return reply_result.error();
    times.push_back(seconds_since(begin));
  }
  costs.fine = common::median(times);
  auto coarse_result = make_coarse_model(common::coarse_model_name(model), scene);
  if (!coarse_result) return coarse_result.error();
  std::vector<double> x(static_cast<std::size_t>((*coarse_result)->layout().size()));
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 100; ++i) {
    to_planar(layout_of(scene), batch.x0, x);
    (*coarse_result)->advance(x, batch.nominal.step(0), kDuration);
  }
  costs.coarse = seconds_since(begin) / 100;
  return costs;
}

Result<Sample> time_prediction(Pool& pool, const RolloutBatch& batch, std::stop_token stop) {
  const auto begin = std::chrono::steady_clock::now();
  auto reply_result = pool.run(batch, begin + kPatience, stop);
  if (!reply_result) return reply_result.error();
  return Sample{.value = 1e3 * seconds_since(begin), .hash = hash_of_last_states(*reply_result)};
}

// One trajectory on all processors against what Eq. 6.4 makes of the serial time.
Result<Measurement> measure_speed_up(int steps, int iterations, const Settings& settings) {
  const int threads = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u));
  const std::string model = "planar";
  const Scene scene = sliders_in_a_row(1, "rk4");
  const RolloutBatch batch = straight_push(scene, steps);
  ThreadPool one(1), many(threads);
  PararealPool alone(one, {.model = model, .stop = {.iterations = iterations}});
  PararealPool parareal(many, {.model = model, .stop = {.iterations = iterations}});
  for (Pool* pool : {static_cast<Pool*>(&alone), static_cast<Pool*>(&parareal)}) {
    if (auto ok = pool->load(scene); !ok) return ok.error();
  }
  auto costs_result = measure_costs(one, scene, batch, model);
  if (!costs_result) return costs_result.error();
  auto wanted_result = time_prediction(alone, batch, settings.stop);
  if (!wanted_result) return wanted_result.error();
  const double allowed = parareal_speed_up(iterations, threads, steps, costs_result->coarse, costs_result->fine);

  std::vector<double> serial;
  auto result = compare(
      {fmt::format("serial fine / {:.2f} (Eq. 6.4)", allowed),
       [&]() -> Result<Sample> {
         auto sample_result = time_prediction(one, batch, settings.stop);
         if (!sample_result) return sample_result;
         serial.push_back(sample_result->value);
         return Sample{.value = sample_result->value / allowed, .hash = wanted_result->hash};
       }},
      {fmt::format("Parareal, {} threads", threads), [&] { return time_prediction(parareal, batch, settings.stop); }},
      settings.turns());
  if (!result) return result.error();
  result->name = fmt::format("parareal/N={}/K={}", steps, iterations);
  result->unit = "ms";
  result->aim = Aim{Aim::Kind::kAtLeast, 0.9};
  result->details = {{"threads", threads},
                     {"speed_up", common::median(serial) / common::median(result->b)},
                     {"speed_up_by_eq_6_4", allowed},
                     {"c_c_us", 1e6 * costs_result->coarse},
                     {"c_f_ms", 1e3 * costs_result->fine}};
  return result;
}

/// Answers slices from memory, after as long a wait as the slice took, on real workers.
class WaitingPool final : public AsyncPool {
 public:
  WaitingPool(AsyncPool& workers, AsyncPool& engine) : workers_(workers), engine_(engine) {}

  /// Until then slices are simulated, and remembered.
  void wait_instead(std::chrono::nanoseconds time) { wait_ = time; }

  Result<Hash> load(const Scene& scene) override {
    if (auto ok = engine_.load(scene); !ok) return ok;
    return workers_.load(scene);
  }
  PoolStatus status() const override { return workers_.status(); }

  Result<std::unique_ptr<Ticket>> submit(const RolloutBatch& batch, OnReply on_reply) override {
    std::vector<double> key = batch.x0.q;
    key.insert(key.end(), batch.x0.v.begin(), batch.x0.v.end());
    key.insert(key.end(), batch.nominal.values.begin(), batch.nominal.values.end());
    const Hash hash = hash_of(key);
    if (!wait_) {
      return engine_.submit(batch, [this, hash, reply = std::move(on_reply)](Result<BatchReply> result) {
        if (result) {
          const std::lock_guard lock(mutex_);
          known_[hash] = *result;
        }
        reply(std::move(result));
      });
    }
    RolloutBatch waiting = batch;
    waiting.wait = wait_;
    return workers_.submit(waiting, [this, hash, reply = std::move(on_reply)](Result<BatchReply> result) {
      if (!result) return reply(std::move(result));
      const std::lock_guard lock(mutex_);
      reply(known_.at(hash));
    });
  }

 private:
  AsyncPool& workers_;
  AsyncPool& engine_;
  std::optional<std::chrono::nanoseconds> wait_;
  std::mutex mutex_;  // guards known_
  std::map<Hash, BatchReply> known_;
};

// N slices on N workers that wait for as long as a slice was measured to take.
Result<Measurement> measure_waiting(int steps, int iterations, const Settings& settings) {
  const std::string model = "planar";
  const Scene scene = sliders_in_a_row(1, "rk4");
  const RolloutBatch batch = straight_push(scene, steps);
  auto swarm_result = Swarm::start({.workers = steps, .domain = settings.domain, .stop = settings.stop});
  if (!swarm_result) return swarm_result.error();
  ThreadPool engine(2);
  WaitingPool waiting((*swarm_result)->pool(), engine);
  PararealPool parareal(waiting, {.model = model, .stop = {.iterations = iterations}});
  if (auto ok = parareal.load(scene); !ok) return ok.error();
  auto costs_result = measure_costs(engine, scene, batch, model);
  if (!costs_result) return costs_result.error();
  auto known_result = time_prediction(parareal, batch, settings.stop);  // simulates, and remembers
  if (!known_result) return known_result.error();
  waiting.wait_instead(std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * costs_result->fine)));
  const double allowed = parareal_speed_up(iterations, steps, steps, costs_result->coarse, costs_result->fine);
  const double expected = 1e3 * steps * costs_result->fine / allowed;

  auto result =
      compare({"Eq. 6.4", [&]() -> Result<Sample> { return Sample{.value = expected, .hash = known_result->hash}; }},
              {fmt::format("Parareal, {} waiting workers", steps),
               [&] { return time_prediction(parareal, batch, settings.stop); }},
              (*swarm_result)->turns(settings.turns()));
  if (!result) return result.error();
  result->name = fmt::format("parareal-scheduling/N={}/K={}", steps, iterations);
  result->unit = "ms";
  result->aim = Aim{Aim::Kind::kAtLeast, 0.95};
  result->details = {{"speed_up", 1e3 * steps * costs_result->fine / common::median(result->b)},
                     {"speed_up_by_eq_6_4", allowed},
                     {"c_c_us", 1e6 * costs_result->coarse},
                     {"c_f_ms", 1e3 * costs_result->fine}};
  return result;
}

}  // namespace

Result<void> measure_coarse_models(const Settings& settings) {
  constexpr std::array kModels{"kinematic", "limit-surface", "planar", "learned"};
  constexpr std::array kSliders{1, 4};
  constexpr std::array kIntegrators{"rk4", "euler"};
  settings.announce(static_cast<int>(kModels.size() * kSliders.size() * kIntegrators.size()));
  for (const char* model : kModels) {
    for (const int sliders : kSliders) {
      for (const char* integrator : kIntegrators) {
        auto result = measure_coarse(model, sliders, integrator, settings);
        if (!result) return result.error();
        settings.keep(*std::move(result));
      }
    }
  }
  return {};
}

Result<void> measure_parareal(const Settings& settings) {
  settings.announce(2);
  for (const int steps : {4, 8}) {
    auto result = measure_speed_up(steps, 1, settings);
    if (!result) return result.error();
    settings.keep(*std::move(result));
  }
  return {};
}

Result<void> measure_parareal_scheduling(const Settings& settings) {
  settings.announce(8);
  for (const int iterations : {1, 2}) {
    for (const int steps : {4, 8, 16, 32}) {
      auto result = measure_waiting(steps, iterations, settings);
      if (!result) return result.error();
      settings.keep(*std::move(result));
    }
  }
  return {};
}

}  // namespace jostle::studies
