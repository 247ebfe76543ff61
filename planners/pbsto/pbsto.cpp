#include "planners/pbsto/pbsto.hpp"

#include <algorithm>

#include "planners/search/search.hpp"

namespace jostle::planners {

using physics_pool::BatchReply;
using physics_pool::End;
using physics_pool::RolloutBatch;

namespace {

// Eq. 5.8: U*[t] = U[t] + sum_k exp(-C_k[t]/lambda)·dU_k[t] / sum_k exp(-C_k[t]/lambda).
ControlSequence weighted_mean(const RolloutBatch& noisy, const BatchReply& reply, double lambda) {
  const std::vector<Scored> samples = completed(noisy, reply);
  ControlSequence mean = noisy.nominal;
  if (samples.empty()) return mean;
  std::vector<double> costs(samples.size());
  for (int t = 0; t < mean.steps(); ++t) {
    for (std::size_t k = 0; k < samples.size(); ++k) {
      costs[k] = samples[k].step_costs[static_cast<std::size_t>(t)];
    }
    average_step(samples, exponential_weights(costs, lambda), t, mean);
  }
  return mean;
}

// The draws of a larger batch that are worth the fine model, in ascending order: the
// cheapest with long steps, and the first that succeeds with them. What comes after
// a success may or may not have run, so it does not count. Fewer than asked for if
// others diverged.
Result<std::vector<std::uint32_t>> screen(Search& search, RolloutBatch coarse, const PbstoOptions& options) {
  coarse.samples *= static_cast<std::uint32_t>(options.screening);
  coarse.fidelity.time_step = options.screening_time_step;
  coarse.stop_losers = false;  // ranks need every cost
  coarse.incumbent = 0.0;      // and nobody's states
  auto reply_result = search.run(coarse);
  if (!reply_result) return reply_result.error();
  std::vector<std::pair<double, std::uint32_t>> ranked;
  for (const auto& outcome : reply_result->outcomes) {
    if (outcome.end == End::kCompleted) ranked.emplace_back(outcome.cost, outcome.sample);
    if (outcome.end != End::kSucceeded) continue;
    ranked.emplace_back(-1.0, outcome.sample);
    break;
  }
  const std::size_t kept = std::min<std::size_t>(ranked.size(), static_cast<std::size_t>(options.rollouts));
  std::ranges::partial_sort(ranked, ranked.begin() + static_cast<std::ptrdiff_t>(kept));
  std::vector<std::uint32_t> draws;
  for (std::size_t i = 0; i < kept; ++i) draws.push_back(ranked[i].second);
  std::ranges::sort(draws);
  return draws;
}

Result<void> improve(Search& search, const PbstoOptions& options) {
  const bool weighted = options.update == PbstoOptions::Update::kCostWeighted;
  RolloutBatch noisy = search.around(search.best().controls);
  noisy.samples = static_cast<std::uint32_t>(options.rollouts);
  if (options.screening > 1) {
    auto draws_result = screen(search, noisy, options);
    if (!draws_result) return draws_result.error();
    if (draws_result->empty()) return {};  // every one diverged; the next draws may not
    noisy.law.draws = std::move(draws_result).value();
    noisy.samples = static_cast<std::uint32_t>(noisy.law.draws.size());
  }
  if (weighted) noisy.stop_losers = false;  // weights need every cost
  auto reply_result = search.run(noisy);
  if (!reply_result) return reply_result.error();
  if (weighted && !succeeded(*reply_result)) {
    return search.consider(weighted_mean(noisy, *reply_result, options.lambda));
  }
  search.adopt(noisy, *reply_result);
  return {};
}

}  // namespace

Pbsto::Pbsto(physics_pool::Pool& pool, PbstoOptions options, OnProgress on_progress)
    : pool_(pool), options_(std::move(options)), on_progress_(std::move(on_progress)) {}

Result<Plan> Pbsto::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  const RolloutBatch pattern{.step_duration = options_.step_duration,
                             .law = {.sigma = options_.sigma,
                                     .limit = options_.limit,
                                     .scales = options_.scales,
                                     .persistence = options_.persistence},
                             .stop_losers = options_.stop_losers,
                             .stop_hopeless = options_.stop_hopeless,
                             .min_steps = options_.min_steps,
                             .fidelity = {.freeze = options_.freeze}};
  Search search(pool_, problem, pattern, deadline, std::move(stop), on_progress_);
  return search.until_done([&] { return improve(search, options_); });
}

}  // namespace jostle::planners
