#pragma once
/// \file
/// Other worlds that the real one may be, and other states that an observed one may be.

#include <cstdint>

#include "idl/types/state.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// How far objects may differ from what is believed of them (Eq. 4.22, Table 4.1). The thesis bounds sizes without
/// saying how.
struct ParameterBounds {
  double least_mass = 0.5, most_mass = 0.8;          ///< kg
  double least_friction = 0.2, most_friction = 0.4;  ///< Coulomb coefficients
  double size = 0.005;  ///< m, how much longer or shorter each extent, radius and height may be; none gets below half

  bool operator==(const ParameterBounds&) const = default;
};

/// Makes world j of Eq. 4.21: every object with a mass, a friction and sizes of its own, uniform in their bounds. An
/// object that would reach into another, or into robot or fixtures, is made to differ less in size, until it does not.
/// Pure: equal seeds and numbers give equal worlds, and every object's draws are its own. `world` >= 1; the nominal
/// world is world 0.
Scene realize(const Scene& nominal, const ParameterBounds& bounds, std::uint64_t seed, int world);

/// How far objects may be from where they are seen: standard deviations.
struct StartSpread {
  double position = 0.005;  ///< m, of x and y
  double rotation = 0.005;  ///< rad, about z

  bool operator==(const StartSpread&) const = default;
};

/// Makes start i beside x0, for `world`, which is `nominal` or a realization of it: standing objects are shifted and
/// turned by Gaussian noise, and stand as high as their shapes in that world have it. An object that would reach into
/// another, or leave the surface, is shifted less, until it does not. Robot, velocities, and objects that do not stand
/// remain. The draws depend on seed and i alone, so a start is the same one in all worlds, but for what has no room.
/// Source   samples x^i(t_0) of Sec. 4.3.3, whose spread the thesis does not give; it is that of low uncertainty in Ch.
/// 3
State nearby_start(const Scene& nominal, const Scene& world, const State& x0, const StartSpread& spread,
                   std::uint64_t seed, int start);

}  // namespace jostle::physics_pool
