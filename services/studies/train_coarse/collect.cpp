#include "services/studies/train_coarse/collect.hpp"

#include <fmt/format.h>

#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "services/studies/train_coarse/episode.hpp"

namespace jostle::studies {
namespace {

using physics_pool::End;

constexpr std::chrono::minutes kPatience{10};  // with one episode: a pool may be shared
constexpr std::uint32_t kMaxAttempts = 100;

// A draw that the fine model cannot finish is made again.
Result<std::vector<Transition>> run_episode(physics_pool::Pool& pool, const DataOrigin& origin, std::uint32_t episode,
                                            std::stop_token stop) {
  std::string reason;
  for (std::uint32_t attempt = 0; attempt < kMaxAttempts; ++attempt) {
    const auto batch = draw_episode(origin, episode, attempt);
    auto reply_result = pool.run(batch, std::chrono::steady_clock::now() + kPatience, stop);
    if (!reply_result) return reply_result.error();
    const auto& outcome = reply_result->outcomes.front();
    if (outcome.end == End::kCompleted) return transitions_of(batch, outcome.trajectory, episode_sliders(episode));
    reason = outcome.reason;
  }
  return Error{Code::kInternal, fmt::format("episode {}: diverged {} times, last: {}", episode, kMaxAttempts, reason)};
}

Error interrupted() { return {Code::kCancelled, "interrupted; the same command continues"}; }

// Episodes finish in any order and are written in theirs.
class Collector {
 public:
  Collector(physics_pool::Pool& pool, TransitionWriter writer, const CollectOptions& options,
            const std::function<void(const CollectProgress&)>& report)
      : pool_(pool),
        options_(options),
        report_(report),
        writer_(std::move(writer)),
        progress_{writer_.size(), writer_.size(), options.samples},
        next_(static_cast<std::uint32_t>(writer_.size() / kEpisodeSteps)),
        next_written_(next_),
        end_(static_cast<std::uint32_t>((options.samples + kEpisodeSteps - 1) / kEpisodeSteps)) {}

  Result<CollectProgress> run(std::stop_token stop) {
    const std::stop_callback forward(stop, [this] { stop_.request_stop(); });
    {
      std::vector<std::jthread> threads;
      for (int i = 0; i < options_.in_flight; ++i) threads.emplace_back([this] { work(); });
    }
    if (error_) return *error_;
    return progress_;
  }

 private:
  std::optional<std::uint32_t> take() {
    const std::lock_guard lock(mutex_);
    if (error_ || next_ >= end_) return {};
    if (stop_.stop_requested()) {
      error_ = interrupted();
      return {};
    }
    return next_++;
  }

  void work() {
    while (const auto episode = take()) {
      auto transitions_result = run_episode(pool_, options_.origin, *episode, stop_.get_token());
      const std::lock_guard lock(mutex_);
      if (!transitions_result) {
        if (!error_) error_ = stop_.stop_requested() ? interrupted() : transitions_result.error();
        stop_.request_stop();
        return;
      }
      finished_.emplace(*episode, std::move(transitions_result).value());
      write();
    }
  }

  void write() {
    for (auto i = finished_.begin(); i != finished_.end() && i->first == next_written_; i = finished_.erase(i)) {
      if (auto ok = writer_.append(i->second); !ok) {
        error_ = ok.error();
        stop_.request_stop();
        return;
      }
      ++next_written_;
    }
    progress_.done = writer_.size();
    if (report_) report_(progress_);
  }

  physics_pool::Pool& pool_;
  const CollectOptions& options_;
  const std::function<void(const CollectProgress&)>& report_;
  std::stop_source stop_;

  std::mutex mutex_;  // guards everything below
  TransitionWriter writer_;
  CollectProgress progress_;
  std::uint32_t next_, next_written_;
  const std::uint32_t end_;
  std::map<std::uint32_t, std::vector<Transition>> finished_;
  std::optional<Error> error_;
};

}  // namespace

Result<CollectProgress> collect(physics_pool::Pool& pool, const std::filesystem::path& file,
                                const CollectOptions& options, std::stop_token stop,
                                const std::function<void(const CollectProgress&)>& report) {
  for (int sliders = 1; sliders <= kMaxSliders; ++sliders) {
    if (auto ok = pool.load(training_scene(options.origin, sliders)); !ok) return ok.error();
  }
  auto writer_result = TransitionWriter::open(file, options.origin, kEpisodeSteps);
  if (!writer_result) return writer_result.error();
  return Collector(pool, std::move(writer_result).value(), options, report).run(std::move(stop));
}

}  // namespace jostle::studies
