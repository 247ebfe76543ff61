#include "services/studies/bench/pool_timeline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>

#include "services/common/charts/lanes.hpp"
#include "services/common/process/cores.hpp"
#include "services/common/results/results.hpp"
#include "services/pool/client/timeline.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using physics_pool::RolloutBatch;

constexpr std::uint32_t kSamplesPerWorker = 12;  // of a batch of long samples
constexpr int kObjects = 5;
constexpr double kStep = 0.5;             // s
constexpr int kLongest = 4;               // steps
constexpr std::size_t kBatchesNamed = 7;  // as many as there are colours

double milliseconds(double seconds) { return 1e3 * seconds; }

// What comes back, from all pools' threads.
class Recorder {
 public:
  void add(const pool::SampleTrace& trace) {
    const std::lock_guard lock(mutex_);
    traces_.push_back(trace);
  }
  // The traces of samples sent from `then` on: a copy may come back after its batch is over.
  std::vector<pool::SampleTrace> since(std::chrono::steady_clock::time_point then) const {
    const std::lock_guard lock(mutex_);
    std::vector<pool::SampleTrace> traces = traces_;
    std::erase_if(traces, [&](const pool::SampleTrace& trace) {
      return trace.sent < std::chrono::duration<double>(then.time_since_epoch()).count();
    });
    return traces;
  }

 private:
  mutable std::mutex mutex_;  // guards traces_
  std::vector<pool::SampleTrace> traces_;
};

// One after the first: a participant of its own makes it another client.
struct Client {
  Client(const wire::Participant& participant, const pool::RemotePoolOptions& options) : pool(participant, options) {}
  pool::RemotePool pool;
};

// A client's batches: the second one's samples are half as long and twice as many, and so on.
RolloutBatch batch_of(int client, const physics_pool::Scene& scene, int workers) {
  const int steps = std::max(kLongest >> client, 1);
  return push(scene, steps, kStep, kSamplesPerWorker * static_cast<std::uint32_t>(workers * kLongest / steps));
}

Result<void> run_batches(pool::RemotePool& pool, const RolloutBatch& batch, int count,
                         const PoolTimelineOptions& options) {
  for (int i = 0; i < count; ++i) {
    auto reply_result = pool.run(batch, std::chrono::steady_clock::now() + kPatience, options.stop);
    if (!reply_result) return reply_result.error();
    options.line->step();
  }
  return {};
}

// All clients at once.
Result<void> run_all(const std::vector<pool::RemotePool*>& pools, const std::vector<RolloutBatch>& batches, int count,
                     const PoolTimelineOptions& options) {
  std::vector<std::future<Result<void>>> runs;
  for (std::size_t i = 0; i < pools.size(); ++i) {
    runs.push_back(
        std::async(std::launch::async, [&, i] { return run_batches(*pools[i], batches[i], count, options); }));
  }
  Result<void> result;
  for (auto& run : runs) {
    if (auto ok = run.get(); !ok) result = ok;
  }
  return result;
}

// Which colour a bar has, and what the colours are: batches of one client, or clients.
struct Legend {
  std::vector<std::string> series;
  std::map<std::pair<std::uint64_t, std::uint64_t>, int> of;  // by client and epoch
};

Legend legend_of(const pool::Timeline& timeline, const std::vector<std::uint64_t>& clients,
                 const std::vector<RolloutBatch>& batches) {
  Legend legend;
  for (const pool::Timeline::Bar& bar : timeline.bars) legend.of[{bar.client, bar.epoch}] = 0;
  if (clients.size() > 1) {
    for (std::size_t i = 0; i < clients.size(); ++i) {
      const RolloutBatch& batch = batches[i];
      legend.series.push_back(fmt::format("client {}{}, {:g} s of physics", i + 1,
                                          batch.priority == physics_pool::Priority::kUrgent ? ", urgent" : "",
                                          batch.nominal.steps() * batch.step_duration));
    }
    for (auto& [id, series] : legend.of)
      series = static_cast<int>(std::ranges::find(clients, id.first) - clients.begin());
    return legend;
  }
  std::size_t batch = 0;
  for (auto& [id, series] : legend.of) {
    series = static_cast<int>(batch % kBatchesNamed);
    if (batch < kBatchesNamed)
      legend.series.push_back(fmt::format("batch {}", batch + 1));
    else if (batch < 2 * kBatchesNamed)
      legend.series[batch % kBatchesNamed] += fmt::format(", {} …", batch + 1);
    ++batch;
  }
  return legend;
}

std::string headline(const pool::Timeline& timeline, const PoolTimelineOptions& options) {
  return fmt::format("{} worker{}{}, {} client{}, {} batch{}{}: busy {:.1f} % of {:.0f} ms", options.workers,
                     options.workers == 1 ? "" : "s", options.cores.empty() ? "" : " pinned", options.clients,
                     options.clients == 1 ? "" : "s", options.batches, options.batches == 1 ? "" : "es",
                     options.clients == 1 ? "" : " each", 100 * timeline.efficiency, milliseconds(timeline.length));
}

common::LaneChart chart_of(const pool::Timeline& timeline, const Legend& legend, const std::string& title) {
  common::LaneChart chart{.title = title,
                          .x_label = "ms since the first assignment was sent",
                          .series = legend.series,
                          .length = milliseconds(timeline.length)};
  const bool threads =
      std::ranges::any_of(timeline.rows, [](const pool::Timeline::Row& row) { return row.thread > 0; });
  for (const pool::Timeline::Row& row : timeline.rows) {
    chart.lanes.push_back(threads ? fmt::format("{}/{}", row.worker, row.thread) : row.worker);
  }
  for (const pool::Timeline::Bar& bar : timeline.bars) {
    chart.bars.push_back({.lane = bar.row,
                          .series = legend.of.at({bar.client, bar.epoch}),
                          .from = milliseconds(bar.from),
                          .to = milliseconds(bar.to),
                          .hatched = !bar.first});
    if (!bar.first) chart.hatched = "copy, dropped";
  }
  return chart;
}

void print(const pool::Timeline& timeline, const std::string& title) {
  fmt::print("{}\n  {:<16} {:>8} {:>8} {:>7} {:>12}\n", title, "worker", "busy", "samples", "copies", "longest gap");
  for (const pool::Timeline::Row& row : timeline.rows) {
    fmt::print("  {:<16} {:>6.1f} % {:>8} {:>7} {:>9.1f} ms\n", fmt::format("{}/{}", row.worker, row.thread),
               100 * row.busy / timeline.length, row.samples, row.copies, milliseconds(row.longest_gap));
  }
  fmt::print(
      "  a sample is on the way for {:.2f} ms and in line at its worker for {:.2f} ms (medians); clocks agree to "
      "{:.2f} ms\n",
      milliseconds(timeline.on_the_way), milliseconds(timeline.in_line), milliseconds(timeline.clock_error));
}

nlohmann::json to_json(const pool::Timeline& timeline, const Legend& legend, const PoolTimelineOptions& options) {
  nlohmann::json object{{"workers", options.workers},
                        {"clients", options.clients},
                        {"batches", options.batches},
                        {"pinned", !options.cores.empty()},
                        {"length_ms", milliseconds(timeline.length)},
                        {"efficiency", timeline.efficiency},
                        {"on_the_way_ms", milliseconds(timeline.on_the_way)},
                        {"in_line_ms", milliseconds(timeline.in_line)},
                        {"clock_error_ms", milliseconds(timeline.clock_error)},
                        {"rows", nlohmann::json::array()},
                        {"bars", nlohmann::json::array()}};
  for (const pool::Timeline::Row& row : timeline.rows) {
    object["rows"].push_back({{"worker", row.worker},
                              {"thread", row.thread},
                              {"busy", row.busy / timeline.length},
                              {"samples", row.samples},
                              {"copies", row.copies},
                              {"longest_gap_ms", milliseconds(row.longest_gap)}});
  }
  for (const pool::Timeline::Bar& bar : timeline.bars) {
    object["bars"].push_back({{"row", bar.row},
                              {"from_ms", milliseconds(bar.from)},
                              {"to_ms", milliseconds(bar.to)},
                              {"series", legend.of.at({bar.client, bar.epoch})},
                              {"first", bar.first}});
  }
  return object;
}

}  // namespace

Result<void> bench_pool(const PoolTimelineOptions& options) {
  if (!options.picture.empty()) {
    if (auto ok = common::check_picture(options.picture); !ok) return ok;
  }
  options.line->expect(static_cast<std::size_t>(options.clients * (options.batches + 1)));
  auto scene_result = clutter(kObjects);
  if (!scene_result) return scene_result.error();
  Recorder recorder;
  const pool::RemotePoolOptions pool_options{.on_sample = [&](const pool::SampleTrace& trace) { recorder.add(trace); }};
  auto swarm_result = Swarm::start({.workers = options.workers,
                                    .domain = options.domain,
                                    .cores = options.cores,
                                    .pool = pool_options,
                                    .stop = options.stop});
  if (!swarm_result) return swarm_result.error();

  std::vector<std::unique_ptr<Client>> others;
  std::vector<pool::RemotePool*> pools{&(*swarm_result)->pool()};
  std::vector<std::uint64_t> ids{(*swarm_result)->participant().id()};
  for (int i = 1; i < options.clients; ++i) {
    auto participant_result =
        wire::Participant::open({.name = "jostle_bench", .domain = options.domain, .role = wire::Role::kRobot});
    if (!participant_result) return participant_result.error();
    ids.push_back(participant_result->id());
    others.push_back(std::make_unique<Client>(*participant_result, pool_options));
    pools.push_back(&others.back()->pool);
  }
  std::vector<RolloutBatch> batches;
  for (std::size_t i = 0; i < pools.size(); ++i) {
    batches.push_back(batch_of(static_cast<int>(i), *scene_result, options.workers));
    if (auto loaded = pools[i]->load(*scene_result); !loaded) return loaded.error();
    if (!pools[i]->wait_for_workers(options.workers, std::chrono::steady_clock::now() + kPatience)) {
      return Error{Code::kUnavailable,
                   fmt::format("client {}: got fewer than {} usable workers", i + 1, options.workers)};
    }
  }
  if (options.urgent) batches.back().priority = physics_pool::Priority::kUrgent;
  if (auto ok = run_all(pools, batches, 1, options); !ok) return ok;  // worlds are compiled, caches warm
  const auto start = std::chrono::steady_clock::now();
  auto ran = run_all(pools, batches, options.batches, options);
  const auto traces = recorder.since(start);
  if (!ran && (ran.error().code != Code::kCancelled || traces.empty())) return ran;

  const pool::Timeline timeline = pool::timeline_of(traces, pools.front()->status().workers);
  const Legend legend = legend_of(timeline, ids, batches);
  const std::string title = (ran ? "" : "Interrupted: ") + headline(timeline, options);
  options.line->end();
  print(timeline, title);
  if (!options.picture.empty()) {
    if (auto ok = common::draw(options.picture, chart_of(timeline, legend, title)); !ok) return ok;
  }
  if (!options.json.empty()) {
    nlohmann::json json = to_json(timeline, legend, options);
    json["interrupted"] = !ran;
    if (auto ok = common::write_results(options.json, std::move(json)); !ok) return ok;
  }
  return ran;
}

namespace {

class PoolTimeline final : public Benchmark {
 public:
  PoolTimeline()
      : Benchmark("pool", "what each worker did when: busy shares, gaps, a picture", "10 s", Uses::kDomain) {}

  void add_options(CLI::App& app) override {
    options_.workers = common::usable_cores();
    app.add_option("--workers", options_.workers, "Worker processes (default: one per core that this process may use)")
        ->check(CLI::Range(1, 1024));
    app.add_option("--clients", options_.clients, "Clients at once, each with shorter samples than the one before")
        ->capture_default_str()
        ->check(CLI::Range(1, 8));
    app.add_option("--repeats", options_.batches, "Batches of each client")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_flag("--urgent", options_.urgent, "The last client's batches are urgent");
    app.add_flag("--pin", pin_, "Give each worker a core of its own, in turn");
    app.add_option("--timeline", timeline_, "File for a picture of what each worker did when: .png, .svg or .pdf");
    add_json(app);
  }

  Result<void> check() const override {
    if (auto ok = check_picture(timeline_); !ok) return ok;
    return Benchmark::check();
  }

  Result<int> run(const Start& start) override {
    if (pin_) options_.cores = common::allowed_cores();
    options_.picture = timeline_;
    options_.json = json;
    options_.domain = start.domain;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_pool(options_));
  }

 private:
  PoolTimelineOptions options_;
  std::string timeline_;
  bool pin_ = false;
};

}  // namespace

std::unique_ptr<Benchmark> pool_timeline_benchmark() { return std::make_unique<PoolTimeline>(); }

}  // namespace jostle::studies
