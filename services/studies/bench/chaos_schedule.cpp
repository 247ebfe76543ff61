#include "services/studies/bench/chaos_schedule.hpp"

#include <algorithm>
#include <random>

namespace jostle::studies {
namespace {

using std::chrono::milliseconds;

// The standard fixes the engine's sequence, but not what its distributions make of it.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}

  // low to high - 1, each as often but for one in 2^64 / (high - low).
  int between(int low, int high) { return low + static_cast<int>(random_() % static_cast<std::uint64_t>(high - low)); }

  milliseconds time(milliseconds low, milliseconds high) {
    return milliseconds(between(static_cast<int>(low.count()), static_cast<int>(high.count()) + 1));
  }

 private:
  std::mt19937_64 random_;
};

milliseconds duration(Fault::Kind kind, Dice& dice) {
  return kind == Fault::Kind::kKill ? dice.time(milliseconds(50), milliseconds(500))
                                    : dice.time(milliseconds(100), milliseconds(3000));
}

}  // namespace

std::string to_string(Fault::Kind kind) {
  switch (kind) {
    case Fault::Kind::kKill:
      return "kill";
    case Fault::Kind::kStall:
      return "stall";
    case Fault::Kind::kUnplug:
      return "unplug";
  }
  return "";
}

std::vector<Fault> chaos_schedule(std::uint64_t seed, int faults, int workers, int hosts) {
  Dice dice(seed);
  std::vector<milliseconds> workers_well(static_cast<std::size_t>(workers));  // since when
  std::vector<milliseconds> hosts_well(static_cast<std::size_t>(hosts));
  std::vector<Fault> schedule;
  milliseconds now{0};
  for (int i = 0; i < faults; ++i) {
    now += dice.time(milliseconds(100), milliseconds(700));
    const auto kind = static_cast<Fault::Kind>(dice.between(0, hosts > 0 ? 3 : 2));
    auto& well = kind == Fault::Kind::kUnplug ? hosts_well : workers_well;
    now = std::max(now, *std::ranges::min_element(well));
    std::vector<int> candidates;
    for (std::size_t target = 0; target < well.size(); ++target) {
      if (well[target] <= now) candidates.push_back(static_cast<int>(target));
    }
    const int target = candidates[static_cast<std::size_t>(dice.between(0, static_cast<int>(candidates.size())))];
    schedule.push_back({.kind = kind, .target = target, .at = now, .lasts = duration(kind, dice)});
    well[static_cast<std::size_t>(target)] = now + schedule.back().lasts;
  }
  return schedule;
}

}  // namespace jostle::studies
