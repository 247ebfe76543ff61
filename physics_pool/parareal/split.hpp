#pragma once
/// \file
/// How much parallelism goes across samples, and how much across time.

#include <string>

namespace jostle::physics_pool {

/// What a batch is made of, and what it runs on.
struct SplitProblem {
  int samples = 1;      ///< K
  int steps = 1;        ///< N slices each
  int workers = 1;      ///< rollouts at a time
  int iterations = 1;   ///< of Parareal, the K of Eq. 6.4
  double coarse = 0.0;  ///< c_c, s per slice
  double fine = 0.0;    ///< c_f, s per slice
};

/// The first `whole` samples run as whole rollouts, the others in slices.
struct Split {
  int whole = 0, sliced = 0;
  double seconds = 0.0;     ///< expected of this choice
  double all_whole = 0.0;   ///< expected of rollouts alone
  double all_sliced = 0.0;  ///< expected of slices alone
  double speed_up = 0.0;    ///< of one sliced sample over a serial one, Eq. 6.4
};

/// Returns the speed-up of one sample on P workers over serial fine steps, for K iterations:
///
///   s = 1/[(1 + K)·c_c/c_f + K/P]     (6.4), P at most N
double parareal_speed_up(int iterations, int workers, int steps, double coarse, double fine);

/// Returns the quickest of all choices by this model of time: a worker runs whole samples one
/// after the other; sliced samples share what is left. An iteration skips what has
/// converged, so a sample costs sum_{k<K} (N - k) slices, and takes at least K of them
/// in a row. Ties go to whole rollouts, which are exact.
Split choose_split(const SplitProblem& problem);

/// Says in one line what was chosen, and why.
std::string explain(const Split& split, const SplitProblem& problem);

}  // namespace jostle::physics_pool
