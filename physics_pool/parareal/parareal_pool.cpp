#include "physics_pool/parareal/parareal_pool.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <optional>
#include <set>
#include <tuple>

#include "physics_pool/api/tally.hpp"
#include "physics_pool/parareal/levels.hpp"

namespace jostle::physics_pool {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

int workers_of(const Pool& pool) {
  int workers = 0;
  for (const WorkerStatus& worker : pool.status().workers) workers += worker.alive ? worker.capacity : 0;
  return std::max(workers, 1);
}

}  // namespace

/// A world, and the coarse models that nobody uses at the moment.
struct PararealPool::Known {
  explicit Known(const Scene& world) : scene(world), geometry(world), update(world) {}

  const Scene scene;
  const TaskGeometry geometry;
  const PlanarUpdate update;
  std::vector<std::unique_ptr<CoarseModel>> idle;
  double coarse = 0.0, fine = 0.0;  // c_c and c_f per slice, s; 0: not measured
};

/// A coarse model for one caller.
class PararealPool::Lease {
 public:
  static Result<Lease> take(PararealPool& pool, Known& known) {
    {
      const std::lock_guard lock(pool.mutex_);
      if (!known.idle.empty()) {
        auto model = std::move(known.idle.back());
        known.idle.pop_back();
        return Lease(pool, known, std::move(model));
      }
    }
    auto model_result = make_coarse_model(pool.options_.model, known.scene);
    if (!model_result) return model_result.error();
    return Lease(pool, known, std::move(model_result).value());
  }

  Lease(Lease&&) = default;
  ~Lease() {
    if (!model_) return;
    const std::lock_guard lock(pool_->mutex_);
    known_->idle.push_back(std::move(model_));
  }

  CoarseModel& model() { return *model_; }

 private:
  Lease(PararealPool& pool, Known& known, std::unique_ptr<CoarseModel> model)
      : pool_(&pool), known_(&known), model_(std::move(model)) {}

  PararealPool* pool_;
  Known* known_;
  std::unique_ptr<CoarseModel> model_;
};

/// A sample that is predicted in slices.
struct PararealPool::Sample {
  Sample(const Known& known, CoarseModel& coarse, const RolloutBatch& batch, std::uint32_t number,
         const PararealStop& stop)
      : controls(sample_controls(batch.nominal, batch.law, number)),
        iteration(known.update, coarse, batch.x0, controls, batch.step_duration, stop) {
    outcome.sample = number;
  }

  const ControlSequence controls;
  PararealIteration iteration;
  RolloutOutcome outcome;
  bool ended = false;
};

/// One call of run().
class PararealPool::Run {
 public:
  Run(PararealPool& pool, const Known& known, CoarseModel& coarse, const RolloutBatch& batch, std::uint32_t whole)
      : pool_(pool), known_(known), coarse_(coarse), batch_(batch), whole_(whole) {
    for (std::uint32_t i = whole; i < batch.samples; ++i) {
      samples_.push_back(std::make_unique<Sample>(known, coarse, batch, batch.first_sample + i, pool.options_.stop));
    }
    reply_.outcomes.resize(batch.samples);
    for (std::uint32_t i = 0; i < batch.samples; ++i) reply_.outcomes[i].sample = batch.first_sample + i;
  }

  Result<BatchReply> finish(TimePoint deadline, std::stop_token stop) {
    if (auto ok = start_whole(); !ok) return ok.error();
    sweep();
    for (std::size_t i = 0; i < samples_.size(); ++i) follow(i);
    const std::size_t room = 2 * static_cast<std::size_t>(workers_of(pool_.pool_));
    while (missing_ > 0 || whole_missing_) {
      while (!ready_.empty() && tickets_.size() < room) {
        if (auto ok = submit_next(); !ok) return ok.error();
      }
      auto event_result = next_event(deadline, stop);
      if (!event_result) return event_result.error();
      if (auto ok = handle(std::move(event_result).value()); !ok) return ok.error();
    }
    reply_.winner = select_winner(reply_.outcomes, batch_.incumbent);
    return std::move(reply_);
  }

  std::uint64_t slices() const { return slices_; }

 private:
  using SliceId = std::pair<std::size_t, int>;  // index into samples_, slice
  static constexpr SliceId kWhole{SIZE_MAX, 0};

  struct Event {
    SliceId slice;
    Result<BatchReply> reply;
  };
  /// What the pool's threads reach; outlives the tickets.
  struct Inbox {
    std::mutex mutex;  // guards events
    std::condition_variable_any arrived;
    std::deque<Event> events;
  };
  /// Early iterations first, then early times: others wait for them.
  struct Ready {
    int level = 0, step = 0;
    SliceId slice;
    const State* start = nullptr;

    auto operator<=>(const Ready& other) const {
      return std::tie(level, step, slice) <=> std::tie(other.level, other.step, other.slice);
    }
    bool operator==(const Ready& other) const { return slice == other.slice; }
  };

  Result<void> submit(const RolloutBatch& batch, SliceId id) {
    auto ticket_result = pool_.pool_.submit(batch, [this, id](Result<BatchReply> reply) {
      const std::lock_guard lock(inbox_.mutex);
      inbox_.events.push_back({id, std::move(reply)});
      inbox_.arrived.notify_one();
    });
    if (!ticket_result) return ticket_result.error();
    tickets_[id] = std::move(ticket_result).value();
    return {};
  }

  Result<void> start_whole() {
    if (whole_ == 0) return {};
    RolloutBatch batch = batch_;
    batch.samples = whole_;
    whole_missing_ = true;
    return submit(batch, kWhole);
  }

  // Level 0 of all samples, as many states at a time as the coarse model takes.
  void sweep() {
    const auto width = static_cast<std::size_t>(coarse_.layout().size());
    std::vector<double> states, controls;
    for (std::size_t first = 0; first < samples_.size(); first += CoarseModel::kMaxBatch) {
      const std::size_t count = std::min<std::size_t>(samples_.size() - first, CoarseModel::kMaxBatch);
      states.resize(count * width);
      for (int n = 0; n < batch_.nominal.steps(); ++n) {
        controls.clear();
        for (std::size_t i = 0; i < count; ++i) {
          const Sample& sample = *samples_[first + i];
          sample.iteration.next_start({&states[i * width], width});
          const auto u = sample.controls.step(n);
          controls.insert(controls.end(), u.begin(), u.end());
        }
        coarse_.advance(states, controls, batch_.step_duration);
        for (std::size_t i = 0; i < count; ++i) samples_[first + i]->iteration.guess({&states[i * width], width});
      }
    }
    missing_ = samples_.size();
  }

  Result<void> submit_next() {
    const Ready next = *ready_.begin();
    ready_.erase(ready_.begin());
    return submit(slice_batch(batch_, *next.start, samples_[next.slice.first]->controls.step(next.step)), next.slice);
  }

  Result<Event> next_event(TimePoint deadline, std::stop_token stop) {
    std::unique_lock lock(inbox_.mutex);
    if (!inbox_.arrived.wait_until(lock, stop, deadline, [&] { return !inbox_.events.empty(); })) {
      if (stop.stop_requested()) return Error{Code::kCancelled, "batch: cancelled by its caller"};
      return Error{Code::kDeadline, fmt::format("batch: {} of {} rollouts were unfinished at the deadline",
                                                missing_ + (whole_missing_ ? whole_ : 0), batch_.samples)};
    }
    Event event = std::move(inbox_.events.front());
    inbox_.events.pop_front();
    return event;
  }

  Result<void> handle(Event event) {
    tickets_.erase(event.slice);
    if (!event.reply) return event.reply.error();
    if (event.slice == kWhole) {
      whole_missing_ = false;
      std::ranges::move(event.reply->outcomes, reply_.outcomes.begin());
      if (event.reply->winner >= 0 &&
          reply_.outcomes[static_cast<std::size_t>(event.reply->winner)].end == End::kSucceeded) {
        skip_above(0);
      }
      return {};
    }
    ++slices_;
    Sample& sample = *samples_[event.slice.first];
    if (sample.ended) return {};
    RolloutOutcome& slice = event.reply->outcomes.front();
    sample.outcome.engine_steps += slice.engine_steps;
    sample.outcome.thawed += slice.thawed;
    if (slice.end == End::kDiverged) {
      sample.outcome.reason = fmt::format("slice of one step: {}", slice.reason);
      end(event.slice.first, End::kDiverged);
      return {};
    }
    sample.iteration.complete(event.slice.second, std::move(slice.trajectory.back()));
    follow(event.slice.first);
    return {};
  }

  // Takes what a sample's newest states have made possible.
  void follow(std::size_t i) {
    Sample& sample = *samples_[i];
    if (!sample.iteration.problem().empty()) {
      sample.outcome.reason = sample.iteration.problem();
      return end(i, End::kDiverged);
    }
    if (sample.iteration.done()) return score(i);
    for (const PararealIteration::Slice& slice : sample.iteration.take_ready()) {
      ready_.insert({.level = slice.level, .step = slice.step, .slice = {i, slice.id}, .start = slice.start});
    }
  }

  void score(std::size_t i) {
    Sample& sample = *samples_[i];
    Tally tally(known_.geometry, batch_, sample.controls, sample.outcome);
    std::optional<End> how;
    for (std::size_t n = 1; !how; ++n) how = tally.count(sample.iteration.states()[n]);
    tally.close(*how);
    end(i, *how);
    if (*how == End::kSucceeded) skip_above(i + 1);
  }

  // A sample ends; nothing more is run for it.
  void end(std::size_t i, End how) {
    Sample& sample = *samples_[i];
    if (sample.ended) return;
    sample.ended = true;
    sample.outcome.end = how;
    std::erase_if(ready_, [i](const Ready& ready) { return ready.slice.first == i; });
    std::erase_if(tickets_, [i](const auto& entry) { return entry.first.first == i; });
    reply_.outcomes[whole_ + i] = std::move(sample.outcome);
    --missing_;
  }

  void skip_above(std::size_t first) {
    for (std::size_t i = first; i < samples_.size(); ++i) end(i, End::kSkipped);
  }

  PararealPool& pool_;
  const Known& known_;
  CoarseModel& coarse_;
  const RolloutBatch& batch_;
  const std::uint32_t whole_;
  std::vector<std::unique_ptr<Sample>> samples_;
  BatchReply reply_;
  std::size_t missing_ = 0;
  bool whole_missing_ = false;
  std::uint64_t slices_ = 0;
  std::set<Ready> ready_;
  Inbox inbox_;
  std::map<SliceId, std::unique_ptr<AsyncPool::Ticket>> tickets_;  // go before the inbox
};

PararealPool::PararealPool(AsyncPool& pool, PararealOptions options) : pool_(pool), options_(std::move(options)) {}

PararealPool::~PararealPool() = default;

Result<Hash> PararealPool::load(const Scene& scene) {
  auto model_result = make_coarse_model(options_.model, scene);
  if (!model_result) return model_result.error();
  auto hash_result = pool_.load(scene);
  if (!hash_result) return hash_result;
  const std::lock_guard lock(mutex_);
  std::unique_ptr<Known>& known = worlds_[*hash_result];
  if (!known) known = std::make_unique<Known>(scene);
  known->idle.push_back(std::move(model_result).value());
  return hash_result;
}

Result<BatchReply> PararealPool::run(const RolloutBatch& batch, TimePoint deadline, std::stop_token stop) {
  Known* known = nullptr;
  {
    const std::lock_guard lock(mutex_);
    const auto found = worlds_.find(batch.world);
    if (found == worlds_.end()) {
      return Error{Code::kUnknownWorld,
                   fmt::format("world: got {}, wanted one given to load() before", to_string(batch.world))};
    }
    known = found->second.get();
  }
  if (auto ok = validate(batch, known->geometry.layout, known->scene.physics.time_step); !ok) return ok.error();
  // Noise is drawn by the step within the whole rollout, so slices would draw other numbers; and cheap models stop at
  // once where there is no control, so they know nothing of rests.
  if (batch.wait || !batch.noise.is_off() || batch.rest > 0) return pool_.run(batch, deadline, stop);
  std::uint32_t whole = 0;
  if (options_.split_by_itself) {
    auto split_result = choose(*known, batch, deadline, stop);
    if (!split_result) return split_result.error();
    whole = static_cast<std::uint32_t>(split_result->whole);
  }
  if (whole == batch.samples) return pool_.run(batch, deadline, stop);
  auto lease_result = Lease::take(*this, *known);
  if (!lease_result) return lease_result.error();
  Run run(*this, *known, lease_result->model(), batch, whole);
  auto reply_result = run.finish(deadline, stop);
  const std::lock_guard lock(mutex_);
  slices_ += run.slices();
  return reply_result;
}

std::uint64_t PararealPool::slices() const {
  const std::lock_guard lock(mutex_);
  return slices_;
}

// Measures c_c and c_f once per world, on one slice of the first batch.
Result<Split> PararealPool::choose(Known& known, const RolloutBatch& batch, TimePoint deadline, std::stop_token stop) {
  SplitProblem problem{.samples = static_cast<int>(batch.samples),
                       .steps = batch.nominal.steps(),
                       .workers = workers_of(pool_),
                       .iterations = options_.stop.iterations};
  {
    const std::lock_guard lock(mutex_);
    problem.coarse = known.coarse;
    problem.fine = known.fine;
  }
  if (problem.fine == 0.0) {
    const RolloutBatch slice = slice_batch(batch, batch.x0, batch.nominal.step(0));
    // The first one also compiles the world.
    for (int repeat = 0; repeat < 2; ++repeat) {
      const auto start = std::chrono::steady_clock::now();
      auto reply_result = pool_.run(slice, deadline, stop);
      if (!reply_result) return reply_result.error();
      problem.fine = seconds_since(start);
    }
    auto lease_result = Lease::take(*this, known);
    if (!lease_result) return lease_result.error();
    constexpr int kRepeats = 20;
    std::vector<double> planar(static_cast<std::size_t>(known.update.planar_layout().size()));
    const auto start = std::chrono::steady_clock::now();
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      to_planar(known.geometry.layout, batch.x0, planar);
      lease_result->model().advance(planar, batch.nominal.step(0), batch.step_duration);
    }
    problem.coarse = seconds_since(start) / kRepeats;
    const std::lock_guard lock(mutex_);
    known.coarse = problem.coarse;
    known.fine = problem.fine;
  }
  const Split split = choose_split(problem);
  const std::string choice = fmt::format("{}/{}/{}/{}", problem.samples, problem.steps, problem.workers, split.whole);
  {
    const std::lock_guard lock(mutex_);
    if (choice == said_) return split;
    said_ = choice;
  }
  if (options_.on_split) options_.on_split(explain(split, problem));
  return split;
}

}  // namespace jostle::physics_pool
