#pragma once
/// \file
/// Estimator: one estimate of every object, from what any number of sensors see of them.

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "idl/types/pose.hpp"
#include "idl/types/result.hpp"
#include "perception/api/object_source.hpp"
#include "perception/estimator/pose_filter.hpp"

namespace jostle::perception {

/// A pose that explains what a sensor saw.
struct Explanation {
  Pose X_WB;
  /// [6][6] of (translation, m; rotation vector, rad), both in world axes: R_true = exp(rotation) R. Symmetric, > 0.
  std::array<double, 36> covariance{};
  /// How much worse it explains what was seen than the best one does: -2 times the logarithm of the likelihoods' ratio.
  double surprise = 0.0;
};

/// One object, as it was seen once: one explanation, or two where a tag may be flipped.
struct Sighting {
  std::string name;
  std::vector<Explanation> explanations;
  /// Share of the covariance, 0 to 1, that is the same each time the object is seen at rest: no averaging removes it.
  double steady = 0.0;
};

struct EstimatorOptions {
  MotionModel motion;
  /// Squared Mahalanobis distance, 6 degrees of freedom, beyond which a measurement is an outlier: one in 25 000 of
  /// those that are not.
  double gate = 30.0;
  /// So many measurements that agree with one another, while none agrees with the estimate, are where the object is.
  int relocation = 5;
  double history = 0.5;  ///< s, that a measurement may be late
  /// What no averaging removes: of calibration, and of the place of a tag or of markers on the object.
  double systematic = 0.0005;         ///< m, standard deviation
  double systematic_turning = 0.002;  ///< rad
  double unseen_after = 0.25;         ///< s
};

/// What is known of an object.
struct Estimate {
  ObjectReading reading;
  std::array<double, 36> covariance{};  ///< as that of an Explanation
  double last_seen = 0.0;               ///< s, of the newest measurement that was believed
  bool seen = true;                     ///< whether that is not long ago
  bool rests = true;                    ///< velocities are 0 then
};

/// An Estimator has a PoseFilter for each object. A measurement that is late is put in its place: the filter starts
/// again from before it, with all that came since. Of two explanations the one counts that fits; at the start, when
/// nobody knows which is flipped, both are followed until one is much likelier. What is far from where the object is
/// expected is an outlier. If two objects are each where the other is expected, their markers were swapped, and are
/// swapped back. An object that is not seen is kept where it was, ever less surely.
///
/// Known only after it was seen twice, in agreement: the first time may be an outlier.
///
/// Threads  one at a time.
/// Repeats  equal calls give equal estimates.
class Estimator {
 public:
  struct Counts {
    std::uint64_t taken = 0;
    std::uint64_t outliers = 0;  ///< sightings that were not believed
    std::uint64_t swapped = 0;   ///< that were taken for another object than they said
    std::uint64_t moved = 0;     ///< that put an object elsewhere, after others that agreed
    std::uint64_t late = 0;      ///< too late to be put in their place
  };

  explicit Estimator(const EstimatorOptions& options = {}) : options_(options) {}

  /// Takes what one sensor saw at `time`, s.
  /// Error kInvalidArgument: a number that is not finite, no rotation, or a covariance that is none; says whose. The
  /// other sightings are taken all the same.
  Result<void> take(double time, const std::vector<Sighting>& seen);

  /// Returns every object, by its name, as it is known at `time`, s: with everything that was taken, for a time that is
  /// not before the newest measurement.
  std::vector<Estimate> at(double time) const;

  const Counts& counts() const { return counts_; }

 private:
  struct Candidate {
    PoseBelief pose;
    double surprise = 0.0;
  };
  struct Hypothesis {
    PoseFilter filter;
    double log_weight = 0.0;
  };
  struct State {
    double time = 0.0, last_seen = 0.0;
    std::vector<Hypothesis> hypotheses;  // never empty

    const Hypothesis& likeliest() const;
    void predict(double to);
  };
  struct Event {  // a measurement
    double time = 0.0;
    std::vector<Candidate> candidates;
    double steady = 0.0;  // see Sighting
    bool relocates = false;
  };
  struct Step {
    Event event;
    State after;
  };
  struct Track {
    std::deque<Step> steps;     // by time, never empty
    std::vector<Event> strays;  // that were not believed, newest last
    int believed = 1;           // 2: twice or more
  };
  struct Match {                  // of an event with a track
    double distance = 0.0;        // the least of any hypothesis and candidate
    double log_likelihood = 0.0;  // the most
  };
  struct Place {  // of a sighting in its frame
    Track* track = nullptr;
    Event event;
    Match own;
  };

  static Result<Event> checked(double time, const Sighting& sighting);
  State begun(const Event& event) const;
  bool apply(State& state, const Event& event) const;
  static Match match(const Track& track, const Event& event);
  bool insert(Track& track, Event event);
  void sort_out(double time, std::vector<Place>& places);
  void believe(Track& track, Event event);
  void doubt(Track& track, Event event);
  bool agree(const Event& a, const Event& b) const;

  EstimatorOptions options_;
  std::map<std::string, Track> tracks_;
  Counts counts_;
};

}  // namespace jostle::perception
