#include "planners/sampling/sampling.hpp"

#include <algorithm>
#include <cmath>

#include "planners/search/search.hpp"

namespace jostle::planners {

using physics_pool::RolloutBatch;
using Method = SamplingOptions::Method;

namespace {

std::size_t rounded_up(double part, std::size_t of) {
  return std::min(static_cast<std::size_t>(std::ceil(part * static_cast<double>(of))), of);
}

// Where the next samples come from, and how it follows from the last ones.
class Distribution {
 public:
  Distribution(const SamplingOptions& options, const ControlSequence& initial) : options_(options), mean_(initial) {
    for (int t = 0; t < initial.steps(); ++t) {
      sigma_.insert(sigma_.end(), options.sigma.begin(), options.sigma.end());
    }
  }

  Result<void> improve(Search& search) {
    if (options_.method == Method::kPredictive) mean_ = search.best().controls;
    RolloutBatch noisy = search.around(mean_);
    noisy.samples = samples(search.best().iterations);
    if (options_.method != Method::kPredictive) {
      noisy.law.sigma = sigma_;
      noisy.stop_losers = false;  // weights and elites need every cost
    }
    if (options_.method == Method::kIcem) noisy.law.persistence = options_.persistence;
    auto reply_result = search.run(noisy);
    if (!reply_result) return reply_result.error();
    search.adopt(noisy, *reply_result);
    if (options_.method == Method::kPredictive || succeeded(*reply_result)) return {};
    update(completed(noisy, *reply_result));
    return options_.method == Method::kIcem ? Result<void>{} : search.consider(mean_);
  }

 private:
  std::size_t elites() const {
    return std::max<std::size_t>(rounded_up(options_.elites, static_cast<std::size_t>(options_.rollouts)), 1);
  }

  std::uint32_t samples(int iteration) const {
    if (options_.method != Method::kIcem) return static_cast<std::uint32_t>(options_.rollouts);
    const double wanted = options_.rollouts * std::pow(options_.decay, iteration);
    const double least = std::min<double>(2.0 * static_cast<double>(elites()), options_.rollouts);
    return static_cast<std::uint32_t>(std::max(std::round(wanted), least));
  }

  void update(std::vector<Scored> scored) {
    if (scored.empty()) return;
    if (options_.method == Method::kMppi) {
      std::vector<double> costs;
      for (const Scored& sample : scored) costs.push_back(sample.cost);
      const std::vector<double> weights = exponential_weights(costs, options_.lambda);
      for (int t = 0; t < mean_.steps(); ++t) average_step(scored, weights, t, mean_);
      return;
    }
    scored.insert(scored.begin(), kept_.begin(), kept_.end());
    std::ranges::stable_sort(scored, {}, &Scored::cost);
    scored.resize(std::min(scored.size(), elites()));
    fit(scored);
    if (options_.method != Method::kIcem) return;
    kept_ = std::move(scored);
    kept_.resize(rounded_up(options_.kept, kept_.size()));
  }

  void fit(const std::vector<Scored>& elites) {
    const std::vector<double> equal(elites.size(), 1.0);
    const double old = options_.smoothing;
    ControlSequence center = mean_;
    for (int t = 0; t < mean_.steps(); ++t) {
      average_step(elites, equal, t, center);
      for (std::size_t i = 0; i < options_.sigma.size(); ++i) {
        double squares = 0.0;
        for (const Scored& elite : elites) squares += std::pow(elite.controls.step(t)[i] - center.step(t)[i], 2);
        const double deviation = std::sqrt(squares / static_cast<double>(elites.size()));
        double& sigma = sigma_[static_cast<std::size_t>(t) * options_.sigma.size() + i];
        sigma = std::max(old * sigma + (1 - old) * deviation, options_.sigma_floor * options_.sigma[i]);
        double& u = mean_.step(t)[i];
        u = old * u + (1 - old) * center.step(t)[i];
      }
    }
  }

  const SamplingOptions& options_;
  ControlSequence mean_;
  std::vector<double> sigma_;  // [n][nu]
  std::vector<Scored> kept_;   // elites of the last iteration, cheapest first
};

}  // namespace

SamplingPlanner::SamplingPlanner(physics_pool::Pool& pool, SamplingOptions options, OnProgress on_progress)
    : pool_(pool), options_(std::move(options)), on_progress_(std::move(on_progress)) {}

Result<Plan> SamplingPlanner::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  const RolloutBatch pattern{.step_duration = options_.step_duration,
                             .law = {.sigma = options_.sigma, .limit = options_.limit},
                             .stop_losers = options_.stop_losers,
                             .min_steps = options_.min_steps,
                             .fidelity = options_.fidelity};
  Search search(pool_, problem, pattern, deadline, std::move(stop), on_progress_);
  Distribution distribution(options_, problem.initial);
  return search.until_done([&] { return distribution.improve(search); });
}

}  // namespace jostle::planners
