#include "services/studies/bench/fleet.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <deque>
#include <functional>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "services/pool/client/scheduler.hpp"
#include "services/pool/outbox.hpp"

namespace jostle::studies {
namespace {

using pool::WorkerId;

constexpr pool::Epoch kBatch = 1;
constexpr std::uint64_t kClient = 1;
constexpr double kTick = 0.02;  // of the client's dispatcher, as in RemotePool
constexpr double kHopeless = 10.0;

TimePoint moment(double seconds) {
  return TimePoint{} + std::chrono::hours(1) + std::chrono::nanoseconds(std::llround(1e9 * seconds));
}

double since_start(TimePoint time) { return seconds(time - moment(0.0)); }

double thread_cpu() {
  timespec used{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

// What happens when; of two things at the same time the one that was planned first.
class Agenda {
 public:
  void at(double time, std::function<void()> act) {
    entries_.push_back({time, next_++, std::move(act)});
    std::ranges::push_heap(entries_, later);
  }
  // Lets the next thing happen. Returns its time; nothing is left if that is infinite.
  double step() {
    if (entries_.empty()) return HUGE_VAL;
    std::ranges::pop_heap(entries_, later);
    Entry entry = std::move(entries_.back());
    entries_.pop_back();
    now_ = entry.time;
    entry.act();
    return now_;
  }
  double now() const { return now_; }

 private:
  struct Entry {
    double time;
    std::uint64_t order;
    std::function<void()> act;
  };
  static bool later(const Entry& a, const Entry& b) { return std::pair(a.time, a.order) > std::pair(b.time, b.order); }

  std::vector<Entry> entries_;  // a heap
  std::uint64_t next_ = 0;
  double now_ = 0.0;
};

// Work that waits for a free core, first come, first served.
class Cores {
 public:
  explicit Cores(int count) : free_(static_cast<std::size_t>(count), 0.0) {}

  // Returns when work of so many seconds that could begin now is done.
  double run(double now, double work) {
    if (free_.empty()) return now + work;  // everybody has their own
    double& core = *std::ranges::min_element(free_);
    core = std::max(core, now) + work;
    return core;
  }

 private:
  std::vector<double> free_;  // when each is, s
};

struct Parcel {
  double sent = 0.0;
  std::vector<std::uint32_t> samples;
};

struct Answer {
  WorkerId worker = 0;
  std::uint64_t number = 0;
  std::vector<jostle_msgs::msg::AssignmentResult> results;
};

class Fleet {
 public:
  explicit Fleet(const FleetOptions& options)
      : options_(options), cores_(options.shared_cores), random_(options.seed), scheduler_({}) {}

  FleetResult run() {
    const int lanes = options_.hosts * options_.lanes;
    const auto samples = static_cast<std::uint32_t>(lanes * options_.samples_per_lane);
    for (int host = 0; host < options_.hosts; ++host) join(host);
    agenda_.at(kGathered, [&, samples] {
      scheduler_.start(kBatch, 0, samples);
      began_ = true;
      kick();
    });
    agenda_.at(0.0, [&] { tick(); });
    plan_death();
    const double ideal = options_.sample * options_.samples_per_lane;
    while (!(began_ && scheduler_.missing(kBatch) == 0)) {
      if (agenda_.step() > kGathered + kHopeless * (ideal + 1.0)) break;
    }
    FleetResult result = result_;
    result.finished = began_ && scheduler_.missing(kBatch) == 0;
    result.seconds = agenda_.now() - kGathered;
    result.efficiency = ideal / result.seconds;
    result.client_busy = std::max(busy_, reader_busy_) / result.seconds;
    result.scheduler_us = 1e6 * scheduler_cpu_ / samples;
    result.samples_per_assignment = static_cast<double>(samples_out_) / static_cast<double>(assignments_);
    result.samples_per_answer = static_cast<double>(samples_back_) / static_cast<double>(answers_);
    result.reissued = scheduler_.status().reissued;
    result.duplicates = scheduler_.status().duplicates;
    return result;
  }

 private:
  static constexpr double kGathered = 1.0;  // s, until the batch begins

  struct Host {
    WorkerId worker = 0;  // of its process; 0: it is down
    int idle = 0;
    std::deque<std::pair<std::uint32_t, double>> line;  // samples, and when they arrived
    std::uint32_t held = 0;                             // of ours, sent results not counted
    double newest = -1.0;                               // when the newest assignment that came was sent, s
    std::uint64_t answers = 0;
    pool::Outbox outbox;
  };

  double travel() { return options_.latency + std::exponential_distribution<double>(1.0 / options_.jitter)(random_); }

  // --- hosts ---------------------------------------------------------------------

  Host* alive(int index, WorkerId worker) {
    Host& host = hosts_[static_cast<std::size_t>(index)];
    return host.worker == worker ? &host : nullptr;
  }

  void join(int index) {
    if (hosts_.size() <= static_cast<std::size_t>(index)) hosts_.resize(static_cast<std::size_t>(index) + 1);
    Host& host = hosts_[static_cast<std::size_t>(index)];
    host = {};
    host.worker = ++last_worker_;
    host.idle = options_.lanes;
    host_of_[host.worker] = index;
    const double phase = std::uniform_real_distribution<double>(0.0, seconds(period_))(random_);
    agenda_.at(agenda_.now() + phase, [this, index, worker = host.worker] { beat(index, worker); });
  }

  void beat(int index, WorkerId worker) {
    const Host* host = alive(index, worker);
    if (!host) return;
    pool::WorkerNews news{.worker = worker,
                          .capacity = options_.lanes,
                          .ready = true,
                          .samples = host->held,
                          .received = host->newest < 0.0 ? TimePoint{} : moment(host->newest),
                          .period = period_};
    agenda_.at(agenda_.now() + travel(), [this, news, answers = host->answers] {
      read(options_.costs.heartbeat, [this, news, answers] { heartbeats_.emplace_back(news, answers); });
    });
    agenda_.at(agenda_.now() + seconds(period_), [this, index, worker] { beat(index, worker); });
  }

  void arrive(int index, WorkerId worker, const Parcel& parcel) {
    Host* host = alive(index, worker);
    if (!host) return;
    host->newest = parcel.sent;
    host->held += static_cast<std::uint32_t>(parcel.samples.size());
    for (const std::uint32_t sample : parcel.samples) host->line.emplace_back(sample, agenda_.now());
    agenda_.at(cores_.run(agenda_.now(), options_.costs.take), [this, index, worker] { feed(index, worker); });
  }

  void feed(int index, WorkerId worker) {
    Host* host = alive(index, worker);
    while (host && host->idle > 0 && !host->line.empty()) {
      --host->idle;
      const auto [sample, arrived] = host->line.front();
      host->line.pop_front();
      const double started = cores_.run(agenda_.now(), options_.costs.sample);
      agenda_.at(started + options_.sample, [this, index, worker, sample = sample, arrived = arrived, started] {
        finish(index, worker, sample, arrived, started);
      });
    }
  }

  void finish(int index, WorkerId worker, std::uint32_t sample, double arrived, double started) {
    Host* host = alive(index, worker);
    if (!host) return;
    jostle_msgs::msg::AssignmentResult result;
    result.sample(sample);
    const auto nanoseconds = [](double time) { return std::llround(1e9 * time); };
    result.arrived(nanoseconds(arrived));
    result.started(nanoseconds(started));
    result.finished(nanoseconds(agenda_.now()));
    const std::size_t others = host->held - host->outbox.held(kClient) - 1;
    const pool::Left left = others == 0                                          ? pool::Left::kNothing
                            : others <= static_cast<std::size_t>(options_.lanes) ? pool::Left::kRunning
                                                                                 : pool::Left::kWaiting;
    if (host->outbox.put(kClient, std::move(result), left, pool::gathering_time(period_), moment(agenda_.now())))
      post(index, worker);
    ++host->idle;
    feed(index, worker);
  }

  void post(int index, WorkerId worker) {
    Host* host = alive(index, worker);
    if (!host) return;
    for (pool::Outbox::Group& group : host->outbox.take(moment(agenda_.now()))) {
      host->held -= static_cast<std::uint32_t>(group.results.size());
      const double sent = cores_.run(agenda_.now(), options_.costs.send);
      agenda_.at(sent + travel(), [this, answer = Answer{worker, ++host->answers, std::move(group.results)}]() mutable {
        const double work = options_.costs.answer + options_.costs.read * static_cast<double>(answer.results.size());
        read(work, [this, answer = std::move(answer)]() mutable { answers_waiting_.push_back(std::move(answer)); });
      });
    }
    if (const auto due = host->outbox.due()) {
      agenda_.at(std::max(since_start(*due), agenda_.now()) + 1e-9, [this, index, worker] { post(index, worker); });
    }
  }

  // Hosts die as radioactive atoms do.
  void plan_death() {
    const double rate = options_.deaths_per_minute / 60.0 * options_.hosts;
    if (rate <= 0.0) return;
    agenda_.at(agenda_.now() + std::exponential_distribution<double>(rate)(random_), [this] {
      const int index = std::uniform_int_distribution<int>(0, options_.hosts - 1)(random_);
      Host& host = hosts_[static_cast<std::size_t>(index)];
      if (host.worker != 0) {
        ++result_.deaths;
        host.worker = 0;
        agenda_.at(agenda_.now() + options_.away, [this, index] { join(index); });
      }
      plan_death();
    });
  }

  // --- the client ------------------------------------------------------------------

  void tick() {
    kick();
    agenda_.at(agenda_.now() + kTick, [this] { tick(); });
  }

  // What comes is read by the middleware's thread, one message after the other.
  void read(double work, std::function<void()> put) {
    reader_free_ = cores_.run(std::max(agenda_.now(), reader_free_), work);
    if (began_) reader_busy_ += work;
    agenda_.at(reader_free_, [this, put = std::move(put)] {
      put();
      kick();
    });
  }

  void kick() {
    if (std::exchange(kicked_, true)) return;
    agenda_.at(std::max(agenda_.now(), client_free_), [this] { turn(); });
  }

  // As RemotePool's dispatcher, in its order.
  void turn() {
    kicked_ = false;
    const double now = agenda_.now();
    const TimePoint then = moment(now);
    const FleetCosts& costs = options_.costs;
    double work = costs.turn;
    const double before = options_.time_scheduler ? thread_cpu() : 0.0;
    for (const Answer& answer : answers_waiting_) {
      heard_of_[answer.worker] = std::max(heard_of_[answer.worker], answer.number);
      for (const auto& result : answer.results) {
        const auto between = [](std::int64_t from, std::int64_t to) {
          return std::chrono::duration<double>(1e-9 * static_cast<double>(to - from));
        };
        scheduler_.accept(answer.worker, kBatch, result.sample(), 1, then,
                          {.ran = between(result.started(), result.finished()),
                           .there = between(result.arrived(), result.finished())});
      }
      work += costs.result * static_cast<double>(answer.results.size());
      samples_back_ += answer.results.size();
    }
    answers_ += answers_waiting_.size();
    answers_waiting_.clear();
    for (auto& [news, answers] : heartbeats_) {
      news.all_answers_here = heard_of_[news.worker] >= answers;
      scheduler_.heard(news, then);
    }
    result_.heartbeats += heartbeats_.size();
    heartbeats_.clear();
    scheduler_.check_silence(then);
    std::vector<pool::Assignment> assignments;
    if (began_) assignments = scheduler_.assign(then);
    if (const auto period = scheduler_.period_to_ask(then)) period_ = *period;
    const double scheduled = options_.time_scheduler ? thread_cpu() - before : 0.0;
    work += scheduled;
    work += costs.assignment * static_cast<double>(assignments.size());
    client_free_ = cores_.run(now, work);
    if (began_) {
      busy_ += work;
      scheduler_cpu_ += scheduled;
    }
    for (pool::Assignment& assignment : assignments) {
      ++assignments_;
      samples_out_ += assignment.samples.size();
      agenda_.at(client_free_ + travel(),
                 [this, index = host_of_.at(assignment.worker), worker = assignment.worker,
                  parcel = Parcel{now, std::move(assignment.samples)}] { arrive(index, worker, parcel); });
    }
  }

  const FleetOptions options_;
  Agenda agenda_;
  Cores cores_;
  std::mt19937_64 random_;
  pool::Scheduler scheduler_;
  std::vector<Host> hosts_;
  std::map<WorkerId, int> host_of_;
  WorkerId last_worker_ = 0;
  std::chrono::milliseconds period_ = pool::kHeartbeatPeriod;
  bool began_ = false;
  bool kicked_ = false;
  double client_free_ = 0.0, reader_free_ = 0.0;
  double busy_ = 0.0, reader_busy_ = 0.0, scheduler_cpu_ = 0.0;
  std::vector<Answer> answers_waiting_;
  std::vector<std::pair<pool::WorkerNews, std::uint64_t>> heartbeats_;
  std::map<WorkerId, std::uint64_t> heard_of_;  // the newest answer of each
  std::uint64_t assignments_ = 0, samples_out_ = 0, answers_ = 0, samples_back_ = 0;
  FleetResult result_;
};

}  // namespace

FleetResult simulate(const FleetOptions& options) { return Fleet(options).run(); }

}  // namespace jostle::studies
