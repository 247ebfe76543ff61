#include "services/bags/playback/timeline.hpp"

#include <cmath>

namespace jostle::bags {

Time Timeline::at(TimePoint now) const {
  if (!runs_) return moment_;
  const std::chrono::nanoseconds passed = now - since_;
  return moment_ + std::llround(rate_ * static_cast<double>(passed.count()));
}

TimePoint Timeline::when(Time moment) const {
  constexpr double kCentury = 3.2e18;  // ns
  if (!runs_) return moment <= moment_ ? since_ : TimePoint::max();
  const double ahead = static_cast<double>(moment - moment_) / rate_;
  if (std::abs(ahead) > kCentury) return ahead > 0 ? TimePoint::max() : since_;
  return since_ + std::chrono::nanoseconds(std::llround(ahead));
}

void Timeline::set(Time moment, TimePoint now) {
  moment_ = moment;
  since_ = now;
}

void Timeline::set_rate(double rate, TimePoint now) {
  set(at(now), now);
  rate_ = rate;
}

void Timeline::run(TimePoint now) {
  if (runs_) return;
  since_ = now;
  runs_ = true;
}

void Timeline::stand(TimePoint now) {
  set(at(now), now);
  runs_ = false;
}

}  // namespace jostle::bags
