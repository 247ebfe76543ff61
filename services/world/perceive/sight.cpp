#include "services/world/perceive/sight.hpp"

#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "physics_pool/feasible/nearest_state.hpp"
#include "services/world/perceive/detections.hpp"

namespace jostle::world {
namespace {

using perception::Estimate;

constexpr auto kUnseen = std::chrono::seconds(1);                // worth a word
constexpr auto kStandardForms = std::chrono::milliseconds(100);  // between two messages of them
constexpr auto kFirstLook = std::chrono::seconds(3);             // for objects that are hidden for a moment
constexpr double kStartedAgain = 5.0;                            // s; no measurement is so late

}  // namespace

Sight::Sight(const wire::Participant& participant, std::optional<physics_pool::Scene> scene)
    : scene_(std::move(scene)),
      topics_(participant, {}, kStandardForms),
      detections_(participant, wire::topics::kObjectDetections) {
  if (!scene_) return;
  for (const physics_pool::SceneObject& object : scene_->objects) seen_[object.name] = Clock::now();
}

bool Sight::make_feasible(std::vector<Estimate>& estimates) {
  std::vector<physics_pool::MeasuredObject> measured;
  for (const Estimate& estimate : estimates) {
    const perception::ObjectReading& reading = estimate.reading;
    const bool is_known = std::ranges::count(scene_->objects, reading.name, &physics_pool::SceneObject::name) > 0;
    if (!is_known) continue;
    measured.push_back({.name = reading.name,
                        .X_WB = {.position = reading.position, .orientation = reading.orientation},
                        .covariance = estimate.covariance});
  }
  const auto nearest_result = physics_pool::nearest_state(*scene_, measured);
  if (!nearest_result) {
    infeasible_.warn("{}", nearest_result.error().message);
    return false;
  }
  for (const physics_pool::PlacedObject& placed : *nearest_result) {
    Estimate& estimate = *std::ranges::find(estimates, placed.name, [](const Estimate& e) { return e.reading.name; });
    estimate.reading.position = placed.X_WB.position;
    estimate.reading.orientation = placed.X_WB.orientation;
  }
  return true;
}

void Sight::look(double time, const std::vector<perception::Sighting>& seen) {
  if (time < newest_ - kStartedAgain) {
    spdlog::warn("time went back from {:.3f} to {:.3f} s: began anew", newest_, time);
    estimator_ = perception::Estimator();
    complete_ = false;
    first_.reset();
    newest_ = time;
  }
  newest_ = std::max(newest_, time);
  if (auto ok = estimator_.take(time, seen); !ok) bad_.warn("{}", ok.error().message);
  std::vector<Estimate> estimates = estimator_.at(newest_);
  {
    const std::lock_guard lock(mutex_);
    counts_ = estimator_.counts();
    for (const perception::Sighting& sighting : seen) seen_.try_emplace(sighting.name);
    for (const Estimate& estimate : estimates) {
      const bool is_new = std::ranges::count(seen, estimate.reading.name, &perception::Sighting::name) > 0;
      if (is_new && estimate.last_seen >= time) seen_[estimate.reading.name] = Clock::now();
    }
  }
  if (scene_ && !make_feasible(estimates)) return;
  tell(estimates);
}

bool Sight::is_complete(const std::vector<Estimate>& estimates) {
  if (!scene_ || complete_) return true;
  const auto is_known = [&](const physics_pool::SceneObject& object) {
    return std::ranges::any_of(estimates, [&](const Estimate& e) { return e.reading.name == object.name; });
  };
  if (!first_) first_ = Clock::now();
  complete_ = std::ranges::all_of(scene_->objects, is_known) || Clock::now() - *first_ > kFirstLook;
  return complete_;
}

void Sight::tell(const std::vector<Estimate>& estimates) {
  if (estimates.empty() || !is_complete(estimates)) return;
  std::vector<perception::ObjectReading> readings;
  for (const Estimate& estimate : estimates) readings.push_back(estimate.reading);
  topics_.tell(readings, newest_);
  const auto now = Clock::now();
  if (now < next_detections_) return;
  next_detections_ = now + kStandardForms;
  // When one is lost, the next one follows soon.
  (void)detections_.write(detections_message(estimates, newest_, scene_ ? &*scene_ : nullptr));
}

std::set<std::string> Sight::unseen() const {
  const std::lock_guard lock(mutex_);
  std::set<std::string> names;
  for (const auto& [name, when] : seen_) {
    if (Clock::now() - when > kUnseen) names.insert(name);
  }
  return names;
}

void Sight::say_unseen() {
  auto lost = unseen();
  const std::lock_guard lock(mutex_);
  if (lost == lost_) return;
  lost.empty() ? spdlog::info("every object is seen")
               : spdlog::warn("not seen: {}; kept where they were", fmt::join(lost, ", "));
  lost_ = std::move(lost);
}

void Sight::say_counts() const {
  const std::lock_guard lock(mutex_);
  spdlog::info("{} sightings believed, {} outliers, {} swapped back, {} elsewhere at once, {} too late", counts_.taken,
               counts_.outliers, counts_.swapped, counts_.moved, counts_.late);
}

}  // namespace jostle::world
