#include "services/studies/train_coarse/fit.hpp"

namespace jostle::studies {
namespace {

Error no_torch() {
  return {Code::kUnavailable, "built without libtorch; install libtorch-dev (scripts/install does) and build again"};
}

}  // namespace

bool can_fit() { return false; }

Result<physics_pool::Network> fit(const TransitionFile&, const FitOptions&, std::stop_token,
                                  const std::function<void(const FitProgress&)>&) {
  return no_torch();
}

Result<double> largest_difference(const physics_pool::Network&, const TransitionFile&) { return no_torch(); }

}  // namespace jostle::studies
