#pragma once
/// \file
/// Renderer: states of a scene as pictures, without a display.

#include <memory>
#include <string>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/render/picture.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

struct RenderOptions {
  int width = 640, height = 480;    ///< pixels, 1 to 4096; time grows with their product
  std::string camera = "overview";  ///< "overview" or "top"
};

/// Draws one scene many times; the costly part is its construction.
///
/// Threads  one at a time; any.
/// Repeats  equal states give equal pictures on one machine, not on all.
class Renderer {
 public:
  /// Errors   kInvalidArgument  the scene does not compile, or an option is out of range
  ///          kUnavailable      there is no software OpenGL
  static Result<Renderer> create(const Scene& scene, const RenderOptions& options);

  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;
  ~Renderer();

  /// Velocities do not show: `state.v` may be empty.
  /// Errors   kInvalidArgument  state.q has a wrong size or is not finite
  Result<Picture> render(const State& state);

 private:
  struct Parts;
  explicit Renderer(std::unique_ptr<Parts> parts);

  std::unique_ptr<Parts> parts_;
};

/// Draws one picture of one state.
Result<Picture> render(const Scene& scene, const State& state, const RenderOptions& options);

}  // namespace jostle::physics_pool
