#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

#include "idl/convert/pool.hpp"
#include "services/bench/benchmarks.hpp"
#include "services/bench/swarm.hpp"
#include "services/bench/workload.hpp"
#include "services/support/program.hpp"

namespace jostle::services {
namespace {

namespace msg = jostle_msgs::msg;
using Clock = std::chrono::steady_clock;
using physics_pool::End;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

constexpr int kTrips = 100;                  // in one run of one side
constexpr std::chrono::seconds kLost{10};    // a reliable message on one machine takes no such time
constexpr std::chrono::seconds kMeeting{15}; // until both processes know each other
constexpr std::chrono::milliseconds kGreeting{100};

// Type and promise of the pool's own, and nobody else's name.
const dds::Topic<msg::Task> kPing{"rt/bench/ping", dds::kTask};
const dds::Topic<msg::TaskResult> kPong{"rt/bench/pong", dds::kTask};

// What a worker answers to an empty sample.
RolloutOutcome empty_outcome(std::uint32_t sample) {
  return {.sample = sample, .end = End::kCompleted, .cost = 0.0};
}

double micros_since(Clock::time_point start) { return 1e6 * seconds_since(start); }

// Round trips of one side: the median of each run, and all of them together.
struct Trips {
  std::vector<double> all;  // microseconds
  std::vector<RolloutOutcome> answers;

  Sample finish() {
    const std::vector<double> newest(all.end() - kTrips, all.end());
    return {.value = median(newest), .hash = hash_of_answers(std::exchange(answers, {}))};
  }
};

Result<Sample> through_pool(RemotePool& pool, const RolloutBatch& batch, Trips& trips) {
  for (int i = 0; i < kTrips; ++i) {
    const auto start = Clock::now();
    auto reply_result = pool.run(batch, start + kLost);
    trips.all.push_back(micros_since(start));
    if (!reply_result) return reply_result.error();
    trips.answers.push_back(std::move(reply_result->outcomes.front()));
  }
  return trips.finish();
}

// This process's end of the echo.
struct Bare {
  dds::Writer<msg::Task> ping;
  dds::Inbox<msg::TaskResult> pong;
  std::uint64_t epoch = 0;  // of greetings

  explicit Bare(const dds::Participant& participant) : ping(participant, kPing), pong(participant, kPong, 8) {}

  // Pings until an answer comes: only that shows that both directions work.
  Result<void> meet(const msg::Task& task, Helpers& helpers) {
    const auto deadline = Clock::now() + kMeeting;
    do {
      ping.write(task);
      if (pong.take(Clock::now() + kGreeting)) return {};
    } while (Clock::now() < deadline);
    return Error{Code::kUnavailable, fmt::format("echo: no answer in {} s {}", kMeeting.count(), helpers.casualty())};
  }

  // Answers to greetings may come late; they are not meant.
  std::optional<msg::TaskResult> answer_to(const msg::Task& task, Clock::time_point deadline) {
    auto answer = pong.take(deadline);
    while (answer && answer->epoch() != task.epoch()) answer = pong.take(deadline);
    return answer;
  }

  Result<Sample> echo(msg::Task task, Trips& trips) {
    for (int i = 0; i < kTrips; ++i) {
      task.epoch(++epoch);
      const auto start = Clock::now();
      ping.write(task);
      const auto answer = answer_to(task, start + kLost);
      trips.all.push_back(micros_since(start));
      if (!answer) return Error{Code::kUnavailable, fmt::format("echo: no answer to ping {}", task.epoch())};
      auto outcome_result = convert::from_wire(*answer);
      if (!outcome_result) return outcome_result.error();
      trips.answers.push_back(std::move(outcome_result).value());
    }
    return trips.finish();
  }
};

// The message that the pool sends for such a batch.
msg::Task task_of(const RolloutBatch& batch) {
  msg::Task task;
  task.batch(convert::to_wire(batch));
  task.best_cost(physics_pool::kInfinity);
  task.first_success(UINT32_MAX);
  task.samples({batch.first_sample});
  return task;
}

}  // namespace

Result<Measurements> measure_round_trip(const Settings& settings) {
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  RolloutBatch batch = push(*scene_result, 3, 0.5, 1);
  batch.wait = std::chrono::nanoseconds(0);

  // Where the kernel puts the other process decides more than anything measured
  // here (45 us on the same core, 95 us on another) and stays for minutes: both
  // sides get the same, this process one core and its peers another.
  const Pinned here(0);
  const int there = std::min(1, static_cast<int>(std::thread::hardware_concurrency()) - 1);
  auto swarm_result = Swarm::start({.domain = settings.domain, .core = std::max(there, 0), .stop = settings.stop});
  if (!swarm_result) return swarm_result.error();
  Swarm& swarm = **swarm_result;
  if (auto loaded = swarm.pool().load(*scene_result); !loaded) return loaded.error();
  Bare bare(swarm.participant());
  if (auto ok = swarm.helpers().start("jostle_bench", {"echo"}); !ok) return ok.error();
  if (auto ok = bare.meet(task_of(batch), swarm.helpers()); !ok) return ok.error();

  Trips pool_trips, bare_trips;
  auto result = compare({"pool over DDS", [&] { return through_pool(swarm.pool(), batch, pool_trips); }},
                        {"bare echo", [&] { return bare.echo(task_of(batch), bare_trips); }},
                        swarm.turns(settings.repeats, settings.stop));
  if (!result) return result.error();
  result->name = "round-trip";
  result->unit = "us";
  result->aim = Aim{Aim::Kind::kAtMost, 1.5};
  result->details = {{"trips", settings.repeats * kTrips},
                     {"p99_a", quantile(pool_trips.all, 0.99)},
                     {"p99_b", quantile(bare_trips.all, 0.99)}};
  return Measurements{*std::move(result)};
}

int serve_echo(int domain, std::stop_token stop) {
  die_with_parent(getppid());
  auto participant_result = dds::Participant::open({.name = "jostle_bench_echo", .domain = domain});
  if (!participant_result) {
    fmt::print(stderr, "jostle bench: {}\n", participant_result.error().message);
    return kExitBroken;
  }
  dds::Writer<msg::TaskResult> pong(*participant_result, kPong);
  const dds::Reader<msg::Task> ping(*participant_result, kPing, [&](const msg::Task& task) {
    msg::TaskResult result = convert::to_wire(empty_outcome(task.samples().front()));
    result.client(task.client());
    result.epoch(task.epoch());
    pong.write(result);
  });
  wait_for(std::move(stop));
  return kExitOk;
}

}  // namespace jostle::services
