#include "services/pool/worker/worker_service.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "services/common/process/program.hpp"
#include "services/common/process/random_id.hpp"
#include "services/common/results/results.hpp"
#include "services/wire/convert/pool.hpp"
#include "services/wire/limits.hpp"

namespace jostle::pool {

using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;
using physics_pool::WorldPtr;

namespace msg = jostle_msgs::msg;
namespace limits = wire::limits;

namespace {

constexpr std::chrono::seconds kWorldPatience{5};  // a latched text arrives in milliseconds
constexpr std::chrono::milliseconds kRetry{20};    // while a world is waited for
constexpr std::size_t kCancelled = 64;             // cancelled batches remembered

std::int64_t nanoseconds(std::chrono::steady_clock::time_point time) {
  return std::chrono::nanoseconds(time.time_since_epoch()).count();
}

std::string host_name() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  return name;
}

// About what an assignment takes in memory.
std::size_t bytes_of(const msg::Assignment& assignment) {
  const msg::BatchDescription& batch = assignment.batch();
  std::size_t numbers = batch.q().size() + batch.v().size() + batch.nominal().size() + batch.u_before().size() +
                        batch.sigma().size() + batch.limit().size() + batch.scales().size();
  std::size_t bytes = sizeof(msg::Assignment) + 4 * (batch.draws().size() + assignment.samples().size());
  for (const msg::Term& term : batch.terms()) {
    numbers += term.values().size();
    bytes += sizeof term + term.kind().size();
  }
  return bytes + 8 * numbers;
}

Result<void> check_samples(const msg::Assignment& assignment, const RolloutBatch& batch) {
  const std::uint32_t first = batch.first_sample, count = batch.samples;
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
    : participant_(participant),
      id_(common::random_id()),
      name_(options.name.empty() ? fmt::format("{}-{}", host_name(), getpid()) : options.name),
      host_(host_name()),
      threads_(std::max(options.threads, 1)),
      worlds_(options.memory / 4),
      result_writer_(participant, wire::topics::kPoolResult),
      heartbeat_writer_(participant, wire::topics::kPoolWorker),
      executor_(threads_, options.cores, (options.memory - options.memory / 4) / static_cast<std::size_t>(threads_)),
      world_reader_(participant, wire::topics::kPoolWorld,
                    [this](msg::WorldDescription& world, const wire::Origin& origin) {
                      worlds_.announce({.high = world.high(), .low = world.low()}, std::move(world.scene()),
                                       origin.participant);
                    }),
      control_reader_(
          participant, wire::topics::kPoolControl,
          [this](const msg::BatchControl& control, const wire::Origin& origin) { obey(control, origin.participant); }),
      assignment_reader_(participant, wire::topics::pool_assignment(id_),
                         [this](Assignment& assignment, const wire::Origin& origin) {
                           take_in(std::move(assignment), origin.participant);
                         }),
      server_([this](std::stop_token stop) { serve(stop); }),
      poster_([this](std::stop_token stop) { send_results(stop); }),
      heart_([this](std::stop_token stop) { beat(stop); }) {}

WorkerService::~WorkerService() {
  server_ = {};
  poster_ = {};
  heart_ = {};
  const std::lock_guard lock(mutex_);
  for (const auto& [batch, running] : running_) running.run->signals.cancel();
}

// On the middleware's thread.
void WorkerService::take_in(Assignment&& assignment, std::uint64_t writer) {
  if (assignment.client() != writer) {
    foreign_.note("an assignment of client {:016x} was dropped: participant {:016x} wrote it", assignment.client(),
                  writer);
    return;
  }
  const std::size_t bytes = bytes_of(assignment);
  const std::lock_guard lock(mutex_);
  Account& account = accounts_[writer];
  account.received = std::max(account.received, assignment.sent());
  if (const char* what = why_too_much(account, assignment, bytes)) {
    ++refused_;
    too_many_.note("{}: an assignment of client {:016x} was dropped: it has too many {} here; it may send it again",
                   name_, writer, what);
    return;
  }
  account.samples += static_cast<std::uint32_t>(assignment.samples().size());
  ++account.arrivals;
  account.arrival_bytes += bytes;
  arrival_bytes_ += bytes;
  arrivals_.push_back({std::move(assignment), std::chrono::steady_clock::now(), bytes});
  kicked_ = true;
  wake_.notify_one();
}

const char* WorkerService::why_too_much(const Account& account, const Assignment& assignment, std::size_t bytes) const {
  if (account.arrivals >= limits::kWaitingPerClient) return "assignments unread or without their worlds";
  if (account.samples + assignment.samples().size() > limits::kSamplesPerClient) return "samples";
  if (account.batches >= limits::kBatchesPerClient && !running_.contains({assignment.client(), assignment.epoch()}))
    return "batches";
  const bool fits = account.arrival_bytes + bytes <= limits::kWaitingBytesPerClient &&
                    arrival_bytes_ + bytes <= limits::kWaitingBytes;
  return fits ? nullptr : "bytes waiting";
}

void WorkerService::serve(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const auto kicked = [&] { return kicked_; };  // hundreds of idle workers on a machine must not wake up for nothing
    without_world_.empty() ? wake_.wait(lock, stop, kicked) : wake_.wait_for(lock, stop, kRetry, kicked);
    kicked_ = false;
    std::deque<Arrival> arrivals = std::exchange(without_world_, {});
    std::ranges::move(std::exchange(arrivals_, {}), std::back_inserter(arrivals));
    lock.unlock();
    for (Arrival& arrival : arrivals) examine(std::move(arrival));
    lock.lock();
    feed();
  }
}

// What is wrong with an assignment goes back, what is right gets in line.
void WorkerService::examine(Arrival arrival) {
  if (!arrival.batch) {
    if (auto ok = judge(arrival); !ok) return refuse(arrival, ok.error());
  }
  const auto world_result = worlds_.find(arrival.batch->world);
  if (!world_result) {
    if (std::chrono::steady_clock::now() - arrival.arrived > kWorldPatience) {
      return refuse(arrival,
                    Error{Code::kUnknownWorld, fmt::format("world: got {}, whose text did not arrive in {} s on {}",
                                                           to_string(arrival.batch->world), kWorldPatience.count(),
                                                           wire::topics::kPoolWorld.name)});
    }
    const std::lock_guard lock(mutex_);
    without_world_.push_back(std::move(arrival));
    return;
  }
  if (!*world_result) return refuse(arrival, world_result->error());
  const WorldPtr& world = world_result->value();
  if (auto ok = physics_pool::validate(*arrival.batch, world->geometry().layout, world->time_step()); !ok) {
    return refuse(arrival, ok.error());
  }
  accept(arrival, world);
}

// Takes the batch out of the message, and looks at what can be said of it without its world.
Result<void> WorkerService::judge(Arrival& arrival) const {
  arrival.batch = wire::from_wire(std::move(arrival.assignment.batch()));
  if (auto ok = physics_pool::validate(*arrival.batch); !ok) return ok;
  return check_samples(arrival.assignment, *arrival.batch);
}

void WorkerService::accept(Arrival& arrival, WorldPtr world) {
  const Assignment& assignment = arrival.assignment;
  const BatchId id{assignment.client(), assignment.epoch()};
  std::unique_lock lock(mutex_);
  if (std::ranges::find(cancelled_, id) != cancelled_.end()) {
    lock.unlock();  // who cancelled it does not mind an answer; who did not has to know
    return refuse(arrival, {Code::kCancelled, fmt::format("batch {:x} was cancelled here", assignment.epoch())});
  }
  looked_at(arrival);
  Running& running = running_[id];
  if (!running.run) {
    ++accounts_.at(id.first).batches;
    running.run = std::make_shared<physics_pool::BatchRun>();
    running.run->batch = *std::move(arrival.batch);
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
      --accounts_.at(id.first).samples;  // already here
    }
  }
}

void WorkerService::refuse(const Arrival& arrival, const Error& error) {
  const Assignment& assignment = arrival.assignment;
  msg::AssignmentResult result;
  result.epoch(assignment.epoch());
  result.attempt(assignment.attempt());
  result.sample(assignment.samples().empty() ? assignment.batch().first_sample() : assignment.samples().front());
  result.error(error.message);
  result.error_code(static_cast<std::uint8_t>(error.code));
  msg::AssignmentResults answer;
  answer.client(assignment.client());
  answer.worker(id_);
  answer.results().push_back(std::move(result));
  const bool taken = result_writer_.write(answer);
  if (!taken) note_lost_result();
  const std::lock_guard lock(mutex_);
  answers_ += taken ? 1 : 0;
  looked_at(arrival);
  accounts_.at(assignment.client()).samples -= static_cast<std::uint32_t>(assignment.samples().size());
}

// It is no longer among the arrivals.
void WorkerService::looked_at(const Arrival& arrival) {
  Account& account = accounts_.at(arrival.assignment.client());
  --account.arrivals;
  account.arrival_bytes -= arrival.bytes;
  arrival_bytes_ -= arrival.bytes;
}

void WorkerService::note_lost_result() {
  lost_results_.note("{}: a result was not taken by the middleware and is lost; its sample will be run again", name_);
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
  std::unique_lock lock(mutex_);
  const Held held = release(batch, outcome.sample);
  lock.unlock();
  if (!skipped) {
    msg::AssignmentResult result = wire::to_wire(outcome);
    result.epoch(batch.second);
    result.attempt(held.attempt);
    result.sent(held.sent);
    result.arrived(nanoseconds(held.arrived));
    result.started(nanoseconds(shift.started));
    result.finished(nanoseconds(shift.finished));
    result.thread(static_cast<std::uint32_t>(shift.thread));
    lock.lock();
    const std::size_t others = accounts_.at(batch.first).samples - outbox_.held(batch.first) - 1;
    const Left left = others == 0                                    ? Left::kNothing
                      : others <= static_cast<std::size_t>(threads_) ? Left::kRunning
                                                                     : Left::kWaiting;
    if (outbox_.put(batch.first, std::move(result), left, gathering_time(accounts_.at(batch.first).period),
                    std::chrono::steady_clock::now()))
      post(lock);
  } else {
    lock.lock();
    --accounts_.at(batch.first).samples;
  }
  ++accounts_.at(batch.first).rollouts;
  ++rollouts_;
  engine_steps_ += outcome.engine_steps;
  turns_.done(held.job, shift.finished - shift.started, skipped);
  --dealt_;
  feed();
}

// Sends what has to leave now, and has the rest sent when it is time.
void WorkerService::post(std::unique_lock<std::mutex>& lock) {
  std::vector<Outbox::Group> groups = outbox_.take(std::chrono::steady_clock::now());
  if (groups.empty()) return post_.notify_one();
  lock.unlock();
  send(std::move(groups));
  lock.lock();
}

void WorkerService::send(std::vector<Outbox::Group> groups) {
  for (Outbox::Group& group : groups) {
    const auto samples = static_cast<std::uint32_t>(group.results.size());
    msg::AssignmentResults answer;
    answer.client(group.client);
    answer.worker(id_);
    answer.results(std::move(group.results));
    const bool taken = result_writer_.write(answer);
    if (!taken) note_lost_result();
    const std::lock_guard lock(mutex_);
    answers_ += taken ? 1 : 0;
    accounts_.at(group.client).samples -= samples;  // after the answer: a client may trust "nothing of yours is here"
  }
}

void WorkerService::send_results(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const auto due = outbox_.due();
    const auto is_sooner = [&] { return outbox_.due() != due; };
    due ? post_.wait_until(lock, stop, *due, is_sooner) : post_.wait(lock, stop, is_sooner);
    std::vector<Outbox::Group> groups = outbox_.take(std::chrono::steady_clock::now());
    lock.unlock();
    send(std::move(groups));
    lock.lock();
  }
}

// Takes out a sample that no longer waits or runs.
WorkerService::Held WorkerService::release(const BatchId& batch, std::uint32_t sample) {
  const auto running = running_.find(batch);
  const auto found = running->second.samples.find(sample);
  const Held held = found->second;
  running->second.samples.erase(found);
  if (running->second.samples.empty()) {
    running_.erase(running);
    --accounts_.at(batch.first).batches;
  }
  return held;
}

void WorkerService::obey(const msg::BatchControl& control, std::uint64_t writer) {
  if (control.client() != writer) {
    foreign_.note("news of a batch of client {:016x} was dropped: participant {:016x} wrote it", control.client(),
                  writer);
    return;
  }
  const std::lock_guard lock(mutex_);
  if (control.kind() == static_cast<std::uint8_t>(ControlKind::kHeartbeats)) {
    accounts_[writer].period =
        std::clamp(std::chrono::milliseconds(control.period()), kHeartbeatPeriod, kLongestHeartbeatPeriod);
    return;
  }
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
    --accounts_.at(batch.first).samples;
  }
}

// Whoever wants to be told the least often has most workers to listen to.
std::chrono::milliseconds WorkerService::period() const {
  std::chrono::milliseconds period = kHeartbeatPeriod;
  for (const auto& [client, account] : accounts_) period = std::max(period, account.period);
  return period;
}

void WorkerService::beat(std::stop_token stop) {
  std::chrono::milliseconds pause{0};
  do {
    const std::vector<std::uint64_t> clients = result_writer_.matched_participants();
    say_who_is_served(clients);
    drop_lost_clients(clients);
    const msg::WorkerHeartbeat message = heartbeat(clients);
    (void)heartbeat_writer_.write(message);  // the next one comes soon; five lost ones make us dead
    say_troubles();
    pause = std::chrono::milliseconds(message.period());
  } while (common::pause_until(std::chrono::steady_clock::now() + pause, stop));
  say_who_is_served({});
  msg::WorkerHeartbeat leave = heartbeat({});
  leave.capacity(0);
  (void)heartbeat_writer_.write(leave);  // politeness: our silence says the same, later
}

void WorkerService::say_troubles() {
  lost_results_.say();
  too_many_.say();
  foreign_.say();
  worlds_.say_refusals();
}

// A line when a client begins, and one when it has gone.
void WorkerService::say_who_is_served(const std::vector<std::uint64_t>& clients) {
  const auto now = std::chrono::steady_clock::now();
  std::vector<std::string> lines;
  {
    const std::lock_guard lock(mutex_);
    for (auto& [client, account] : accounts_) {
      const bool here = std::ranges::binary_search(clients, client);
      if (here && account.name.empty() && account.batches > 0) {
        const auto found = participant_.find(client);
        account.name = fmt::format("client {:016x}{}", client, found ? fmt::format(" ({})", found->text()) : "");
        account.began = now;
        lines.push_back(fmt::format("{}: serves {}", name_, account.name));
      }
      if (here || account.name.empty()) continue;
      const std::chrono::duration<double> time = now - account.began;
      lines.push_back(fmt::format("{}: served {}: {} rollouts in {:.1f} s", name_, std::exchange(account.name, ""),
                                  std::exchange(account.rollouts, 0), time.count()));
    }
  }
  for (const std::string& line : lines) spdlog::info("{}", line);
}

void WorkerService::drop_lost_clients(const std::vector<std::uint64_t>& clients) {
  const std::lock_guard lock(mutex_);
  std::vector<BatchId> lost;
  for (const auto& [batch, running] : running_) {
    if (!std::ranges::binary_search(clients, batch.first)) lost.push_back(batch);
  }
  for (const BatchId& batch : lost) cancel(batch);
  std::erase_if(accounts_, [&](const auto& entry) {
    const Account& account = entry.second;
    const bool gone =
        account.samples == 0 && account.arrivals == 0 && !std::ranges::binary_search(clients, entry.first);
    if (gone) outbox_.forget(entry.first);
    return gone;
  });
}

msg::WorkerHeartbeat WorkerService::heartbeat(const std::vector<std::uint64_t>& clients) const {
  msg::WorkerHeartbeat message;
  message.worker(id_);
  message.name(name_);
  message.host(host_);
  message.pid(static_cast<std::uint32_t>(getpid()));
  message.capacity(static_cast<std::uint32_t>(threads_));
  message.version(common::build());
  double load = 0.0;
  if (getloadavg(&load, 1) == 1) message.load(load);
  for (const Hash& world : worlds_.compiled()) message.worlds().push_back(wire::to_wire(world));
  const std::lock_guard lock(mutex_);
  message.rollouts(rollouts_);
  message.engine_steps(engine_steps_);
  message.refused(refused_);
  message.busy(static_cast<std::uint32_t>(dealt_));
  message.period(static_cast<std::uint32_t>(period().count()));
  message.answers(answers_);
  for (const std::uint64_t client : clients) {
    msg::ClientLoad served;
    served.client(client);
    const auto found = accounts_.find(client);
    served.samples(found == accounts_.end() ? 0 : found->second.samples);
    served.received(found == accounts_.end() ? 0 : found->second.received);
    message.clients().push_back(served);
  }
  return message;
}

}  // namespace jostle::pool
