#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/studies/bench/echo.hpp"
#include "services/studies/bench/several_hosts.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"
#include "services/wire/convert/pool.hpp"

namespace jostle::studies {
namespace {

namespace msg = jostle_msgs::msg;
using Clock = std::chrono::steady_clock;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

// One run of each side: so many round trips.
Result<Sample> through_pool(pool::RemotePool& pool, const RolloutBatch& batch, int count, Trips& trips) {
  std::vector<RolloutOutcome> answers;
  for (int i = 0; i < count; ++i) {
    const auto start = Clock::now();
    auto reply_result = pool.run(batch, start + kLost);
    trips.add(start);
    if (!reply_result) return reply_result.error();
    answers.push_back(std::move(reply_result->outcomes.front()));
  }
  return trips.finish(hash_of_answers(answers));
}

Result<Sample> through_echo(Echo& echo, msg::Assignment assignment, int count, Trips& trips) {
  std::vector<RolloutOutcome> answers;
  for (int i = 0; i < count; ++i) {
    const auto start = Clock::now();
    auto answer_result = echo.ask(assignment);
    trips.add(start);
    if (!answer_result) return answer_result.error();
    auto outcome_result = wire::from_wire(*std::move(answer_result));
    if (!outcome_result) return outcome_result.error();
    answers.push_back(std::move(outcome_result).value());
  }
  return trips.finish(hash_of_answers(answers));
}

RolloutBatch empty_batch(const physics_pool::Scene& scene) {
  RolloutBatch batch = push(scene, 3, 0.5, 1);
  batch.wait = std::chrono::nanoseconds(0);
  return batch;
}

}  // namespace

Result<void> measure_round_trip(const Settings& settings) {
  settings.announce(1);
  constexpr int kTrips = 100;
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  const RolloutBatch batch = empty_batch(*scene_result);

  // Where the kernel puts the other process decides more than anything measured
  // here (45 us on the same core, 95 us on another) and stays for minutes: both
  // sides get the same, this process one core and its peers another.
  const Pinned here(0);
  const int there = std::min(1, static_cast<int>(std::thread::hardware_concurrency()) - 1);
  auto swarm_result = Swarm::start({.domain = settings.domain, .core = std::max(there, 0), .stop = settings.stop});
  if (!swarm_result) return swarm_result.error();
  Swarm& swarm = **swarm_result;
  if (auto loaded = swarm.pool().load(*scene_result); !loaded) return loaded.error();
  Echo echo(swarm.participant());
  if (auto ok = swarm.helpers().start("jostle_bench", {"echo"}); !ok) return ok.error();
  if (auto ok = echo.meet(assignment_of(batch), swarm.helpers()); !ok) return ok.error();

  Trips pool_trips, bare_trips;
  auto result = compare({"pool over DDS", [&] { return through_pool(swarm.pool(), batch, kTrips, pool_trips); }},
                        {"bare echo", [&] { return through_echo(echo, assignment_of(batch), kTrips, bare_trips); }},
                        swarm.turns(settings.turns()));
  if (!result) return result.error();
  result->name = "round-trip";
  result->unit = "us";
  result->aim = Aim{Aim::Kind::kAtMost, 1.5};
  result->details = {{"trips", static_cast<double>(result->a.size() * kTrips)},
                     {"p99_a", common::quantile(pool_trips.all(), 0.99)},
                     {"p99_b", common::quantile(bare_trips.all(), 0.99)}};
  settings.keep(*std::move(result));
  return {};
}

namespace {

constexpr std::size_t kKilo = 1024;
constexpr std::size_t kPayloads[] = {kKilo, 64 * kKilo, 1024 * kKilo};  // bytes
// A datagram of 64 KiB is 44 frames; the kernel keeps those that miss one for 30 s, 4 MiB of
// them in all (net.ipv4.ipfrag_time, ipfrag_high_thresh), and drops every fragment meanwhile.
// So over a bad link a message of 1 MiB took 13 s, and a stream of 64 KiB stood still.
constexpr std::size_t kLargestOverBadLinks = 64 * kKilo;  // there and back; of streams 1 KiB
constexpr int kWindow = 64;                               // messages of a stream that are under way

// A protected and an unprotected domain over the same hosts: a client here, a worker and an
// echo on host 2 each.
struct Domain {
  std::unique_ptr<Swarm> swarm;
  std::unique_ptr<Echo> echo;
  Trips trips;

  static Result<Domain> open(const Settings& settings, const physics_pool::Scene& scene, const common::Hosts& hosts,
                             const std::filesystem::path& keystore) {
    const int domain = settings.domain + (keystore.empty() ? 0 : 1);
    auto swarm_result = Swarm::start({.domain = domain, .hosts = &hosts, .keystore = keystore, .stop = settings.stop});
    if (!swarm_result) return swarm_result.error();
    Domain opened{.swarm = std::move(swarm_result).value(), .echo = {}, .trips = {}};
    if (auto loaded = opened.swarm->pool().load(scene); !loaded) return loaded.error();
    opened.echo = std::make_unique<Echo>(opened.swarm->participant());
    std::vector<std::string> arguments{"echo"};
    if (!keystore.empty()) arguments.insert(arguments.end(), {"--secure", keystore / "identities" / "robot"});
    Helpers& helpers = opened.swarm->helpers();
    if (auto ok = helpers.start("jostle_bench", arguments, {.hosts = &hosts, .host = 2}); !ok) return ok.error();
    if (auto ok = opened.echo->meet(assignment_of(empty_batch(scene)), helpers); !ok) return ok.error();
    return opened;
  }
};

// Controls of so many bytes; nobody executes them.
msg::Assignment assignment_of_size(const physics_pool::Scene& scene, std::size_t bytes, bool both_ways) {
  msg::Assignment assignment = assignment_of(empty_batch(scene));
  assignment.batch().nominal().assign(bytes / sizeof(double), 0.5);
  assignment.batch().want_all_trajectories(both_ways);
  return assignment;
}

Result<Sample> there_and_back(Domain& domain, msg::Assignment assignment, int count) {
  Hash hash;
  for (int i = 0; i < count; ++i) {
    const auto start = Clock::now();
    auto answer_result = domain.echo->ask(assignment);
    domain.trips.add(start);
    if (!answer_result) return answer_result.error();
    hash = hash_of(answer_result->trajectory());
  }
  return domain.trips.finish(hash);
}

// In megabytes per second, there.
Result<Sample> flood(Domain& domain, msg::Assignment assignment, int count) {
  const auto start = Clock::now();
  if (auto ok = domain.echo->stream(assignment, count, kWindow); !ok) return ok.error();
  const double bytes = static_cast<double>(assignment.batch().nominal().size() * sizeof(double)) * count;
  return Sample{.value = 1e-6 * bytes / seconds_since(start), .hash = hash_of(assignment.batch().nominal())};
}

std::string size_name(std::size_t bytes) { return fmt::format("{}KiB", bytes / kKilo); }

// What one link does to the pool's and the middleware's messages, with and without protection.
class Link {
 public:
  Link(std::string name, const common::LinkQuality& quality, const Settings& settings)
      : name_(std::move(name)), quality_(quality), settings_(settings) {}

  const common::LinkQuality& quality() const { return quality_; }

  // How many measurements measure() makes.
  int count() const { return 1 + (quality_.perfect() ? 6 : 3); }

  Result<void> measure(const common::Hosts& hosts) const {
    auto scene_result = clutter(5);
    if (!scene_result) return scene_result.error();
    auto keys_result = TemporaryKeystore::make();
    if (!keys_result) return keys_result.error();
    auto protected_result = Domain::open(settings_, *scene_result, hosts, keys_result->folder());
    if (!protected_result) return protected_result.error();
    auto plain_result = Domain::open(settings_, *scene_result, hosts, {});
    if (!plain_result) return plain_result.error();

    const RolloutBatch batch = empty_batch(*scene_result);
    const auto pool = [&](Domain& domain) { return through_pool(domain.swarm->pool(), batch, trips(0), domain.trips); };
    if (auto ok = add("round-trip/pool", "us", *protected_result, *plain_result, pool); !ok) return ok.error();
    for (const std::size_t bytes : kPayloads) {
      if (!quality_.perfect() && bytes > kLargestOverBadLinks) continue;
      const msg::Assignment assignment = assignment_of_size(*scene_result, bytes, true);
      const auto ask = [&](Domain& domain) { return there_and_back(domain, assignment, trips(bytes)); };
      if (auto ok = add(fmt::format("round-trip/{}", size_name(bytes)), "us", *protected_result, *plain_result, ask);
          !ok)
        return ok.error();
    }
    for (const std::size_t bytes : kPayloads) {
      if (!quality_.perfect() && bytes > kKilo) continue;
      const msg::Assignment assignment = assignment_of_size(*scene_result, bytes, false);
      const auto send = [&](Domain& domain) { return flood(domain, assignment, messages(bytes)); };
      if (auto ok = add(fmt::format("throughput/{}", size_name(bytes)), "MB/s", *protected_result, *plain_result, send);
          !ok)
        return ok.error();
    }
    return {};
  }

 private:
  // Enough for a run of a good fraction of a second.
  int trips(std::size_t bytes) const {
    if (quality_.perfect()) return bytes > 64 * kKilo ? 20 : 200;
    return bytes > kKilo ? 10 : 20;
  }
  int messages(std::size_t bytes) const {
    const std::size_t total = (quality_.perfect() ? 64 : 4) * 1024 * kKilo;
    return static_cast<int>(std::min<std::size_t>(total / bytes, quality_.perfect() ? 10'000 : 2'000));
  }

  Result<void> add(const std::string& what, const std::string& unit, Domain& a, Domain& b,
                   const std::function<Result<Sample>(Domain&)>& run) const {
    a.trips = b.trips = {};
    auto result =
        compare({"protected", [&] { return run(a); }}, {"unprotected", [&] { return run(b); }}, settings_.turns());
    if (!result) return Error{result.error().code, fmt::format("{}/{}: {}", what, name_, result.error().message)};
    result->name = fmt::format("{}/{}", what, name_);
    result->unit = unit;
    if (!a.trips.all().empty()) {
      result->details = {{"p99_a", common::quantile(a.trips.all(), 0.99)},
                         {"p99_b", common::quantile(b.trips.all(), 0.99)}};
    }
    settings_.keep(*std::move(result));
    return {};
  }

  const std::string name_;
  const common::LinkQuality quality_;
  const Settings& settings_;
};

}  // namespace

Result<void> measure_hosts(const Settings& settings) {
  const Link links[] = {{"good", {}, settings}, {"bad", kBadLink, settings}};
  for (const Link& link : links) settings.announce(link.count());
  for (const Link& link : links) {
    auto ok = measure_on_hosts(2, link.quality(), [&](const common::Hosts& hosts) { return link.measure(hosts); });
    if (!ok) return ok;
  }
  return {};
}

namespace {

/// The other process of `round-trip`.
class EchoServer final : public Benchmark {
 public:
  EchoServer() : Benchmark("echo", "", "", Uses::kDomain) {}
  void add_options(CLI::App&) override {}
  Result<int> run(const Start& start) override { return serve_echo(start.domain, start.stop); }
};

}  // namespace

std::unique_ptr<Benchmark> echo_server_benchmark() { return std::make_unique<EchoServer>(); }

}  // namespace jostle::studies
