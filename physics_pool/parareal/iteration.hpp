#pragma once
/// \file
/// The Parareal iteration of one trajectory, without threads or pools.

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "physics_pool/parareal/planar_update.hpp"

namespace jostle::physics_pool {

/// How often to iterate.
struct PararealStop {
  int iterations = 1;  ///< K, at most; N and more give the fine model bit for bit
  /// Ends earlier, once an iteration has moved no slider by more than this.
  bool adaptive = false;
  double translation_mm = 8.10;  ///< defaults: how repeatable real pushes are
  double rotation_deg = 4.20;    ///< (Yu et al., IROS 2016; Table 6.1)
  /// The `limit` of PlanarUpdate::correct; infinity is Eq. 6.3 to the letter.
  double correction_limit = std::numeric_limits<double>::infinity();
};

/// Iterates
///
///   x_{n+1}^{k+1} = C(x_n^{k+1}, u_n) + F(x_n^k, u_n) - C(x_n^k, u_n)     (6.3)
///
/// as a table of levels k = 0 … K and times n = 0 … N that is filled in as results of F
/// arrive, in whatever order: an entry is made as soon as the one before it and
/// F(x_n^k) are there, and the slice that starts from it may run at once, whatever the
/// others of its level do. Where x_n^{k+1} = x_n^k, bit for bit, x_{n+1}^{k+1} is
/// F(x_n^k) itself and its slice is not run again: so after level k the first k states
/// are the fine model's, and with K = N all are.
///
/// Threads  one at a time.
class PararealIteration {
 public:
  /// A piece of work: F(start, u_n).
  struct Slice {
    int id = 0;                    ///< for complete()
    int level = 0;                 ///< k
    int step = 0;                  ///< n
    const State* start = nullptr;  ///< valid while the iteration lives
  };

  /// `update` and `coarse` must outlive it. x0 and `controls` [N][2]; duration in s.
  PararealIteration(const PlanarUpdate& update, CoarseModel& coarse, const State& x0, ControlSequence controls,
                    double duration, const PararealStop& stop);

  /// Level 0 is made step by step, so that C may serve many trajectories at once: N times,
  /// `next_start` gives the state that C is to start from, and `guess` takes the state that C came to.
  void next_start(std::span<double> planar) const;
  void guess(std::span<const double> planar);

  /// Slices that may run and were not handed out before.
  std::vector<Slice> take_ready() { return std::exchange(ready_, {}); }

  /// Takes the end of a slice that F has run.
  void complete(int slice, State end);

  bool done() const { return final_level_.has_value(); }
  int iterations() const { return *final_level_; }  ///< k of states(); once done
  /// Returns x_0 … x_N after the last iteration, once done; or after k iterations.
  const std::vector<State>& states() const { return states(*final_level_); }
  const std::vector<State>& states(int k) const { return levels_[static_cast<std::size_t>(k)].states; }

  /// Says which prediction of the coarse model is not finite; empty if none.
  const std::string& problem() const { return problem_; }

 private:
  struct Level {
    std::vector<State> states;                // [N + 1], known up to `known`
    std::vector<std::vector<double>> starts;  // [N] x_n as C takes it
    std::vector<std::vector<double>> coarse;  // [N] C(x_n)
    std::vector<int> slices;                  // [N] index of the slice that starts there
    int known = 0;                            // states
  };

  Level& level(int k) { return levels_[static_cast<std::size_t>(k)]; }
  void begin();
  void know(int k, State x);
  void open_slice(int k, std::size_t n);
  void take_coarse(Level& here, std::size_t n, std::vector<double> planar, int k);
  void fill();
  void judge(int k);

  const PlanarUpdate& update_;
  CoarseModel& coarse_;
  ControlSequence controls_;
  double duration_;
  PararealStop stop_;
  int steps_;
  std::vector<Level> levels_;               // [K + 1]
  std::vector<std::optional<State>> fine_;  // by slice
  std::vector<Slice> ready_;
  std::optional<int> final_level_;
  std::string problem_;
};

}  // namespace jostle::physics_pool
