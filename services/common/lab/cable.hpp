#pragma once
/// \file
/// Network cables that take time and lose frames.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <thread>
#include <vector>

namespace jostle::common {

/// What happens to each frame that leaves a host; those that come to it pass as they
/// are. It is so with netem at the interface of each host, too (`tc qdisc add dev eth root netem
/// delay 5ms loss 1%`): between two hosts a frame takes `delay` and is lost with
/// probability `loss`, a round trip takes twice the delay.
struct LinkQuality {
  std::chrono::microseconds delay{0};  ///< >= 0
  double loss = 0.0;                   ///< probability in [0, 1]
  std::uint64_t seed = 1;              ///< what the losses are drawn from

  bool perfect() const { return delay.count() == 0 && loss == 0.0; }
};

/// Decides for one direction of one cable which frames are lost: the n-th frame's fate
/// is a function of seed, direction and n alone.
class Losses {
 public:
  Losses(const LinkQuality& quality, std::uint64_t direction)
      : loss_(quality.loss), random_(quality.seed + direction) {}

  bool next() { return static_cast<double>(random_() >> 11) * 0x1.0p-53 < loss_; }

 private:
  double loss_;
  std::mt19937_64 random_;  // its sequence is fixed by the standard; uniform_real_distribution's is not
};

struct CableCounts {
  std::uint64_t carried = 0, lost = 0;  ///< frames
};

/// Carries frames between the ends of cables, which are TAP devices.
///
/// Threads  one of its own carries; the rest from one thread, counts() from any.
class Cables {
 public:
  explicit Cables(const LinkQuality& quality) : quality_(quality) {}
  ~Cables();
  Cables(const Cables&) = delete;
  Cables& operator=(const Cables&) = delete;

  /// Takes two non-blocking TAP devices, and closes them in the end. Must not be called after start().
  void add(int host_end, int switch_end);
  void start();

  CableCounts counts() const { return {.carried = carried_, .lost = lost_}; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Frame {
    Clock::time_point due;
    std::vector<std::uint8_t> bytes;
  };
  struct Cable {
    int host_end = -1, switch_end = -1;
    Losses losses;
    std::deque<Frame> under_way{};  // from the host, earliest first
  };

  void carry(std::stop_token stop);
  void accept(Cable& cable);
  void deliver(Cable& cable);
  void pass(Cable& cable);
  std::optional<Clock::time_point> next_due() const;

  const LinkQuality quality_;
  std::vector<Cable> cables_;
  std::atomic<std::uint64_t> carried_ = 0, lost_ = 0;
  int bell_ = -1;  // eventfd, rings at the end
  std::jthread carrier_;
};

}  // namespace jostle::common
