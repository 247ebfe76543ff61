#pragma once
/// \file
/// What a planner that weighs robustness finds out about its plan. planners/robustness has the metrics.

#include <vector>

namespace jostle::planners {

/// An E-hat of few trajectories, and how far it can be trusted.
struct Estimate {
  double value = 1.0;
  /// Standard error of the value over the choice of the N_c starts, by the jackknife: each start is left out once, of
  /// all worlds together. Of a maximum it tells less, since a maximum over more starts can only be larger. Infinite for
  /// fewer than 2 trajectories, and where the value is.
  double spread = 0.0;

  bool operator==(const Estimate&) const = default;
};

/// The part of a plan between two borders of its control steps, u_from … u_{to-1}.
struct Segment {
  int from = 0, to = 0;
  bool is_robust = false;
  double metric = 0.0;  ///< E-hat of the segment (Eq. 4.26), the largest over worlds

  bool operator==(const Segment&) const = default;
};

/// Divergence metrics of a whole plan, and of its parts. They are estimates from a few rollouts each, no bounds.
struct Robustness {
  Estimate expected, maximal;                  ///< E-hat^r, the largest over all worlds (Eq. 4.23)
  Estimate nominal_expected, nominal_maximal;  ///< E-hat^f, in the planning world (Eq. 4.18, 4.19)
  Estimate realized_expected,
      realized_maximal;                    ///< the largest over the N_w other worlds; as nominal if there are none
  std::vector<std::vector<double>> steps;  ///< [N_w + 1][N] expected metric of each step (Eq. 4.25), nominal first
  std::vector<Segment> segments;           ///< that the robustness graph divides the plan into

  bool operator==(const Robustness&) const = default;
};

}  // namespace jostle::planners
