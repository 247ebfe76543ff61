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
constexpr double kWays = 2.0;                           // the usual way there and back, and as much again
constexpr double kMostCover = 16.0;                     // samples per thread, however short
constexpr std::uint64_t kUrgentInARow = 7;              // samples, while a normal batch has some to hand out
constexpr std::uint8_t kCopies = 2;                     // of one sample at a time
constexpr double kSlow = 2.0;                           // times the typical time: worth a copy
constexpr int kEmptyHeartbeats = 2;                     // the first may have crossed an assignment on its way
constexpr int kMissed = 5;                              // heartbeats, before a worker is taken for dead
constexpr double kLatest = 10.0;                        // times its period: later than that says no more
constexpr double kFewResults = 1.0 / 64.0;              // weight of one more in the share of the wrongly dead
constexpr double kCaution = 50.0;                       // of 2 % wrongly dead makes silence twice as long
constexpr int kCrowd = 64;                              // workers that may be heard ten times a second
constexpr std::chrono::seconds kAskedLately{1};         // for another period, or found that there is no need

double load_of(std::size_t held, int capacity) { return static_cast<double>(held) / capacity; }

}  // namespace

// Time that passed while the caller did nothing is not time in which it could have heard anybody.
void Scheduler::listen(TimePoint now) {
  if (last_turn_ != TimePoint{}) listened_ += std::clamp<std::chrono::nanoseconds>(now - last_turn_, {}, options_.turn);
  last_turn_ = now;
}

// How much longer than usual to wait before anything is handed out twice.
double Scheduler::caution() const { return lateness_ * (1.0 + kCaution * wrongly_dead_); }

std::chrono::nanoseconds Scheduler::patience(const Worker& worker) const {
  const std::chrono::nanoseconds least = std::max(options_.silence, kMissed * worker.period);
  const std::chrono::duration<double, std::nano> wanted = least * caution();
  return std::clamp(std::chrono::nanoseconds(std::llround(std::min(wanted.count(), 1e18))), least,
                    std::max<std::chrono::nanoseconds>(options_.longest_silence, least));
}

void Scheduler::heard(const WorkerNews& news, TimePoint now) {
  listen(now);
  Worker& worker = workers_[news.worker];
  if (worker.status.alive && news.period.count() > 0) {
    const std::chrono::duration<double> gap = listened_ - worker.listened_then;
    const double late = std::clamp(gap / std::chrono::duration<double>(news.period), 1.0, kLatest);
    lateness_ += (late - lateness_) / (4.0 + static_cast<double>(workers_.size()));
  }
  worker.status.id = news.worker;
  worker.status.name = news.name;
  worker.status.host = news.host;
  worker.status.pid = news.pid;
  worker.status.alive = news.capacity > 0;
  worker.ready = news.ready;
  worker.others = news.others;
  worker.last_heard = now;
  worker.listened_then = listened_;
  worker.period = news.period;
  if (!worker.status.alive) return take_back(worker, now, Fate::kLost);
  if (news.samples > 0) last_held_ = now;
  worker.status.capacity = std::clamp(news.capacity, 1, kLargestCapacity);

  heard_again(worker, news);
  look_for_lost(worker, news, now);
}

// A worker that was taken for dead lives. What nobody else was given meanwhile is still its own, if it has it.
void Scheduler::heard_again(Worker& worker, const WorkerNews& news) {
  if (worker.doubted.empty() || news.samples == 0) return;
  const auto newer = worker.outstanding.size();
  for (const Outstanding& entry : worker.doubted) {
    const auto batch = batches_.find(entry.epoch);
    if (batch == batches_.end()) continue;
    const std::uint32_t index = entry.sample - batch->second.first_sample;
    if (batch->second.doubted.erase(index) == 0) continue;
    ++batch->second.samples[index].copies;
    worker.outstanding.push_back(entry);
  }
  const auto begin = worker.outstanding.begin();
  std::rotate(begin, begin + static_cast<std::ptrdiff_t>(newer), worker.outstanding.end());  // oldest first
  worker.doubted.clear();
}

// A worker that says it has nothing of ours, though we wait for it, has lost it: its answer would be here. While a
// message may be on its way, either way, that takes longer to believe.
void Scheduler::look_for_lost(Worker& worker, const WorkerNews& news, TimePoint now) {
  if (worker.outstanding.empty() || news.samples > 0) {
    worker.empty_heartbeats = 0;
    return;
  }
  const bool knows = news.all_answers_here && news.received >= worker.outstanding.front().since;
  const TimePoint sent_before = now - (knows ? options_.lost_after : options_.lost_on_the_way);
  worker.empty_heartbeats = worker.outstanding.front().since < sent_before ? worker.empty_heartbeats + 1 : 0;
  if (worker.empty_heartbeats < kEmptyHeartbeats) return;
  if (knows) return take_back(worker, std::min(sent_before, news.received), Fate::kLost);
  take_back(worker, sent_before, Fate::kDoubtful);
}

void Scheduler::bench(WorkerId id, TimePoint now) {
  const auto found = workers_.find(id);
  if (found == workers_.end()) return;
  found->second.benched_until = now + options_.bench;
  take_back(found->second, now, Fate::kLost);
}

std::vector<WorkerId> Scheduler::check_silence(TimePoint now) {
  listen(now);
  std::vector<WorkerId> forgotten;
  for (auto& [id, worker] : workers_) {
    if (listened_ - worker.listened_then > patience(worker)) {
      worker.status.alive = false;
      take_back(worker, now, Fate::kDoubtful);
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

std::optional<std::chrono::milliseconds> Scheduler::period_to_ask(TimePoint now) {
  if (now < last_asked_ + kAskedLately) return {};
  const auto alive = std::ranges::count_if(workers_, [](const auto& entry) { return entry.second.status.alive; });
  const auto wanted = std::clamp(kHeartbeatPeriod * alive / kCrowd, kHeartbeatPeriod, kLongestHeartbeatPeriod);
  const auto knows = [&](const auto& entry) {
    const auto& period = entry.second.period;  // a little more or less is not worth a message
    return !entry.second.status.alive || (period <= wanted + wanted / 4 && period >= wanted - wanted / 4);
  };
  last_asked_ = now;
  if (std::ranges::all_of(workers_, knows)) return {};
  return wanted;
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
    held += std::erase_if(worker.doubted, [&](const auto& entry) { return entry.epoch == epoch; });
  }
  return held > 0;
}

std::uint32_t Scheduler::missing(Epoch epoch) const {
  const auto found = batches_.find(epoch);
  return found == batches_.end() ? 0 : found->second.missing;
}

bool Scheduler::accept(WorkerId id, Epoch epoch, std::uint32_t sample, std::uint64_t engine_steps, TimePoint now,
                       const SampleTimes& times) {
  if (times.ran.count() > 0) typical_run_ += (typical_run_.count() > 0 ? kNews : 1.0) * (times.ran - typical_run_);
  const auto worker = workers_.find(id);
  if (worker != workers_.end()) {
    const auto is_it = [&](const Outstanding& entry) { return entry.epoch == epoch && entry.sample == sample; };
    auto& outstanding = worker->second.outstanding;
    const auto entry = std::ranges::find_if(outstanding, is_it);
    if (entry != outstanding.end()) {
      const std::chrono::duration<double> took = now - entry->since;
      typical_ += kNews * (took - typical_);
      if (times.there.count() > 0 && took > times.there) typical_way_ += kNews * (took - times.there - typical_way_);
      release(*entry);
      outstanding.erase(entry);
    }
    const bool was_doubted = std::erase_if(worker->second.doubted, is_it) > 0;
    wrongly_dead_ += kFewResults * ((was_doubted ? 1.0 : 0.0) - wrongly_dead_);
  }
  const auto batch = batches_.find(epoch);
  const std::uint32_t index = batch == batches_.end() ? 0 : sample - batch->second.first_sample;
  if (batch == batches_.end() || index >= batch->second.samples.size() || batch->second.samples[index].done) {
    ++duplicates_;
    return false;
  }
  batch->second.samples[index].done = true;
  batch->second.returned.erase(index);
  batch->second.doubted.erase(index);
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
    batch.doubted.erase(i);
    --batch.missing;
  }
  const auto above = [&](const Outstanding& entry) { return entry.epoch == epoch && entry.sample > sample; };
  for (auto& [id, worker] : workers_) {
    std::erase_if(worker.outstanding, above);
    std::erase_if(worker.doubted, above);
  }
}

// A copy is no longer with its worker.
void Scheduler::release(const Outstanding& outstanding) {
  const auto batch = batches_.find(outstanding.epoch);
  if (batch == batches_.end()) return;
  --batch->second.samples[outstanding.sample - batch->second.first_sample].copies;
}

void Scheduler::take_back(Worker& worker, TimePoint sent_before, Fate fate) {
  worker.empty_heartbeats = 0;
  std::erase_if(worker.outstanding, [&](const Outstanding& entry) {
    if (entry.since > sent_before) return false;
    release(entry);
    Batch& batch = batches_.at(entry.epoch);  // finish() leaves nothing outstanding behind
    const std::uint32_t index = entry.sample - batch.first_sample;
    if (fate == Fate::kDoubtful) worker.doubted.push_back(entry);
    if (!batch.samples[index].done && batch.samples[index].copies == 0) {
      (fate == Fate::kLost ? batch.returned : batch.doubted).insert(index);
    }
    return true;
  });
}

// Samples that a worker may hold. Those beyond what it can run keep its threads busy until results have come here and
// other samples have gone there.
int Scheduler::room(const Worker& worker) const {
  if (worker.others == 0 || typical_run_.count() <= 0) {
    const std::chrono::duration<double> way = typical_way_ + gathering_time(worker.period);
    const double on_the_way = typical_run_.count() > 0 ? std::min(kWays * way / typical_run_, 1.0) : 0.0;
    return worker.status.capacity + std::max(kSpare, static_cast<int>(on_the_way * worker.status.capacity));
  }
  const double cover = std::clamp(std::ceil(kCover / typical_run_), 1.0, kMostCover);
  return worker.status.capacity * static_cast<int>(cover) + kSpare;
}

// All of them; not in order.
std::vector<Scheduler::Seat> Scheduler::seats(TimePoint now) {
  std::vector<Seat> found;
  for (auto& [id, worker] : workers_) {
    if (!usable(worker, now)) continue;
    const Seat seat{.load = load_of(worker.outstanding.size(), worker.status.capacity),
                    .id = id,
                    .worker = &worker,
                    .room = room(worker)};
    if (std::cmp_less(worker.outstanding.size(), seat.room)) found.push_back(seat);
  }
  return found;
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
    const bool is_new = index < content.samples.size();
    if (!content.returned.empty() || (!is_new && !content.doubted.empty())) {
      auto& again = content.returned.empty() ? content.doubted : content.returned;
      index = again.extract(again.begin()).value();
      ++reissued_;
    } else if (is_new) {
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
  const std::chrono::duration<double, std::milli> copy_after = options_.copy_after * caution();
  for (const auto& [id, worker] : workers_) {
    for (std::size_t i = 0; i < worker.outstanding.size(); ++i) {
      const Outstanding& entry = worker.outstanding[i];
      const auto age = now - entry.since;
      const bool runs = i < static_cast<std::size_t>(worker.status.capacity);
      if (age < copy_after || (runs && age < kSlow * typical_)) continue;
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
  for (auto& entry : workers_) {
    const WorkerId id = entry.first;
    Worker& worker = entry.second;
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

// The emptiest hands, relative to their size, first. A heap: with hundreds of workers one search for each sample is
// what keeps the dispatcher busy.
void Scheduler::assign_new(TimePoint now, std::vector<Assignment>& assignments) {
  std::vector<Seat> heap = seats(now);
  const auto later = [](const Seat& a, const Seat& b) { return std::pair(a.load, a.id) > std::pair(b.load, b.id); };
  std::ranges::make_heap(heap, later);
  Choice choice;
  while (!heap.empty() && next_sample(choice)) {
    std::ranges::pop_heap(heap, later);
    Seat& seat = heap.back();
    give(seat.id, *seat.worker, choice, now, assignments);
    const std::size_t held = seat.worker->outstanding.size();
    seat.load = load_of(held, seat.worker->status.capacity);
    if (std::cmp_less(held, seat.room)) {
      std::ranges::push_heap(heap, later);
    } else {
      heap.pop_back();
    }
  }
}

std::vector<Assignment> Scheduler::assign(TimePoint now) {
  std::vector<Assignment> assignments;
  if (std::ranges::any_of(batches_, [](const auto& entry) { return entry.second.has_some(); })) {
    assign_new(now, assignments);
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
