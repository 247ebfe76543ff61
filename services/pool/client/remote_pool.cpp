#include "services/pool/client/remote_pool.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "services/common/process/random_id.hpp"
#include "services/pool/protocol.hpp"
#include "services/wire/convert/pool.hpp"
#include "services/wire/limits.hpp"

namespace jostle::pool {

using physics_pool::BatchReply;
using physics_pool::End;
using physics_pool::kInfinity;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

namespace msg = jostle_msgs::msg;
namespace limits = wire::limits;

namespace {

// How often silence and stragglers are looked for while nothing arrives.
constexpr std::chrono::milliseconds kTick{20};
// Heartbeats that come so soon after the dispatcher's last turn wait for the next one.
constexpr std::chrono::milliseconds kTogether{2};

msg::BatchControl control(std::uint64_t client, Epoch epoch, ControlKind kind) {
  msg::BatchControl message;
  message.client(client);
  message.epoch(epoch);
  message.kind(static_cast<std::uint8_t>(kind));
  return message;
}

// Whether an outcome is one that this batch can have.
bool fits(const RolloutBatch& batch, const RolloutOutcome& outcome) {
  const auto steps = static_cast<std::uint32_t>(batch.nominal.steps());
  const bool waited = batch.wait && outcome.steps == 0;
  const bool whole = outcome.end != End::kCompleted || outcome.steps == steps || waited;
  const bool may_win =
      outcome.end == End::kSucceeded || (outcome.end == End::kCompleted && outcome.cost < batch.incumbent);
  const bool has_states = outcome.trajectory.size() == outcome.steps + std::size_t{1};
  const bool right_sizes = std::ranges::all_of(outcome.trajectory, [&](const State& x) {
    return x.q.size() == batch.x0.q.size() && x.v.size() == batch.x0.v.size();
  });
  return outcome.end != End::kSkipped && outcome.steps <= steps && whole && right_sizes &&
         (has_states || (outcome.trajectory.empty() && (!may_win || waited)));
}

}  // namespace

/// A batch between submit() and its reply.
struct RemotePool::Active {
  Epoch epoch = 0;
  RolloutBatch batch;
  msg::BatchDescription wire;
  BatchReply reply;
  double best_cost = kInfinity;
  std::uint32_t first_success = UINT32_MAX;
  TimePoint started;
  OnReply on_reply;
  bool ended = false;
  TimePoint progress;               // a sample came back, or it began
  std::optional<TimePoint> missed;  // since then the first time a worker could not do its part
  bool said = false;                // that there is no progress
};

RemotePool::RemotePool(const wire::Participant& participant, const RemotePoolOptions& options)
    : participant_(participant),
      options_(options),
      client_(participant.id()),
      scheduler_(options.scheduler),
      // Results for an earlier process with our participant's id must not fit.
      last_epoch_(common::random_id() >> 16),
      last_usable_(std::chrono::steady_clock::now()),
      world_writer_(participant, wire::topics::kPoolWorld),
      control_writer_(participant, wire::topics::kPoolControl),
      result_reader_(
          participant, wire::topics::kPoolResult,
          [this](msg::AssignmentResults& results, const wire::Origin& origin) { take_in(std::move(results), origin); }),
      heartbeat_reader_(participant, wire::topics::kPoolWorker,
                        [this](const msg::WorkerHeartbeat& heartbeat, const wire::Origin& origin) {
                          take_in(heartbeat, origin.participant);
                        }),
      dispatcher_([this](std::stop_token stop) { dispatch(stop); }) {}

RemotePool::~RemotePool() = default;

void RemotePool::take_in(msg::AssignmentResults&& results, const wire::Origin& origin) {
  const auto now = std::chrono::steady_clock::now();
  const std::lock_guard lock(mutex_);
  const auto owner = participants_.find(results.worker());
  if (owner == participants_.end() || owner->second != origin.participant) {
    if (results.client() != client_) return;
    foreign_.note("results of worker {:016x} were dropped: participant {:016x} wrote them", results.worker(),
                  origin.participant);
    return;
  }
  answers_[results.worker()] = origin.sequence;  // also of those for others: they are numbered together
  if (results.client() != client_) return;
  ++traffic_.answers;
  traffic_.samples_back += results.results().size();
  for (msg::AssignmentResult& result : results.results()) {
    if (results_.size() >= limits::kUnreadResults) {  // the worker's heartbeats tell that it is not there any more
      unread_.note("a result of worker {:016x} was dropped: {} are unread", results.worker(), results_.size());
      break;
    }
    results_.push_back({.worker = results.worker(), .result = std::move(result), .at = now});
  }
  kick();
}

void RemotePool::take_in(const msg::WorkerHeartbeat& heartbeat, std::uint64_t writer) {
  const std::lock_guard lock(mutex_);
  if (!admit(heartbeat.worker(), writer)) return;
  ++traffic_.heartbeats;
  Heartbeat news{
      .name = common::shown(heartbeat.name(), limits::kShown),
      .host = common::shown(heartbeat.host(), limits::kShown),
      .pid = heartbeat.pid(),
      .capacity = heartbeat.capacity(),
      .period = std::clamp(std::chrono::milliseconds(heartbeat.period()), kHeartbeatPeriod, kLongestHeartbeatPeriod),
      .answers = heartbeat.answers()};
  for (const msg::ClientLoad& load : heartbeat.clients()) {
    if (load.client() == client_) {
      news.hears_us = true;
      news.samples = load.samples();
      news.received = TimePoint{std::chrono::nanoseconds(load.received())};
    } else {
      news.others += load.samples();
    }
  }
  heartbeats_[heartbeat.worker()] = std::move(news);
  // Those of hundreds of workers, thousands a second, are absorbed several at a time.
  if (heartbeat.capacity() == 0 || std::chrono::steady_clock::now() > last_turn_ + kTogether) kick();
}

// Whether this participant may speak for this worker.
bool RemotePool::admit(WorkerId worker, std::uint64_t writer) {
  const auto owner = participants_.find(worker);
  if (owner != participants_.end()) {
    if (owner->second == writer) return true;
    foreign_.note("a heartbeat of worker {:016x} was dropped: participant {:016x} wrote it", worker, writer);
    return false;
  }
  std::size_t& count = workers_of_[writer];
  if (count < limits::kWorkersPerParticipant && participants_.size() < limits::kWorkers) {
    ++count;
    participants_.emplace(worker, writer);
    return true;
  }
  too_many_.note("worker {:016x} was ignored: got {} of its participant and {} in all, wanted at most {} and {}",
                 worker, count, participants_.size(), limits::kWorkersPerParticipant, limits::kWorkers);
  if (count == 0) workers_of_.erase(writer);
  return false;
}

void RemotePool::kick() {
  kicked_ = true;
  wake_.notify_one();
}

Result<Hash> RemotePool::load(const physics_pool::Scene& scene) {
  const std::string text = physics_pool::to_yaml(scene);
  const Hash hash = hash_of(text);
  {
    const std::lock_guard lock(mutex_);
    if (worlds_.contains(hash)) return hash;
  }
  if (text.size() > limits::kText) {
    return Error{Code::kInvalidArgument,
                 fmt::format("scene '{}': its text has {} bytes, workers take at most {}; simplify its meshes",
                             scene.name, text.size(), limits::kText)};
  }
  if (auto ok = physics_pool::validate(scene, fmt::format("scene '{}'", scene.name)); !ok) {
    return ok.error();
  }
  msg::WorldDescription description;
  description.high(hash.high);
  description.low(hash.low);
  description.scene(text);
  if (!world_writer_.write(description)) {
    return Error{Code::kUnavailable,
                 fmt::format("{}: world {} could not be announced; a client may load as many as the "
                             "topic's profile has instances, {} unless changed",
                             wire::topics::kPoolWorld.name, to_string(hash), wire::topics::kPoolWorld.qos.instances)};
  }
  const std::lock_guard lock(mutex_);
  worlds_.emplace(hash, std::pair(physics_pool::layout_of(scene), scene.physics.time_step));
  return hash;
}

// A ticket; the batch's end and its own are both under the pool's mutex.
class RemotePool::Underway final : public Ticket {
 public:
  Underway(RemotePool& pool, std::shared_ptr<Active> active) : pool_(pool), active_(std::move(active)) {}

  ~Underway() override {
    const std::lock_guard lock(pool_.mutex_);
    if (!active_->ended) pool_.forget(*active_);
  }

  std::uint32_t missing() const override {
    const std::lock_guard lock(pool_.mutex_);
    return active_->ended ? 0 : pool_.scheduler_.missing(active_->epoch);
  }

 private:
  RemotePool& pool_;
  std::shared_ptr<Active> active_;
};

Result<std::unique_ptr<physics_pool::AsyncPool::Ticket>> RemotePool::submit(const RolloutBatch& batch,
                                                                            OnReply on_reply) {
  const std::lock_guard lock(mutex_);
  const auto world = worlds_.find(batch.world);
  if (world == worlds_.end()) {
    return Error{Code::kUnknownWorld,
                 fmt::format("world: got {}, wanted one given to load() before", to_string(batch.world))};
  }
  const auto& [layout, time_step] = world->second;
  if (auto ok = physics_pool::validate(batch, layout, time_step); !ok) return ok.error();
  const auto active = std::make_shared<Active>();
  active->epoch = ++last_epoch_;
  active->batch = batch;
  active->wire = wire::to_wire(batch);
  active->on_reply = std::move(on_reply);
  active->started = active->progress = std::chrono::steady_clock::now();
  active->reply.outcomes.resize(batch.samples);
  for (std::uint32_t i = 0; i < batch.samples; ++i) {
    active->reply.outcomes[i].sample = batch.first_sample + i;
  }
  active_[active->epoch] = active;
  scheduler_.start(active->epoch, batch.first_sample, batch.samples, batch.priority);
  kick();
  return std::unique_ptr<Ticket>(std::make_unique<Underway>(*this, active));
}

Error RemotePool::no_worker() const {
  const double seconds = std::chrono::duration<double>(options_.no_worker_timeout).count();
  std::string message =
      ever_heard_ ? fmt::format(
                        "no usable worker for {:g} s on domain {}: those that were there are gone, silent or refuse; "
                        "`jostle workers` lists who is there, and a busy machine may want fewer",
                        seconds, participant_.domain())
                  : fmt::format("no worker heard for {:g} s on domain {}; start one with `jostle worker`", seconds,
                                participant_.domain());
  return {Code::kUnavailable, message + participant_.possible_cause() + last_trouble()};
}

std::string RemotePool::last_trouble() const {
  return last_refusal_.empty() ? "" : fmt::format(" (last trouble: {})", last_refusal_);
}

void RemotePool::give_up_without_workers(TimePoint now) {
  std::vector<std::shared_ptr<Active>> hopeless;
  for (const auto& [epoch, active] : active_) {
    if (now >= std::max(last_usable_, active->started) + options_.no_worker_timeout) hopeless.push_back(active);
  }
  for (const auto& active : hopeless) finish(*active, no_worker());
}

// A batch waits as long as some worker has samples of ours, however long they take. It gets nowhere when none has, or
// when all that workers do is to refuse.
void RemotePool::watch_progress(TimePoint now) {
  std::vector<std::shared_ptr<Active>> hopeless;
  for (const auto& [epoch, active] : active_) {
    const TimePoint since = active->missed.value_or(std::max(active->progress, scheduler_.last_held()));
    const bool late = now >= since + limits::kBatchSaysSo || now >= active->progress + limits::kBatchIsSlow;
    if (late && !std::exchange(active->said, true) && options_.on_trouble) {
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - active->progress).count();
      options_.on_trouble(fmt::format("no rollout came back for {} s; usable workers: {}{}", seconds,
                                      scheduler_.usable_workers(now), last_trouble()));
    }
    if (now >= since + limits::kBatchGivesUp) hopeless.push_back(active);
  }
  for (const auto& active : hopeless) {
    finish(*active, Error{Code::kUnavailable,
                          fmt::format("no rollout came back for {} s and none is under way; usable workers: {}{}",
                                      limits::kBatchGivesUp.count(), scheduler_.usable_workers(now), last_trouble())});
  }
}

void RemotePool::finish(Active& active, Result<BatchReply> reply) {
  forget(active);
  active.on_reply(std::move(reply));
}

// Drops a batch that ended, or that nobody waits for any more; workers that still have samples of it are told.
void RemotePool::forget(Active& active) {
  active.ended = true;
  if (scheduler_.finish(active.epoch)) {
    outgoing_.controls.push_back(control(client_, active.epoch, ControlKind::kCancel));
    kick();
  }
  active_.erase(active.epoch);  // its ticket holds another share
}

void RemotePool::dispatch(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    wake_.wait_for(lock, stop, active_.empty() ? kHeartbeatPeriod : kTick, [&] { return kicked_; });
    kicked_ = false;
    const auto now = last_turn_ = std::chrono::steady_clock::now();
    std::vector<WorkerId> strangers;
    absorb_results(now);  // before heartbeats, which say what is still missing
    absorb_heartbeats(now, strangers);
    const std::vector<WorkerId> forgotten = scheduler_.check_silence(now);
    for (const WorkerId worker : forgotten) {
      const auto owner = participants_.find(worker);
      if (--workers_of_.at(owner->second) == 0) workers_of_.erase(owner->second);
      participants_.erase(owner);
      answers_.erase(worker);
    }
    if (scheduler_.usable_workers(now) > 0) last_usable_ = now;
    give_up_without_workers(now);
    watch_progress(now);
    prepare_assignments(now);
    if (const auto period = scheduler_.period_to_ask(now)) {
      outgoing_.controls.push_back(control(client_, 0, ControlKind::kHeartbeats));
      outgoing_.controls.back().period(static_cast<std::uint32_t>(period->count()));
    }
    const Outgoing outgoing = std::exchange(outgoing_, {});

    lock.unlock();
    send(outgoing);
    connect(strangers);
    for (const WorkerId worker : forgotten) assignment_writers_.erase(worker);
    foreign_.say();
    too_many_.say();
    unread_.say();
    lock.lock();
  }
}

void RemotePool::connect(const std::vector<WorkerId>& workers) {
  for (const WorkerId worker : workers) {
    try {
      assignment_writers_.try_emplace(worker, participant_, wire::topics::pool_assignment(worker));
    } catch (const wire::SetupError& error) {
      const std::lock_guard lock(mutex_);
      last_refusal_ = error.what();
    }
  }
}

void RemotePool::send(const Outgoing& outgoing) {
  // News saves work and decides nothing: without it workers simulate what nobody needs any more.
  for (const Control& message : outgoing.controls) (void)control_writer_.write(message);
  for (const auto& [worker, assignment] : outgoing.assignments) {
    if (assignment_writers_.at(worker).write(assignment)) continue;
    // Its samples are sent again once the worker's heartbeats say that they are not there.
    const std::lock_guard lock(mutex_);
    last_refusal_ = fmt::format("worker {:016x}: the middleware did not take {} samples for it", worker,
                                assignment.samples().size());
  }
}

void RemotePool::absorb_heartbeats(TimePoint now, std::vector<WorkerId>& strangers) {
  for (auto& [worker, heartbeat] : std::exchange(heartbeats_, {})) {
    const auto writer = assignment_writers_.find(worker);
    const bool connected = writer != assignment_writers_.end();
    if (!connected && strangers.size() < limits::kNewWorkersPerTurn) strangers.push_back(worker);
    scheduler_.heard({.worker = worker,
                      .name = std::move(heartbeat.name),
                      .host = std::move(heartbeat.host),
                      .pid = heartbeat.pid,
                      .capacity = static_cast<int>(std::min<std::uint32_t>(heartbeat.capacity, INT32_MAX)),
                      .ready = heartbeat.hears_us && connected && writer->second.matched() > 0,
                      .samples = heartbeat.samples,
                      .others = heartbeat.others,
                      .received = heartbeat.received,
                      .all_answers_here = answers_[worker] >= heartbeat.answers,
                      .period = heartbeat.period},
                     now);
    ever_heard_ = true;
    changed_.notify_all();
  }
}

void RemotePool::absorb_results(TimePoint now) {
  for (Received& received : std::exchange(results_, {})) absorb(std::move(received), now);
}

void RemotePool::trace(const Received& received, bool first) const {
  if (!options_.on_sample) return;
  const auto seconds = [](std::int64_t nanoseconds) { return 1e-9 * static_cast<double>(nanoseconds); };
  const msg::AssignmentResult& result = received.result;
  options_.on_sample({.client = client_,
                      .worker = received.worker,
                      .epoch = result.epoch(),
                      .worker_name = scheduler_.name_of(received.worker),
                      .thread = result.thread(),
                      .sample = result.sample(),
                      .attempt = result.attempt(),
                      .first = first,
                      .sent = seconds(result.sent()),
                      .received = std::chrono::duration<double>(received.at.time_since_epoch()).count(),
                      .arrived = seconds(result.arrived()),
                      .started = seconds(result.started()),
                      .finished = seconds(result.finished())});
}

void RemotePool::absorb(Received received, TimePoint now) {
  msg::AssignmentResult& result = received.result;
  const auto found = active_.find(result.epoch());
  if (found == active_.end()) {
    scheduler_.accept(received.worker, result.epoch(), result.sample(), 0, now);  // late: counted
    if (result.error().empty()) trace(received, false);
    return;
  }
  const std::shared_ptr<Active> active = found->second;
  const bool refused = !result.error().empty();
  const WorkerId worker = received.worker;
  const auto between = [](std::int64_t from, std::int64_t to) {
    return std::chrono::duration<double>(1e-9 * (static_cast<double>(to) - static_cast<double>(from)));
  };
  const std::uint64_t epoch = result.epoch(), engine_steps = result.engine_steps();
  const std::uint32_t sample = result.sample();
  const auto ran = between(result.started(), result.finished()), there = between(result.arrived(), result.finished());
  auto outcome_result = wire::from_wire(std::move(result));
  if (refused) {
    const Error& error = outcome_result.error();
    const std::string why = common::shown(error.message, limits::kShownError);
    // A world that did not come, a batch that somebody cancelled: others may do better.
    if (error.code == Code::kUnknownWorld || error.code == Code::kCancelled) return miss(*active, worker, why, now);
    return finish(*active, Error{error.code, fmt::format("worker {:016x}: {}", worker, why)});
  }
  if (!outcome_result || !fits(active->batch, *outcome_result)) {
    return miss(*active, worker, outcome_result ? "its result does not fit the batch" : outcome_result.error().message,
                now);
  }
  const bool first = scheduler_.accept(worker, epoch, sample, engine_steps, now, {.ran = ran, .there = there});
  trace(received, first);
  if (!first) return;
  active->progress = now;
  active->missed.reset();
  if (std::exchange(active->said, false) && options_.on_trouble) options_.on_trouble("");
  adopt(*active, std::move(outcome_result).value());
  if (scheduler_.missing(active->epoch) > 0) return;
  active->reply.winner = physics_pool::select_winner(active->reply.outcomes, active->batch.incumbent);
  finish(*active, std::move(active->reply));
}

// Others may do better; the batch is given up when nobody is left, or nothing comes of it.
void RemotePool::miss(Active& active, WorkerId worker, const std::string& why, TimePoint now) {
  last_refusal_ = fmt::format("worker {:016x}: {}", worker, why);
  if (!active.missed) active.missed = now;
  scheduler_.bench(worker, now);
}

// Keeps an outcome and tells the siblings what it means for them.
void RemotePool::adopt(Active& active, RolloutOutcome outcome) {
  const std::uint32_t sample = outcome.sample;
  if (outcome.end == End::kSucceeded && sample < active.first_success) {
    active.first_success = sample;
    scheduler_.drop_above(active.epoch, sample);
    outgoing_.controls.push_back(control(client_, active.epoch, ControlKind::kSuccess));
    outgoing_.controls.back().sample(sample);
  }
  if (outcome.end == End::kCompleted && outcome.cost < active.best_cost) {
    active.best_cost = outcome.cost;
    if (active.batch.stop_losers && !active.batch.wait) {
      outgoing_.controls.push_back(control(client_, active.epoch, ControlKind::kCost));
      outgoing_.controls.back().cost(outcome.cost);
    }
  }
  active.reply.outcomes[sample - active.batch.first_sample] = std::move(outcome);
}

void RemotePool::prepare_assignments(TimePoint now) {
  for (const Assignment& assignment : scheduler_.assign(now)) {
    const Active& active = *active_.at(assignment.epoch);
    AssignmentMessage message;
    message.client(client_);
    message.epoch(assignment.epoch);
    message.attempt(assignment.attempt);
    message.batch(active.wire);
    message.best_cost(active.best_cost);
    message.first_success(active.first_success);
    message.samples(assignment.samples);
    message.sent(std::chrono::nanoseconds(now.time_since_epoch()).count());
    ++traffic_.assignments;
    traffic_.samples_out += assignment.samples.size();
    outgoing_.assignments.emplace_back(assignment.worker, std::move(message));
  }
}

physics_pool::PoolStatus RemotePool::status() const {
  const std::lock_guard lock(mutex_);
  return scheduler_.status();
}

Traffic RemotePool::traffic() const {
  const std::lock_guard lock(mutex_);
  return traffic_;
}

bool RemotePool::wait_for_workers(int count, TimePoint deadline) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_until(lock, deadline,
                             [&] { return scheduler_.usable_workers(std::chrono::steady_clock::now()) >= count; });
}

}  // namespace jostle::pool
