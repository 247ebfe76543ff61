#include "planners/robustness/segments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/dag_shortest_paths.hpp>
#include <limits>
#include <tuple>

#include "planners/robustness/divergence.hpp"

namespace jostle::planners {
namespace {

// Of an edge or a path. Its two kinds of cost are kept apart until they are compared: so paths with the same robust
// edges cost the same to the last bit, however their other steps are divided.
struct Length {
  double robust = 0.0;  // sum of 1/n over robust edges
  int not_robust = 0;   // steps
  int edges = 0;

  double cost(const GraphCosts& costs) const { return costs.robust * robust + costs.not_robust * not_robust; }
};

Length operator+(const Length& a, const Length& b) {
  return {.robust = a.robust + b.robust, .not_robust = a.not_robust + b.not_robust, .edges = a.edges + b.edges};
}

struct Edge {
  Segment segment;
  Length length;
};

using Graph = boost::adjacency_list<boost::vecS, boost::vecS, boost::directedS, boost::no_property, Edge>;

Graph robustness_graph(std::span<const std::vector<double>> steps, int n, double most) {
  Graph graph(static_cast<std::size_t>(n) + 1);
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j <= n; ++j) {
      const double metric = segment_metric(steps, i, j);
      const bool is_robust = metric <= most;
      const Length length =
          is_robust ? Length{.robust = 1.0 / (j - i), .edges = 1} : Length{.not_robust = j - i, .edges = 1};
      const Segment segment{.from = i, .to = j, .is_robust = is_robust, .metric = metric};
      boost::add_edge(static_cast<std::size_t>(i), static_cast<std::size_t>(j), Edge{segment, length}, graph);
    }
  }
  return graph;
}

}  // namespace

std::vector<Segment> find_segments(std::span<const std::vector<double>> steps, double most, const GraphCosts& costs) {
  const int n = steps.empty() ? 0 : static_cast<int>(steps.front().size());
  const Graph graph = robustness_graph(steps, n, most);
  const auto is_less = [&](const Length& a, const Length& b) {
    return std::tuple(a.cost(costs), a.edges) < std::tuple(b.cost(costs), b.edges);
  };
  std::vector<std::size_t> before(boost::num_vertices(graph));
  std::vector<Length> lengths(boost::num_vertices(graph));
  boost::dag_shortest_paths(graph, std::size_t{0},
                            boost::weight_map(boost::get(&Edge::length, graph))
                                .predecessor_map(before.data())
                                .distance_map(lengths.data())
                                .distance_compare(is_less)
                                .distance_combine(std::plus<Length>())
                                .distance_zero(Length{})
                                .distance_inf(Length{.robust = std::numeric_limits<double>::infinity()}));
  std::vector<Segment> segments;
  for (auto to = static_cast<std::size_t>(n); to != 0; to = before[to]) {
    segments.push_back(graph[boost::edge(before[to], to, graph).first].segment);
  }
  std::ranges::reverse(segments);
  return segments;
}

std::string to_text(std::span<const Segment> segments, int under_way) {
  std::string text;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const auto& [from, to, is_robust, metric] = segments[i];
    const std::string one = fmt::format("{} {}-{}", is_robust ? "open" : "closed", from, to);
    text += text.empty() ? "" : ", ";
    text += static_cast<int>(i) == under_way ? "[" + one + "]" : one;
  }
  return text;
}

}  // namespace jostle::planners
