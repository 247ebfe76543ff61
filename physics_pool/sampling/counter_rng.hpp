#pragma once
/// \file
/// Counter-based random numbers: every draw is a pure function of its index,
/// so any worker can make any sample (Salmon et al., "Parallel Random Numbers:
/// As Easy as 1, 2, 3", SC 2011; Philox4x32-10 of Debian's Random123).

#include <array>
#include <cstdint>

namespace jostle::physics_pool {

/// What a draw is for. Draws for different purposes are independent, whatever their other numbers.
enum class Purpose : std::uint32_t {
  kControls = 0,        ///< a planner's samples, below kSamplingStreams; scenes and beliefs have the streams above
  kPredictedNoise = 1,  ///< physics of rollouts
  kExecutedNoise = 2,   ///< physics of the world in which actions happen
};

/// Planners use the streams below this; each of the generators of scenes and beliefs has one of its own above.
inline constexpr std::uint32_t kSamplingStreams = 0x9000;

/// Names one draw. Two draws with different indices are independent.
struct DrawIndex {
  std::uint32_t stream = 0;
  std::uint32_t sample = 0;
  std::uint32_t step = 0;
  std::uint32_t axis = 0;  ///< less than 2^24
  Purpose purpose = Purpose::kControls;
};

/// Draws one standard normal number (Box-Muller).
double standard_normal(std::uint64_t seed, const DrawIndex& index);

/// Draws one number, uniform in (0, 1).
double standard_uniform(std::uint64_t seed, const DrawIndex& index);

/// Draws one after the other from one stream, for generators that think in
/// sequence. Values do not depend on the standard library's distributions.
class CounterStream {
 public:
  CounterStream(std::uint64_t seed, std::uint32_t stream) : seed_(seed), stream_(stream) {}

  double uniform(double low, double high);
  double normal(double mean, double sigma);
  bool coin() { return uniform(0.0, 1.0) < 0.5; }

 private:
  DrawIndex next();

  std::uint64_t seed_;
  std::uint32_t stream_;
  std::uint64_t count_ = 0;
};

}  // namespace jostle::physics_pool
