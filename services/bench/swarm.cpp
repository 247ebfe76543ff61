#include "services/bench/swarm.hpp"

#include <fmt/format.h>
#include <unistd.h>
#include <time.h>

#include "services/support/files.hpp"

namespace jostle::services {
namespace {

constexpr std::chrono::seconds kGathering{120};  // 64 processes on two busy cores
constexpr std::chrono::milliseconds kGlance{200};

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
  for (ChildProcess& child : children_) child.terminate();
  children_.clear();
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

Result<void> Helpers::start(const std::string& program, std::vector<std::string> arguments) {
  if (folder_.empty()) {
    auto folder_result = make_temporary_folder("bench");
    if (!folder_result) return folder_result.error();
    folder_ = *folder_result;
  }
  arguments.insert(arguments.end(), {"--domain", std::to_string(domain_)});
  std::optional<Pinned> pinned;
  if (core_) pinned.emplace(*core_);
  auto child_result = ChildProcess::start(program_folder() / program, arguments,
                                          folder_ / fmt::format("{}.log", children_.size()));
  if (!child_result) return child_result.error();
  children_.push_back(std::move(child_result).value());
  return {};
}

std::string Helpers::casualty() {
  for (ChildProcess& child : children_) {
    if (const auto end = child.ended()) return fmt::format("process {}: {}\n{}", child.pid(), *end, child.last_words());
  }
  return "";
}

double Helpers::cpu_seconds() const {
  double sum = own_cpu_seconds();
  for (const ChildProcess& child : children_) {
    clockid_t clock{};
    timespec used{};
    if (clock_getcpuclockid(child.pid(), &clock) != 0 || clock_gettime(clock, &used) != 0) continue;
    sum += static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  }
  return sum;
}

Swarm::Swarm(const dds::Participant& participant, const SwarmOptions& options)
    : helpers_(options.domain, options.core), participant_(participant), pool_(participant_, options.pool) {}

Result<std::unique_ptr<Swarm>> Swarm::start(const SwarmOptions& options) {
  auto participant_result = dds::Participant::open({.name = "jostle_bench", .domain = options.domain});
  if (!participant_result) return participant_result.error();
  std::unique_ptr<Swarm> swarm(new Swarm(*participant_result, options));
  for (int i = 0; i < options.workers; ++i) {
    std::vector<std::string> arguments{"--name", fmt::format("worker-{}", i), "--die-with-parent", std::to_string(getpid())};
    if (!options.cores.empty()) {
      arguments.insert(arguments.end(), {"--pin", std::to_string(options.cores[static_cast<std::size_t>(i) % options.cores.size()])});
    }
    if (auto ok = swarm->helpers_.start("jostle_worker", arguments); !ok) return ok.error();
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
    return Error{Code::kUnavailable,
                 fmt::format("workers: got fewer than {} usable in {} s", workers, kGathering.count())};
  }
  return {};
}

}  // namespace jostle::services
