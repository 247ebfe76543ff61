#pragma once
/// \file
/// RecordedMotion: where everything was, at any time of a recorded run.

#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "services/bags/format/bag_reader.hpp"
#include "services/bags/recorded/recorded_run.hpp"

namespace jostle::bags {

/// What time is: the world's own, which may stand still while somebody plans, or that of
/// whoever watched.
enum class RunClock { kWorld, kWall };

class RecordedMotion {
 public:
  /// One moment, as measured.
  struct Sample {
    double time = 0.0;  ///< s since the run's first sample
    State state;        ///< v stays empty
    int action = 0;     ///< that was executed last, or is being executed
    int plan = -1;      ///< that was made last; -1: none yet
  };

  /// From the robot's and the objects' states of a bag; from the run's observations where
  /// it has none of those.
  /// Errors   kInvalidArgument  a state that does not fit the scene; those of BagReader
  static Result<RecordedMotion> read(BagReader& reader, const RecordedRun& run, const StateLayout& layout,
                                     RunClock clock);

  double duration() const { return samples_.back().time; }  ///< s

  /// Between two samples positions go straight and rotations turn evenly. Before the
  /// first and after the last it stands still.
  Sample at(double time) const;

 private:
  RecordedMotion(std::vector<Sample> samples, StateLayout layout)
      : samples_(std::move(samples)), layout_(std::move(layout)) {}

  std::vector<Sample> samples_;  // times go up; at least one
  StateLayout layout_;
};

}  // namespace jostle::bags
