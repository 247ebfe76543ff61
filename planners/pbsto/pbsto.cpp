#include "planners/pbsto/pbsto.hpp"

#include "planners/search/search.hpp"

namespace jostle::planners {

using physics_pool::BatchReply;
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

Result<void> improve(Search& search, const PbstoOptions& options) {
  const bool weighted = options.update == PbstoOptions::Update::kCostWeighted;
  RolloutBatch noisy = search.around(search.best().controls);
  noisy.samples = static_cast<std::uint32_t>(options.rollouts);
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
                             .law = {.sigma = options_.sigma, .limit = options_.limit, .scales = options_.scales},
                             .objective = options_.objective,
                             .stop_losers = options_.stop_losers,
                             .min_steps = options_.min_steps};
  Search search(pool_, problem, pattern, deadline, std::move(stop), on_progress_);
  return search.until_done([&] { return improve(search, options_); });
}

}  // namespace jostle::planners
