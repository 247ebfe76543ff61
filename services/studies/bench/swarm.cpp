#include "services/studies/bench/swarm.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <fstream>

#include "services/common/process/files.hpp"

namespace jostle::studies {
namespace {

constexpr std::chrono::seconds kGathering{120};  // 64 processes on two busy cores
constexpr std::chrono::milliseconds kGlance{200};
// Started at once; of 192 that all come to a discovery server at the same moment 13 were
// never introduced (Fast DDS #5767).
constexpr int kWave = 64;

}  // namespace

Pinned::Pinned(int core) {
  sched_getaffinity(0, sizeof before_, &before_);
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(core, &only);
  sched_setaffinity(0, sizeof only, &only);
}

Pinned::~Pinned() { sched_setaffinity(0, sizeof before_, &before_); }

Helpers::Helpers(int domain, std::optional<int> core) : domain_(domain), core_(core) {}

Helpers::~Helpers() {
  // All at once, then one after the other: ending takes as long as the slowest.
  for (Helper& helper : helpers_) helper.process.terminate();
  helpers_.clear();
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

Result<void> Helpers::start(const std::string& program, std::vector<std::string> arguments, const Place& place) {
  if (folder_.empty()) {
    auto folder_result = common::make_temporary_folder("bench");
    if (!folder_result) return folder_result.error();
    folder_ = *folder_result;
  }
  arguments.insert(arguments.end(), {"--domain", std::to_string(domain_)});
  const std::filesystem::path log = folder_ / fmt::format("{}.log", helpers_.size());
  auto process_result = spawn(program, arguments, place, log);
  if (!process_result) return process_result.error();
  helpers_.push_back({program, std::move(arguments), place, log, std::move(process_result).value()});
  return {};
}

Result<void> Helpers::replace(std::size_t index) {
  Helper& helper = helpers_.at(index);
  auto process_result = spawn(helper.program, helper.arguments, helper.place, helper.log);
  if (!process_result) return process_result.error();
  helper.process = std::move(process_result).value();
  return {};
}

Result<common::ChildProcess> Helpers::spawn(const std::string& program, const std::vector<std::string>& arguments,
                                            const Place& place, const std::filesystem::path& log) const {
  std::optional<Result<common::ChildProcess>> result;
  const auto act = [&] {
    std::optional<Pinned> pinned;
    if (core_) pinned.emplace(*core_);
    result = common::ChildProcess::start(common::program_folder() / program, arguments, log);
  };
  place.hosts ? place.hosts->on(place.host, act) : act();
  return *std::move(result);
}

std::string Helpers::casualty() {
  for (Helper& helper : helpers_) {
    common::ChildProcess& child = helper.process;
    if (const auto end = child.ended())
      return fmt::format("process {}: {}\n{}", child.pid(), end->text(), child.last_words());
  }
  return "";
}

double Helpers::cpu_seconds() const {
  double sum = own_cpu_seconds();
  for (const Helper& helper : helpers_) {
    clockid_t clock{};
    timespec used{};
    if (clock_getcpuclockid(helper.process.pid(), &clock) != 0 || clock_gettime(clock, &used) != 0) continue;
    sum += static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  }
  return sum;
}

double Helpers::memory() const {
  double sum = 0.0;
  for (const Helper& helper : helpers_) {
    std::ifstream statm(fmt::format("/proc/{}/statm", helper.process.pid()));
    double all = 0.0, resident = 0.0, shared = 0.0;  // pages
    if (statm >> all >> resident >> shared) sum += (resident - shared) * static_cast<double>(sysconf(_SC_PAGESIZE));
  }
  return sum;
}

Swarm::Swarm(const wire::Participant& participant, const SwarmOptions& options)
    : helpers_(options.domain, options.core), participant_(participant), pool_(participant_, options.pool) {}

Result<std::unique_ptr<Swarm>> Swarm::start(const SwarmOptions& options) {
  wire::ParticipantOptions dds_options{.name = "jostle_bench", .domain = options.domain};
  if (!options.keystore.empty()) dds_options.identity = options.keystore / "identities" / "robot";
  auto participant_result = wire::Participant::open(dds_options);
  if (!participant_result) return participant_result.error();
  std::unique_ptr<Swarm> swarm(new Swarm(*participant_result, options));
  for (int i = 0; i < options.workers; ++i) {
    std::vector<std::string> arguments{"--name", fmt::format("worker-{}", i), "--die-with-parent",
                                       std::to_string(getpid())};
    if (options.threads > 1) arguments.insert(arguments.end(), {"--threads", std::to_string(options.threads)});
    if (!options.cores.empty()) {
      arguments.insert(arguments.end(),
                       {"--pin", std::to_string(options.cores[static_cast<std::size_t>(i) % options.cores.size()])});
    }
    if (!options.keystore.empty())
      arguments.insert(arguments.end(), {"--secure", options.keystore / "identities" / "worker"});
    Place place{.hosts = options.hosts};
    if (options.hosts) place.host = 2 + i % (options.hosts->count() - 1);
    if (auto ok = swarm->helpers_.start("jostle_worker", arguments, place); !ok) return ok.error();
    if ((i + 1) % kWave != 0) continue;
    if (auto ok = swarm->gather(i + 1, options.stop); !ok) return ok.error();
  }
  if (auto ok = swarm->gather(options.workers, options.stop); !ok) return ok.error();
  return swarm;
}

Result<void> Swarm::gather(int workers, std::stop_token stop) {
  const auto deadline = std::chrono::steady_clock::now() + kGathering;
  while (!pool_.wait_for_workers(workers, std::chrono::steady_clock::now() + kGlance)) {
    if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    if (const std::string casualty = helpers_.casualty(); !casualty.empty()) {
      return Error{Code::kUnavailable, fmt::format("a worker ended while {} were gathered: {}", workers, casualty)};
    }
    if (std::chrono::steady_clock::now() < deadline) continue;
    const auto heard = std::ranges::count_if(pool_.status().workers, &physics_pool::WorkerStatus::alive);
    return Error{Code::kUnavailable,
                 fmt::format("workers: got {} that were heard, wanted {} that could be used, in {} s", heard, workers,
                             kGathering.count())};
  }
  return {};
}

}  // namespace jostle::studies
