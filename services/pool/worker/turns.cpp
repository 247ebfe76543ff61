#include "services/pool/worker/turns.hpp"

#include <algorithm>
#include <tuple>

namespace jostle::pool {

using physics_pool::Priority;

namespace {

constexpr std::size_t kRemembered = 64;  // clients, per priority, before idle ones are forgotten
constexpr double kNews = 0.25;           // weight of one more sample in what they take

double weight_of(Priority priority) { return priority == Priority::kUrgent ? 7.0 : 1.0; }

// The entry with waiting samples that was served least, longest ago on ties.
template <class Map, class Waits>
typename Map::iterator least_served(Map& entries, const Waits& waits) {
  auto best = entries.end();
  for (auto entry = entries.begin(); entry != entries.end(); ++entry) {
    if (!waits(entry->second)) continue;
    const auto key = [](const auto& e) { return std::tie(e->second.account.served, e->second.account.last); };
    if (best == entries.end() || key(entry) < key(best)) best = entry;
  }
  return best;
}

}  // namespace

void Turns::wait(const Job& job) {
  Class& group = classes_[job.priority];
  if (group.waiting == 0) group.account.served = std::max(group.account.served, virtual_time_);
  Client& client = group.clients[job.client];
  if (client.jobs.empty()) client.account.served = std::max(client.account.served, group.virtual_time);
  client.jobs.push_back(job);
  ++group.waiting;
}

std::optional<Job> Turns::next() {
  const auto entry = least_served(classes_, [](const Class& group) { return group.waiting > 0; });
  if (entry == classes_.end()) return {};
  auto& [priority, group] = *entry;
  Client& client = least_served(group.clients, [](const Client& c) { return !c.jobs.empty(); })->second;
  Job job = client.jobs.front();
  client.jobs.pop_front();
  --group.waiting;
  job.charged = client.typical.value_or(Duration(0.0));

  virtual_time_ = std::max(virtual_time_, group.account.served);
  group.virtual_time = std::max(group.virtual_time, client.account.served);
  group.account.served += job.charged.count() / weight_of(priority);
  client.account.served += job.charged.count();
  group.account.last = client.account.last = ++turn_;
  if (group.clients.size() > kRemembered) forget_idle(group);
  return job;
}

void Turns::done(const Job& job, Duration took, bool skipped) {
  Class& group = classes_[job.priority];
  const double correction = (took - job.charged).count();
  group.account.served += correction / weight_of(job.priority);
  const auto client = group.clients.find(job.client);
  if (client == group.clients.end()) return;  // forgotten meanwhile
  client->second.account.served += correction;
  if (skipped) return;
  std::optional<Duration>& typical = client->second.typical;
  typical = typical ? *typical + kNews * (took - *typical) : took;
}

std::vector<Job> Turns::withdraw(std::uint64_t client, std::uint64_t epoch) {
  std::vector<Job> withdrawn;
  for (auto& [priority, group] : classes_) {
    const auto found = group.clients.find(client);
    if (found == group.clients.end()) continue;
    std::deque<Job> kept;
    for (const Job& job : found->second.jobs) {
      if (job.epoch != epoch) {
        kept.push_back(job);
        continue;
      }
      withdrawn.push_back(job);
      --group.waiting;
    }
    found->second.jobs = std::move(kept);
  }
  return withdrawn;
}

// Nothing is lost with them but what their samples lately took.
void Turns::forget_idle(Class& group) {
  std::erase_if(group.clients, [&](const auto& entry) {
    return entry.second.jobs.empty() && entry.second.account.served <= group.virtual_time;
  });
}

}  // namespace jostle::pool
