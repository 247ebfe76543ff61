#pragma once
/// \file
/// The robustness graph: which parts of a plan can be executed without looking.

#include <span>
#include <string>
#include <vector>

#include "planners/api/robustness.hpp"

namespace jostle::planners {

struct GraphCosts {
  double robust = 1.0;         ///< c_ro, of a robust edge over one step; over n steps it costs c_ro/n
  double not_robust = 1000.0;  ///< c_nr, per step; far more than c_ro

  bool operator==(const GraphCosts&) const = default;
};

/// Divides a plan of N steps into segments that cost least together, in time order. The graph has the N + 1 borders as
/// its nodes and an edge from each to every later one:
///
///   i -> j   c_ro/(j - i)    if the segment's metric is at most `most`: robust
///            c_nr·(j - i)    otherwise
///
/// Of paths that cost the same the one with the fewest segments is taken, because closed-loop control over two steps
/// costs what it costs over each. No segment has 0 steps. N = 0 gives none. `steps`: [N_w + 1][N], the one-step metrics
/// of every world. `most`: the largest metric of what counts as robust; 1 is the thesis's, and only a little more keeps
/// free motion robust, where nothing shrinks or grows. Source   Sec. 4.2, Fig. 4.2
std::vector<Segment> find_segments(std::span<const std::vector<double>> steps, double most, const GraphCosts& costs);

/// Writes segments for people, the one under way in brackets: "open 0-2, [closed 2-4], open 4-5".
std::string to_text(std::span<const Segment> segments, int under_way);

}  // namespace jostle::planners
