#pragma once
/// \file
/// The corner of the network that a test lives in, and waiting in it.

#include <chrono>
#include <functional>
#include <stdexcept>
#include <thread>

#include "services/common/process/domain_claim.hpp"

namespace jostle::tests {

using Clock = std::chrono::steady_clock;

/// A deadline `time` from now.
template <class Duration>
Clock::time_point in(Duration time) {
  return Clock::now() + time;
}

/// A DDS domain that no other test process on this machine uses; held until this one ends.
inline int test_domain() {
  static const auto own_result = common::claim_some_domain();
  if (!own_result) throw std::runtime_error(own_result.error().message);
  return own_result->domain;
}

/// Whether a condition came true by the deadline.
inline bool eventually(Clock::time_point deadline, const std::function<bool()>& condition) {
  while (!condition()) {
    if (Clock::now() >= deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

}  // namespace jostle::tests
