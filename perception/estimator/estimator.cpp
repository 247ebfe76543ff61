#include "perception/estimator/estimator.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace jostle::perception {
namespace {

constexpr std::size_t kMostSteps = 256;  // of a track: a world that stands still may be measured for ever at one time
constexpr double kGoesOn = 0.15;         // s after it was seen last
constexpr double kClear = 12.0;          // difference of log weights beyond which a hypothesis is given up
constexpr double kSame = 0.05;           // squared Mahalanobis distance of hypotheses that have become one

}  // namespace

const Estimator::Hypothesis& Estimator::State::likeliest() const {
  return *std::ranges::max_element(hypotheses, {}, &Hypothesis::log_weight);
}

void Estimator::State::predict(double to) {
  for (Hypothesis& hypothesis : hypotheses) hypothesis.filter.predict(to - time);
  time = std::max(time, to);
}

Result<Estimator::Event> Estimator::checked(double time, const Sighting& sighting) {
  const auto complaint = [&](const char* field, const char* wanted) {
    return invalid(fmt::format("sighting of '{}': {}", sighting.name, field), "something else", wanted);
  };
  if (!std::isfinite(time)) return complaint("time", "a finite number of seconds");
  if (sighting.explanations.empty()) return complaint("explanations", "at least one");
  if (!(sighting.steady >= 0 && sighting.steady <= 1)) return complaint("steady", "a share, 0 to 1");
  Event event{.time = time, .candidates = {}, .steady = sighting.steady};
  for (const Explanation& explanation : sighting.explanations) {
    const auto& [p, q] = explanation.X_WB;
    PoseBelief pose{.p = {p[0], p[1], p[2]}, .R = {q[0], q[1], q[2], q[3]}};
    if (!pose.p.allFinite()) return complaint("position", "finite numbers, m");
    const double length = pose.R.norm();
    if (!std::isfinite(length) || length < 0.5) return complaint("orientation", "a unit quaternion");
    pose.R.normalize();
    const Eigen::Map<const Matrix6d> covariance(explanation.covariance.data());
    pose.covariance = (covariance + covariance.transpose()) / 2;
    if (!pose.covariance.allFinite() || Eigen::LLT<Matrix6d>(pose.covariance).info() != Eigen::Success)
      return complaint("covariance", "a symmetric and positive definite matrix");
    if (!std::isfinite(explanation.surprise)) return complaint("surprise", "a finite number");
    event.candidates.push_back({pose, explanation.surprise});
  }
  return event;
}

Estimator::State Estimator::begun(const Event& event) const {
  State state{.time = event.time, .last_seen = event.time, .hypotheses = {}};
  for (const Candidate& candidate : event.candidates)
    state.hypotheses.push_back({PoseFilter(candidate.pose, options_.motion), -candidate.surprise / 2});
  return state;
}

// Returns whether the event is believed.
bool Estimator::apply(State& state, const Event& event) const {
  if (event.relocates) {
    state = begun(event);
    return true;
  }
  state.predict(event.time);
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  std::vector<double> gained;  // by each hypothesis
  for (Hypothesis& hypothesis : state.hypotheses) {
    const Candidate* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const Candidate& candidate : event.candidates) {
      const double distance = hypothesis.filter.distance(candidate.pose);
      if (distance > options_.gate || distance + candidate.surprise >= least) continue;
      best = &candidate;
      least = distance + candidate.surprise;
    }
    gained.push_back(best ? hypothesis.filter.update(best->pose) - best->surprise / 2 : kNone);
  }
  const double most = *std::ranges::max_element(gained);
  if (most == kNone) return false;
  // One that does not explain an event may be right, and the event an outlier.
  for (std::size_t i = 0; i < gained.size(); ++i)
    state.hypotheses[i].log_weight += std::max(gained[i] - most, -kClear / 2);
  state.last_seen = std::max(state.last_seen, event.time);
  const Hypothesis first = state.likeliest();
  std::erase_if(state.hypotheses, [&](const Hypothesis& other) {
    return other.log_weight < first.log_weight &&
           (other.log_weight < first.log_weight - kClear || first.filter.distance(other.filter.pose()) < kSame);
  });
  return true;
}

Estimator::Match Estimator::match(const Track& track, const Event& event) {
  const auto next =
      std::ranges::upper_bound(track.steps, event.time, {}, [](const Step& step) { return step.event.time; });
  State state = next == track.steps.begin() ? track.steps.front().after : std::prev(next)->after;
  state.predict(event.time);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Match best{kInfinity, -kInfinity};
  for (const Hypothesis& hypothesis : state.hypotheses) {
    for (const Candidate& candidate : event.candidates) {
      PoseFilter filter = hypothesis.filter;
      best.distance = std::min(best.distance, filter.distance(candidate.pose));
      best.log_likelihood = std::max(best.log_likelihood, filter.update(candidate.pose) - candidate.surprise / 2);
    }
  }
  return best;
}

// Puts an event in its place. Returns whether there was one.
bool Estimator::insert(Track& track, Event event) {
  auto& steps = track.steps;
  auto place = std::ranges::upper_bound(steps, event.time, {}, [](const Step& step) { return step.event.time; });
  if (place == steps.begin() || steps.back().event.time - event.time > options_.history) return false;
  State state = std::prev(place)->after;
  (void)apply(state, event);
  place = steps.insert(place, {std::move(event), std::move(state)});
  for (auto step = std::next(place); step != steps.end(); ++step) {
    step->after = std::prev(step)->after;
    (void)apply(step->after, step->event);
  }
  while (steps.size() > kMostSteps ||
         (steps.size() > 2 && steps[1].event.time < steps.back().event.time - options_.history))
    steps.pop_front();
  return true;
}

void Estimator::believe(Track& track, Event event) {
  if (!insert(track, std::move(event))) {
    ++counts_.late;
    return;
  }
  ++counts_.taken;
  track.believed = 2;
  track.strays.clear();
}

bool Estimator::agree(const Event& a, const Event& b) const {
  const double dt = std::abs(a.time - b.time);
  const auto within = [dt](double per_second) { return per_second * per_second * dt * dt; };
  for (const Candidate& one : a.candidates) {
    for (const Candidate& other : b.candidates) {
      Matrix6d spread = one.pose.covariance + other.pose.covariance;
      spread.diagonal().head<3>().array() += within(options_.motion.speed);
      spread.diagonal().tail<3>().array() += within(options_.motion.turning);
      const Vector6d off = difference(one.pose, other.pose);
      if (off.dot(spread.llt().solve(off)) < options_.gate) return true;
    }
  }
  return false;
}

void Estimator::doubt(Track& track, Event event) {
  const double oldest = event.time - options_.history;
  std::erase_if(track.strays, [&](const Event& stray) { return stray.time < oldest; });
  const auto agreeing = std::ranges::count_if(track.strays, [&](const Event& stray) { return agree(stray, event); });
  const int wanted = track.believed > 1 ? options_.relocation : 2;
  if (agreeing + 1 < wanted) {
    track.strays.push_back(std::move(event));
    if (track.strays.size() > kMostSteps) track.strays.erase(track.strays.begin());
    ++counts_.outliers;
    return;
  }
  event.relocates = true;
  if (insert(track, std::move(event))) ++counts_.moved;
  track.believed = 2;
  track.strays.clear();
}

// Sightings that are where another object is expected, while their own is expected elsewhere or was not seen for a
// while.
void Estimator::sort_out(double time, std::vector<Place>& places) {
  const auto is_out = [&](const Place& place) { return place.own.distance > options_.gate; };
  // Where it is expected says more than where it may have moved to, which after a pause is nearly anywhere.
  const auto is_rather = [&](const Track& other, const Place& place) {
    const Match there = match(other, place.event);
    return there.distance <= options_.gate && (is_out(place) || there.log_likelihood > place.own.log_likelihood);
  };
  std::vector<Track*> owners(places.size(), nullptr);
  for (std::size_t i = 0; i < places.size(); ++i) {
    Track* const own = places[i].track;
    owners[i] = own;
    if (!is_out(places[i]) && time - own->steps.back().after.last_seen <= options_.unseen_after) continue;
    for (auto& [name, other] : tracks_) {
      if (&other == own || other.believed < 2 || !is_rather(other, places[i])) continue;
      const auto seen = std::ranges::find(places, &other, &Place::track);
      // A ghost of an object that is there, or that is not seen: nothing is learnt from it.
      owners[i] = seen != places.end() && is_out(*seen) ? &other : nullptr;
      break;
    }
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!owners[i]) {
      ++counts_.outliers;
    } else if (owners[i] != places[i].track) {
      ++counts_.swapped;
      believe(*owners[i], std::move(places[i].event));
    } else if (is_out(places[i])) {
      doubt(*owners[i], std::move(places[i].event));
    } else {
      believe(*owners[i], std::move(places[i].event));
    }
  }
}

Result<void> Estimator::take(double time, const std::vector<Sighting>& seen) {
  Result<void> result;
  std::vector<Place> places;
  for (const Sighting& sighting : seen) {
    auto event_result = checked(time, sighting);
    if (!event_result) {
      result = event_result.error();
      continue;
    }
    const auto [found, is_new] = tracks_.try_emplace(sighting.name);
    Track& track = found->second;
    if (is_new) {
      State state = begun(*event_result);
      track.steps.push_back({std::move(event_result).value(), std::move(state)});
      ++counts_.taken;
      continue;
    }
    const Match own = match(track, *event_result);
    places.push_back({&track, std::move(event_result).value(), own});
  }
  sort_out(time, places);
  return result;
}

std::vector<Estimate> Estimator::at(double time) const {
  std::vector<Estimate> estimates;
  for (const auto& [name, track] : tracks_) {
    if (track.believed < 2) continue;
    State state = track.steps.back().after;
    // It goes on for a moment; then nobody knows, and it is kept where it was.
    state.predict(std::min(time, std::max(state.last_seen + kGoesOn, state.time)));
    const PoseFilter filter = state.likeliest().filter;
    PoseBelief pose = filter.pose();
    const bool goes_on = time <= state.time;
    const Eigen::Vector3d still(0, 0, 0), v = goes_on ? filter.linear() : still;
    const Eigen::Vector3d w = goes_on ? Eigen::Vector3d(pose.R.conjugate() * filter.angular()) : still;
    state.predict(time);
    pose.covariance = state.likeliest().filter.pose().covariance;
    Estimate estimate{.reading = {.name = name,
                                  .position = {pose.p.x(), pose.p.y(), pose.p.z()},
                                  .orientation = {pose.R.w(), pose.R.x(), pose.R.y(), pose.R.z()},
                                  .linear = {v.x(), v.y(), v.z()},
                                  .angular = {w.x(), w.y(), w.z()}},
                      .last_seen = state.last_seen,
                      .seen = time - state.last_seen <= options_.unseen_after,
                      .rests = filter.rests() || !goes_on};
    Eigen::Map<Matrix6d> covariance(estimate.covariance.data());
    const Event& newest = track.steps.back().event;
    covariance = pose.covariance + newest.steady * newest.candidates.front().pose.covariance;
    covariance.diagonal().head<3>().array() += options_.systematic * options_.systematic;
    covariance.diagonal().tail<3>().array() += options_.systematic_turning * options_.systematic_turning;
    estimates.push_back(std::move(estimate));
  }
  return estimates;
}

}  // namespace jostle::perception
