#include "physics_pool/sampling/counter_rng.hpp"

#include <Random123/philox.h>
#include <Random123/boxmuller.hpp>
#include <Random123/uniform.hpp>

namespace jostle::physics_pool {
namespace {

std::array<std::uint64_t, 2> bits(std::uint64_t seed, const DrawIndex& index) {
  const r123::Philox4x32::key_type key{{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)}};
  const std::uint32_t what = static_cast<std::uint32_t>(index.purpose) << 24 | index.axis;
  const r123::Philox4x32::ctr_type counter{{index.stream, index.sample, index.step, what}};
  const r123::Philox4x32::ctr_type random = r123::Philox4x32{}(counter, key);
  const auto join = [](std::uint32_t high, std::uint32_t low) {
    return (static_cast<std::uint64_t>(high) << 32) | low;
  };
  return {join(random[0], random[1]), join(random[2], random[3])};
}

}  // namespace

double standard_normal(std::uint64_t seed, const DrawIndex& index) {
  const auto random = bits(seed, index);
  return r123::boxmuller(random[0], random[1]).x;
}

double standard_uniform(std::uint64_t seed, const DrawIndex& index) { return r123::u01<double>(bits(seed, index)[0]); }

DrawIndex CounterStream::next() {
  const std::uint64_t count = count_++;
  return {.stream = stream_,
          .sample = static_cast<std::uint32_t>(count),
          .step = static_cast<std::uint32_t>(count >> 32),
          .axis = 0};
}

double CounterStream::uniform(double low, double high) { return low + (high - low) * standard_uniform(seed_, next()); }

double CounterStream::normal(double mean, double sigma) { return mean + sigma * standard_normal(seed_, next()); }

}  // namespace jostle::physics_pool
