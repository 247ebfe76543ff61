#include "physics_pool/sampling/velocity_noise.hpp"

namespace jostle::physics_pool {

double velocity_draw(const VelocityNoise& noise, const NoiseStream& stream, std::uint64_t step, int dof) {
  return standard_normal(noise.seed, {.stream = static_cast<std::uint32_t>(step >> 32),
                                      .sample = stream.sample,
                                      .step = static_cast<std::uint32_t>(step),
                                      .axis = static_cast<std::uint32_t>(dof),
                                      .purpose = stream.purpose});
}

}  // namespace jostle::physics_pool
