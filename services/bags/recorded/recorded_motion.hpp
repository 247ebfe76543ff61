#pragma once
/// \file
/// RecordedMotion: where everything was, at any time of a recorded run.

#include <cstdint>
#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "services/bags/format/bag_reader.hpp"
#include "services/bags/recorded/recorded_run.hpp"

namespace jostle::bags {

/// Whose time counts: the world's own, which may stand still while somebody plans, or that of
/// whoever watched.
enum class RunClock { kWorld, kWall };

class RecordedMotion {
 public:
  /// One moment, as measured.
  struct Sample {
    double time = 0.0;  ///< s since the run's first sample
    State state;        ///< v stays empty
    int action = 0;     ///< the action that was executed last, or is being executed
    int plan = -1;      ///< the plan that was made last; -1: none yet
  };

  /// Reads the robot's and the objects' states from a bag; the run's observations where
  /// the bag has no states, or none that can be read.
  /// Errors   kInvalidArgument  a state that does not fit the scene; those of BagReader
  static Result<RecordedMotion> read(BagReader& reader, const RecordedRun& run, const StateLayout& layout,
                                     RunClock clock);

  double duration() const { return samples_.back().time; }  ///< s
  std::uint64_t unreadable() const { return unreadable_; }  ///< states in the bag that cannot be read
  double world_begin() const { return world_begin_; }       ///< s of the world's clock, at the first sample

  /// Interpolates: between two samples positions go straight and rotations turn evenly. Before the
  /// first and after the last one, everything stands still.
  Sample at(double time) const;

 private:
  RecordedMotion(std::vector<Sample> samples, StateLayout layout, double world_begin, std::uint64_t unreadable)
      : samples_(std::move(samples)), layout_(std::move(layout)), world_begin_(world_begin), unreadable_(unreadable) {}

  std::vector<Sample> samples_;  // times go up; at least one
  StateLayout layout_;
  double world_begin_;  // s
  std::uint64_t unreadable_;
};

}  // namespace jostle::bags
