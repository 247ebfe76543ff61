#include "services/pool/client/scheduler.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace jostle::pool {

using physics_pool::Priority;

namespace {

constexpr int kLargestCapacity = 1024;                  // threads of one process; more is a broken heartbeat
constexpr int kSpare = 1;                               // samples a worker holds beyond what it can run
constexpr double kNews = 0.1;                           // weight of one more in what is typical
constexpr std::chrono::duration<double> kCover{0.004};  // an exchange with a worker on a busy machine
constexpr double kMostCover = 16.0;                     // samples per thread, however short
constexpr std::uint64_t kUrgentInARow = 7;              // samples, while a normal batch has some to hand out
constexpr std::uint8_t kCopies = 2;                     // of one sample at a time
constexpr double kSlow = 2.0;                           // times the typical time: worth a copy
constexpr int kEmptyHeartbeats = 2;                     // the first may have crossed an assignment on its way

}  // namespace

void Scheduler::heard(const WorkerNews& news, TimePoint now) {
  Worker& worker = workers_[news.worker];
  worker.status.id = news.worker;
  worker.status.name = news.name;
  worker.status.host = news.host;
  worker.status.pid = news.pid;
  worker.status.alive = news.capacity > 0;
  worker.ready = news.ready;
  worker.others = news.others;
  worker.last_heard = now;
  if (!worker.status.alive) return take_back(worker, now);
  if (news.samples > 0) last_held_ = now;
  worker.status.capacity = std::clamp(news.capacity, 1, kLargestCapacity);

  const bool waiting = !worker.outstanding.empty() && worker.outstanding.front().since + options_.lost_after < now;
  worker.empty_heartbeats = waiting && news.samples == 0 ? worker.empty_heartbeats + 1 : 0;
  if (worker.empty_heartbeats >= kEmptyHeartbeats) take_back(worker, now - options_.lost_after);
}

void Scheduler::bench(WorkerId id, TimePoint now) {
  const auto found = workers_.find(id);
  if (found == workers_.end()) return;
  found->second.benched_until = now + options_.bench;
  take_back(found->second, now);
}

std::vector<WorkerId> Scheduler::check_silence(TimePoint now) {
  std::vector<WorkerId> forgotten;
  for (auto& [id, worker] : workers_) {
    if (worker.last_heard + options_.silence < now) {
      worker.status.alive = false;
      take_back(worker, now);
    }
    if (worker.last_heard + options_.remember < now) forgotten.push_back(id);
  }
  for (const WorkerId id : forgotten) workers_.erase(id);
  return forgotten;
}

bool Scheduler::usable(const Worker& worker, TimePoint now) const {
  return worker.status.alive && worker.ready && worker.benched_until <= now;
}

int Scheduler::usable_workers(TimePoint now) const {
  return static_cast<int>(
      std::ranges::count_if(workers_, [&](const auto& entry) { return usable(entry.second, now); }));
}

void Scheduler::start(Epoch epoch, std::uint32_t first_sample, std::uint32_t samples, Priority priority) {
  batches_[epoch] = {
      .priority = priority, .first_sample = first_sample, .samples = std::vector<Sample>(samples), .missing = samples};
}

bool Scheduler::finish(Epoch epoch) {
  batches_.erase(epoch);
  std::size_t held = 0;
  for (auto& [id, worker] : workers_) {
    held += std::erase_if(worker.outstanding, [&](const auto& entry) { return entry.epoch == epoch; });
  }
  return held > 0;
}

std::uint32_t Scheduler::missing(Epoch epoch) const {
  const auto found = batches_.find(epoch);
  return found == batches_.end() ? 0 : found->second.missing;
}

bool Scheduler::accept(WorkerId id, Epoch epoch, std::uint32_t sample, std::uint64_t engine_steps, TimePoint now,
                       std::chrono::duration<double> ran) {
  if (ran.count() > 0) typical_run_ += (typical_run_.count() > 0 ? kNews : 1.0) * (ran - typical_run_);
  const auto worker = workers_.find(id);
  if (worker != workers_.end()) {
    auto& outstanding = worker->second.outstanding;
    const auto entry = std::ranges::find_if(outstanding, [&](const Outstanding& candidate) {
      return candidate.epoch == epoch && candidate.sample == sample;
    });
    if (entry != outstanding.end()) {
      typical_ += kNews * (now - entry->since - typical_);
      release(*entry);
      outstanding.erase(entry);
    }
  }
  const auto batch = batches_.find(epoch);
  const std::uint32_t index = batch == batches_.end() ? 0 : sample - batch->second.first_sample;
  if (batch == batches_.end() || index >= batch->second.samples.size() || batch->second.samples[index].done) {
    ++duplicates_;
    return false;
  }
  batch->second.samples[index].done = true;
  batch->second.returned.erase(index);
  --batch->second.missing;
  if (worker != workers_.end()) {
    ++worker->second.status.rollouts;
    worker->second.status.engine_steps += engine_steps;
  }
  return true;
}

void Scheduler::drop_above(Epoch epoch, std::uint32_t sample) {
  const auto found = batches_.find(epoch);
  if (found == batches_.end()) return;
  Batch& batch = found->second;
  for (std::uint32_t i = sample - batch.first_sample + 1; i < batch.samples.size(); ++i) {
    if (batch.samples[i].done) continue;
    batch.samples[i].done = true;
    batch.returned.erase(i);
    --batch.missing;
  }
  for (auto& [id, worker] : workers_) {
    std::erase_if(worker.outstanding,
                  [&](const Outstanding& entry) { return entry.epoch == epoch && entry.sample > sample; });
  }
}

// A copy is no longer with its worker.
void Scheduler::release(const Outstanding& outstanding) {
  const auto batch = batches_.find(outstanding.epoch);
  if (batch == batches_.end()) return;
  --batch->second.samples[outstanding.sample - batch->second.first_sample].copies;
}

void Scheduler::take_back(Worker& worker, TimePoint sent_before) {
  worker.empty_heartbeats = 0;
  std::erase_if(worker.outstanding, [&](const Outstanding& entry) {
    if (entry.since > sent_before) return false;
    release(entry);
    Batch& batch = batches_.at(entry.epoch);  // finish() leaves nothing outstanding behind
    const std::uint32_t index = entry.sample - batch.first_sample;
    if (!batch.samples[index].done && batch.samples[index].copies == 0) {
      batch.returned.insert(index);
      ++reissued_;
    }
    return true;
  });
}

// Samples that a worker may hold.
int Scheduler::room(const Worker& worker) const {
  if (worker.others == 0 || typical_run_.count() <= 0) return worker.status.capacity + kSpare;
  const double cover = std::clamp(std::ceil(kCover / typical_run_), 1.0, kMostCover);
  return worker.status.capacity * static_cast<int>(cover) + kSpare;
}

// The usable worker with the emptiest hands, relative to its size.
std::pair<const WorkerId, Scheduler::Worker>* Scheduler::least_loaded(TimePoint now) {
  std::pair<const WorkerId, Worker>* best = nullptr;
  double least = 0.0;
  for (auto& entry : workers_) {
    const Worker& worker = entry.second;
    const auto held = static_cast<int>(worker.outstanding.size());
    if (!usable(worker, now) || held >= room(worker)) continue;
    const double load = static_cast<double>(held) / worker.status.capacity;
    if (best && load >= least) continue;
    best = &entry;
    least = load;
  }
  return best;
}

bool Scheduler::next_sample(Choice& choice) {
  const bool normal_first = urgent_in_a_row_ >= kUrgentInARow;
  if (normal_first && next_sample_of(Priority::kNormal, choice)) {
    urgent_in_a_row_ = 0;
    return true;
  }
  if (next_sample_of(Priority::kUrgent, choice)) {
    ++urgent_in_a_row_;
    return true;
  }
  urgent_in_a_row_ = 0;
  return !normal_first && next_sample_of(Priority::kNormal, choice);
}

bool Scheduler::next_sample_of(Priority priority, Choice& choice) {
  auto batch = batches_.upper_bound(last_served_);
  for (std::size_t i = 0; i < batches_.size(); ++i, ++batch) {
    if (batch == batches_.end()) batch = batches_.begin();
    auto& [epoch, content] = *batch;
    if (content.priority != priority) continue;
    while (content.next < content.samples.size() && content.samples[content.next].done) ++content.next;
    std::uint32_t index = content.next;
    if (!content.returned.empty() && *content.returned.begin() < index) {
      index = *content.returned.begin();
      content.returned.erase(content.returned.begin());
    } else if (index < content.samples.size()) {
      ++content.next;
    } else {
      continue;
    }
    last_served_ = epoch;
    choice = {.epoch = epoch, .sample = content.first_sample + index};
    return true;
  }
  return false;
}

// Those that wait behind others first, then the oldest.
std::vector<Scheduler::Copyable> Scheduler::copyable(TimePoint now) const {
  std::vector<Copyable> found;
  for (const auto& [id, worker] : workers_) {
    for (std::size_t i = 0; i < worker.outstanding.size(); ++i) {
      const Outstanding& entry = worker.outstanding[i];
      const auto age = now - entry.since;
      const bool runs = i < static_cast<std::size_t>(worker.status.capacity);
      if (age < options_.copy_after || (runs && age < kSlow * typical_)) continue;
      const Batch& batch = batches_.at(entry.epoch);
      const Sample& sample = batch.samples[entry.sample - batch.first_sample];
      if (sample.done || sample.copies >= kCopies) continue;
      found.push_back(
          {.runs = runs, .since = entry.since, .choice = {.epoch = entry.epoch, .sample = entry.sample}, .holder = id});
    }
  }
  std::ranges::stable_sort(found, {}, [](const Copyable& copy) { return std::pair(copy.runs, copy.since); });
  return found;
}

bool Scheduler::idle(const Worker& worker, TimePoint now) const {
  return usable(worker, now) &&
         worker.outstanding.size() + worker.others < static_cast<std::size_t>(worker.status.capacity);
}

// The list is made once: with hundreds of idle workers at the end of a batch, one search
// for each would keep the dispatcher from hearing what comes back.
void Scheduler::assign_copies(TimePoint now, std::vector<Assignment>& assignments) {
  std::vector<Copyable> copies;
  bool known = false;
  for (auto& [id, worker] : workers_) {
    while (idle(worker, now)) {
      if (!std::exchange(known, true)) copies = copyable(now);
      const auto copy = std::ranges::find_if(copies, [&](const Copyable& candidate) { return candidate.holder != id; });
      if (copy == copies.end()) break;
      give(id, worker, copy->choice, now, assignments);
      copies.erase(copy);
    }
  }
}

void Scheduler::give(WorkerId id, Worker& worker, const Choice& choice, TimePoint now,
                     std::vector<Assignment>& assignments) {
  Batch& batch = batches_.at(choice.epoch);
  Sample& sample = batch.samples[choice.sample - batch.first_sample];
  auto assignment = std::ranges::find_if(assignments, [&](const Assignment& candidate) {
    return candidate.worker == id && candidate.epoch == choice.epoch;
  });
  if (assignment == assignments.end()) {
    assignment =
        assignments.insert(assignments.end(), {.worker = id, .epoch = choice.epoch, .attempt = sample.attempts});
  }
  assignment->samples.push_back(choice.sample);
  ++sample.copies;
  ++sample.attempts;
  worker.outstanding.push_back({.epoch = choice.epoch, .sample = choice.sample, .since = now});
}

std::vector<Assignment> Scheduler::assign(TimePoint now) {
  std::vector<Assignment> assignments;
  Choice choice;
  while (auto* entry = least_loaded(now)) {
    if (!next_sample(choice)) break;
    give(entry->first, entry->second, choice, now, assignments);
  }
  assign_copies(now, assignments);
  return assignments;
}

std::string Scheduler::name_of(WorkerId worker) const {
  const auto found = workers_.find(worker);
  return found == workers_.end() ? "" : found->second.status.name;
}

physics_pool::PoolStatus Scheduler::status() const {
  physics_pool::PoolStatus status{.reissued = reissued_, .duplicates = duplicates_};
  for (const auto& [id, worker] : workers_) status.workers.push_back(worker.status);
  return status;
}

}  // namespace jostle::pool
