#include "services/pool/worker/worker_service.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "services/common/process/program.hpp"
#include "services/pool/protocol.hpp"
#include "services/wire/convert/pool.hpp"

namespace jostle::pool {

using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;
using physics_pool::WorldPtr;

namespace msg = jostle_msgs::msg;

namespace {

constexpr std::chrono::seconds kWorldPatience{5};  // a latched text arrives in milliseconds
constexpr std::chrono::milliseconds kRetry{20};    // while a world is waited for
constexpr std::size_t kArrivals = 1024;            // unread assignments; credit keeps honest clients far below
constexpr std::chrono::seconds kComplaints{1};     // between two log lines about losses
constexpr std::size_t kCancelled = 64;             // cancelled batches remembered

std::int64_t nanoseconds(std::chrono::steady_clock::time_point time) {
  return std::chrono::nanoseconds(time.time_since_epoch()).count();
}

std::string host_name() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  return name;
}

Result<void> check_samples(const msg::Assignment& assignment) {
  const std::uint32_t first = assignment.batch().first_sample(), count = assignment.batch().samples();
  if (assignment.samples().empty() || assignment.samples().size() > count) {
    return Error{Code::kInvalidArgument,
                 fmt::format("assignment.samples: got {} of them, wanted 1 to {}", assignment.samples().size(), count)};
  }
  for (const std::uint32_t sample : assignment.samples()) {
    if (sample >= first && sample - first < count) continue;
    return Error{Code::kInvalidArgument, fmt::format("assignment.samples: got {}, wanted {} to {}", sample, first,
                                                     std::uint64_t{first} + count - 1)};
  }
  if (std::isnan(assignment.best_cost())) {
    return Error{Code::kInvalidArgument, "assignment.best_cost: got NaN, wanted a cost or +inf"};
  }
  return {};
}

}  // namespace

WorkerService::WorkerService(const wire::Participant& participant, const WorkerOptions& options)
    : id_(random_id()),
      name_(options.name.empty() ? fmt::format("{}-{}", host_name(), getpid()) : options.name),
      host_(host_name()),
      threads_(std::max(options.threads, 1)),
      worlds_(options.memory / 4),
      result_writer_(participant, wire::topics::kPoolResult),
      heartbeat_writer_(participant, wire::topics::kPoolWorker),
      executor_(threads_, options.cores, (options.memory - options.memory / 4) / static_cast<std::size_t>(threads_)),
      world_reader_(participant, wire::topics::kPoolWorld,
                    [this](const msg::WorldDescription& world) {
                      worlds_.announce({.high = world.high(), .low = world.low()}, world.scene());
                    }),
      control_reader_(participant, wire::topics::kPoolControl,
                      [this](const msg::BatchControl& control) { obey(control); }),
      assignment_reader_(participant, wire::topics::pool_assignment(id_),
                         [this](const Assignment& assignment) {
                           const std::lock_guard lock(mutex_);
                           if (arrivals_.size() >= kArrivals) {
                             ++refused_;
                             return;
                           }
                           arrivals_.push_back({assignment, std::chrono::steady_clock::now()});
                           loads_[assignment.client()] += static_cast<std::uint32_t>(assignment.samples().size());
                           kicked_ = true;
                           wake_.notify_one();
                         }),
      server_([this](std::stop_token stop) { serve(stop); }),
      heart_([this](std::stop_token stop) { beat(stop); }) {}

WorkerService::~WorkerService() {
  server_ = {};
  heart_ = {};
  const std::lock_guard lock(mutex_);
  for (const auto& [batch, running] : running_) running.run->signals.cancel();
}

void WorkerService::serve(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    wake_.wait_for(lock, stop, kRetry, [&] { return kicked_; });
    kicked_ = false;
    const std::deque<Arrival> arrivals = std::exchange(arrivals_, {});
    lock.unlock();
    for (const Arrival& arrival : arrivals) examine(arrival);
    lock.lock();
    feed();
  }
}

// Judges an assignment; what is wrong with it goes back, what is right gets in line.
void WorkerService::examine(const Arrival& arrival) {
  const Assignment& assignment = arrival.assignment;
  RolloutBatch batch = wire::from_wire(assignment.batch());
  if (auto ok = physics_pool::validate(batch); !ok) return refuse(assignment, ok.error());
  if (auto ok = check_samples(assignment); !ok) return refuse(assignment, ok.error());
  const auto world_result = worlds_.find(batch.world);
  if (!world_result) {
    if (std::chrono::steady_clock::now() - arrival.arrived > kWorldPatience) {
      return refuse(assignment,
                    Error{Code::kUnknownWorld,
                          fmt::format("world: got {}, whose text did not arrive in {} s on {}", to_string(batch.world),
                                      kWorldPatience.count(), wire::topics::kPoolWorld.name)});
    }
    const std::lock_guard lock(mutex_);
    arrivals_.push_back(arrival);
    return;
  }
  if (!*world_result) return refuse(assignment, world_result->error());
  const WorldPtr& world = world_result->value();
  if (auto ok = physics_pool::validate(batch, world->geometry().layout, world->time_step()); !ok) {
    return refuse(assignment, ok.error());
  }
  accept(arrival, std::move(batch), world);
}

void WorkerService::accept(const Arrival& arrival, RolloutBatch batch, WorldPtr world) {
  const std::lock_guard lock(mutex_);
  const Assignment& assignment = arrival.assignment;
  const BatchId id{assignment.client(), assignment.epoch()};
  if (std::ranges::find(cancelled_, id) != cancelled_.end()) {
    loads_[assignment.client()] -= static_cast<std::uint32_t>(assignment.samples().size());
    return;
  }
  Running& running = running_[id];
  if (!running.run) {
    running.run = std::make_shared<physics_pool::BatchRun>();
    running.run->batch = std::move(batch);
    running.run->world = std::move(world);
    running.run->on_outcome = [this, id](const RolloutOutcome& outcome, const physics_pool::Shift& shift) {
      finish(id, outcome, shift);
    };
  }
  running.run->signals.offer_cost(assignment.best_cost());
  running.run->signals.offer_success(assignment.first_success());
  for (const std::uint32_t sample : assignment.samples()) {
    const Job job{.client = assignment.client(),
                  .epoch = assignment.epoch(),
                  .sample = sample,
                  .priority = running.run->batch.priority};
    const Held held{.job = job, .attempt = assignment.attempt(), .sent = assignment.sent(), .arrived = arrival.arrived};
    if (running.samples.try_emplace(sample, held).second) {
      turns_.wait(job);
    } else {
      --loads_[assignment.client()];  // already here
    }
  }
}

void WorkerService::refuse(const Assignment& assignment, const Error& error) {
  msg::AssignmentResult result;
  result.client(assignment.client());
  result.worker(id_);
  result.epoch(assignment.epoch());
  result.attempt(assignment.attempt());
  result.sample(assignment.samples().empty() ? assignment.batch().first_sample() : assignment.samples().front());
  result.error(error.message);
  result.error_code(static_cast<std::uint8_t>(error.code));
  const bool sent = result_writer_.write(result);
  const std::lock_guard lock(mutex_);
  if (!sent) ++lost_results_;
  loads_[assignment.client()] -= static_cast<std::uint32_t>(assignment.samples().size());
}

// Gives every free thread a sample. No earlier: a sample that comes while the
// threads are busy may have the better claim to the next free one.
void WorkerService::feed() {
  while (dealt_ < threads_) {
    const auto job = turns_.next();
    if (!job) return;
    Running& running = running_.at({job->client, job->epoch});
    running.samples.at(job->sample).job = *job;
    ++dealt_;
    executor_.submit(running.run, job->sample);
  }
}

// On the thread that simulated, which takes its next sample from here: no other
// thread has to wake up in between.
void WorkerService::finish(const BatchId& batch, const RolloutOutcome& outcome, const physics_pool::Shift& shift) {
  const bool skipped =
      outcome.end == physics_pool::End::kSkipped;  // cancelled, or the client knows of the success that did it
  bool sent = true;
  std::unique_lock lock(mutex_);
  const Held held = release(batch, outcome.sample);
  lock.unlock();
  if (!skipped) {
    msg::AssignmentResult result = wire::to_wire(outcome);
    result.client(batch.first);
    result.worker(id_);
    result.epoch(batch.second);
    result.attempt(held.attempt);
    result.sent(held.sent);
    result.arrived(nanoseconds(held.arrived));
    result.started(nanoseconds(shift.started));
    result.finished(nanoseconds(shift.finished));
    result.thread(static_cast<std::uint32_t>(shift.thread));
    sent = result_writer_.write(result);
  }
  lock.lock();
  if (!sent) ++lost_results_;
  --loads_[batch.first];  // after the answer: a client may trust "nothing of yours is here"
  ++rollouts_;
  engine_steps_ += outcome.engine_steps;
  turns_.done(held.job, shift.finished - shift.started, skipped);
  --dealt_;
  feed();
}

// Takes out a sample that no longer waits or runs.
WorkerService::Held WorkerService::release(const BatchId& batch, std::uint32_t sample) {
  const auto running = running_.find(batch);
  const auto found = running->second.samples.find(sample);
  const Held held = found->second;
  running->second.samples.erase(found);
  if (running->second.samples.empty()) running_.erase(running);
  return held;
}

void WorkerService::obey(const msg::BatchControl& control) {
  const std::lock_guard lock(mutex_);
  const BatchId id{control.client(), control.epoch()};
  if (control.kind() == static_cast<std::uint8_t>(ControlKind::kCancel)) return cancel(id);
  const auto running = running_.find(id);
  if (running == running_.end()) return;
  physics_pool::BatchSignals& signals = running->second.run->signals;
  if (control.kind() == static_cast<std::uint8_t>(ControlKind::kCost)) signals.offer_cost(control.cost());
  if (control.kind() == static_cast<std::uint8_t>(ControlKind::kSuccess)) signals.offer_success(control.sample());
}

// Running samples notice within an engine step; waiting ones are gone at once.
void WorkerService::cancel(const BatchId& batch) {
  cancelled_.push_back(batch);
  if (cancelled_.size() > kCancelled) cancelled_.pop_front();
  const auto running = running_.find(batch);
  if (running == running_.end()) return;
  running->second.run->signals.cancel();
  for (const Job& job : turns_.withdraw(batch.first, batch.second)) {
    release(batch, job.sample);
    --loads_[batch.first];
  }
}

void WorkerService::beat(std::stop_token stop) {
  do {
    const std::vector<std::uint64_t> clients = result_writer_.matched_participants();
    drop_lost_clients(clients);
    (void)heartbeat_writer_.write(heartbeat(clients));  // the next one comes soon; five lost ones make us dead
    say_losses();
  } while (common::pause_until(std::chrono::steady_clock::now() + kHeartbeatPeriod, stop));
  msg::WorkerHeartbeat leave = heartbeat({});
  leave.capacity(0);
  (void)heartbeat_writer_.write(leave);  // politeness: our silence says the same, later
}

// On this thread, not where they happen: a log may block.
void WorkerService::say_losses() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_complaint_) return;
  std::unique_lock lock(mutex_);
  const std::uint64_t lost_results = lost_results_, refused = refused_;
  lock.unlock();
  if (lost_results == said_lost_results_ && refused == said_refused_) return;
  next_complaint_ = now + kComplaints;
  if (lost_results > said_lost_results_) {
    spdlog::warn("{}: {} results were not taken by the middleware and are lost; their samples will be run again", name_,
                 lost_results - said_lost_results_);
  }
  if (refused > said_refused_) {
    spdlog::warn(
        "{}: {} assignments were dropped, for {} were unread or waited for their worlds; clients send them again",
        name_, refused - said_refused_, kArrivals);
  }
  said_lost_results_ = lost_results;
  said_refused_ = refused;
}

void WorkerService::drop_lost_clients(const std::vector<std::uint64_t>& clients) {
  const std::lock_guard lock(mutex_);
  std::vector<BatchId> lost;
  for (const auto& [batch, running] : running_) {
    if (!std::ranges::binary_search(clients, batch.first)) lost.push_back(batch);
  }
  for (const BatchId& batch : lost) cancel(batch);
  std::erase_if(loads_, [](const auto& load) { return load.second == 0; });
}

msg::WorkerHeartbeat WorkerService::heartbeat(const std::vector<std::uint64_t>& clients) const {
  msg::WorkerHeartbeat message;
  message.worker(id_);
  message.name(name_);
  message.host(host_);
  message.pid(static_cast<std::uint32_t>(getpid()));
  message.capacity(static_cast<std::uint32_t>(threads_));
  for (const Hash& world : worlds_.compiled()) message.worlds().push_back(wire::to_wire(world));
  const std::lock_guard lock(mutex_);
  message.rollouts(rollouts_);
  message.engine_steps(engine_steps_);
  message.refused(refused_);
  for (const std::uint64_t client : clients) {
    msg::ClientLoad load;
    load.client(client);
    const auto found = loads_.find(client);
    load.samples(found == loads_.end() ? 0 : found->second);
    message.clients().push_back(load);
  }
  return message;
}

}  // namespace jostle::pool
