#include "services/pool/client/timeline.hpp"

#include <algorithm>
#include <map>
#include <tuple>

namespace jostle::pool {
namespace {

using physics_pool::WorkerStatus;

// worker-2 before worker-10.
auto place_of(const std::string& worker, std::uint32_t thread) { return std::tuple(worker.size(), worker, thread); }
using Place = decltype(place_of("", 0));

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// Sizes and gaps of a row, from its bars in order of time.
void sum_up(Timeline& timeline) {
  std::vector<double> idle_since(timeline.rows.size(), 0.0);
  const auto gap = [&](std::size_t row, double until) {
    double& longest = timeline.rows[row].longest_gap;
    longest = std::max(longest, until - idle_since[row]);
  };
  for (const Timeline::Bar& bar : timeline.bars) {
    const auto row = static_cast<std::size_t>(bar.row);
    gap(row, bar.from);
    idle_since[row] = std::max(idle_since[row], bar.to);
    timeline.rows[row].busy += bar.to - bar.from;
    timeline.rows[row].samples += 1;
    timeline.rows[row].copies += bar.first ? 0 : 1;
  }
  double busy = 0.0;
  for (std::size_t row = 0; row < timeline.rows.size(); ++row) {
    gap(row, timeline.length);
    busy += timeline.rows[row].busy;
  }
  const double available = timeline.length * static_cast<double>(timeline.rows.size());
  timeline.efficiency = available > 0 ? busy / available : 0.0;
}

}  // namespace

void ClockOffset::add(const SampleTrace& trace) {
  const double there = trace.arrived - trace.sent, back = trace.received - trace.finished;
  there_ = any_ ? std::min(there_, there) : there;
  back_ = any_ ? std::min(back_, back) : back;
  any_ = true;
}

Timeline timeline_of(const std::vector<SampleTrace>& traces, const std::vector<WorkerStatus>& workers) {
  Timeline timeline;
  std::map<Place, int> row_of;
  for (const WorkerStatus& worker : workers) {
    for (int thread = 0; thread < worker.capacity; ++thread)
      row_of[place_of(worker.name, static_cast<std::uint32_t>(thread))] = 0;
  }
  std::map<std::uint64_t, ClockOffset> clocks;
  for (const SampleTrace& trace : traces) {
    row_of[place_of(trace.worker_name, trace.thread)] = 0;
    clocks[trace.worker].add(trace);
  }
  for (auto& [place, row] : row_of) {
    row = static_cast<int>(timeline.rows.size());
    timeline.rows.push_back({.worker = std::get<1>(place), .thread = std::get<2>(place)});
  }
  if (traces.empty()) return timeline;

  const double start = std::ranges::min(traces, {}, &SampleTrace::sent).sent;
  timeline.length = std::ranges::max(traces, {}, &SampleTrace::received).received - start;
  std::vector<double> on_the_way, in_line;
  for (const SampleTrace& trace : traces) {
    const double ahead = clocks[trace.worker].seconds();
    timeline.bars.push_back({.row = row_of[place_of(trace.worker_name, trace.thread)],
                             .from = trace.started - ahead - start,
                             .to = trace.finished - ahead - start,
                             .client = trace.client,
                             .epoch = trace.epoch,
                             .first = trace.first});
    on_the_way.push_back(trace.received - trace.sent - (trace.finished - trace.arrived));
    in_line.push_back(trace.started - trace.arrived);
  }
  std::ranges::sort(timeline.bars, {}, [](const Timeline::Bar& bar) { return std::pair(bar.row, bar.from); });
  for (const auto& [worker, clock] : clocks) timeline.clock_error = std::max(timeline.clock_error, clock.error());
  timeline.on_the_way = median_of(std::move(on_the_way));
  timeline.in_line = median_of(std::move(in_line));
  sum_up(timeline);
  return timeline;
}

}  // namespace jostle::pool
