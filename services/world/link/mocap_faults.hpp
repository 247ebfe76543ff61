#pragma once
/// \file
/// What a simulated motion capture does wrong, to order.

#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "perception/natnet/messages.hpp"

namespace CLI {
class App;
}

namespace jostle::world {

struct MocapFaultOptions {
  double noise = 0.0;    ///< m, standard deviation of a coordinate; of rotations 4 rad/m of it
  double hidden = 0.0;   ///< share of the frames in which a body is not tracked, in spells
  double swapped = 0.0;  ///< share of the frames in which two bodies have each other's markers, in spells
  double latency = 0.0;  ///< s, at most, that a frame is sent late; drawn for each
  std::uint64_t seed = 1;

  bool are_none() const { return noise == 0 && hidden == 0 && swapped == 0 && latency == 0; }
};

/// Adds --mocap-noise, --mocap-hidden, --mocap-swapped, --mocap-latency and --mocap-seed.
void add_mocap_fault_options(CLI::App& app, MocapFaultOptions& options);
/// Returns the arguments that say the same to another program with these options; none where there are no faults.
std::vector<std::string> arguments_of(const MocapFaultOptions& options);

/// Spoils one frame after the other. A spell lasts half a second in the mean, at 100 frames/s.
///
/// Threads  one at a time.
/// Repeats  equal seeds and frames give equal faults.
class MocapFaults {
 public:
  explicit MocapFaults(const MocapFaultOptions& options) : options_(options), random_(options.seed) {}

  void spoil(perception::natnet::Frame& frame);
  /// Returns how late the next frame is sent, s.
  double latency();

 private:
  bool chance(double share) { return std::bernoulli_distribution(share)(random_); }
  /// Whether the spell goes on, or one begins.
  bool next(bool is_on, double share);
  void shake(perception::natnet::Body& body);

  MocapFaultOptions options_;
  std::mt19937_64 random_;
  std::vector<bool> hidden_;  // of each body
  bool is_swapped_ = false;
  std::size_t first_ = 0, second_ = 0;  // swapped
};

}  // namespace jostle::world
