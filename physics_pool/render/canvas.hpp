#pragma once
/// \file
/// An off-screen surface to draw on. Private to this folder: it shows MuJoCo's types.

#include <GL/osmesa.h>

#include <functional>
#include <memory>
#include <vector>

#include "idl/types/result.hpp"
#include "physics_pool/local/engine.hpp"
#include "physics_pool/render/picture.hpp"

namespace jostle::physics_pool {

/// A Canvas is an OpenGL context in main memory, with MuJoCo's resources in it. It needs neither
/// a display nor a graphics card. Everything is drawn `kOversampling` times as
/// wide and high and averaged, which smooths edges and letters.
///
/// Threads  one at a time; any.
class Canvas {
 public:
  static constexpr int kOversampling = 2;

  /// Width and height of the pictures, pixels. `model` may be null for a canvas
  /// that shows only text.
  /// Errors   kInvalidArgument  the size is out of range
  ///          kUnavailable      OpenGL refused
  static Result<std::unique_ptr<Canvas>> create(int width, int height, const mjModel* model);

  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  /// Draws on `area`, the whole surface, with `context`; both are valid only during the call.
  using Draw = std::function<void(mjrRect area, const mjrContext& context)>;

  /// Error kInternal: the engine refused to draw; says why.
  Result<Picture> picture(const Draw& draw);

  /// Width of a text in pixels of the picture.
  double text_width(const std::string& text) const;
  /// Height of a line of text in pixels of the picture.
  double text_height() const;

 private:
  class Current;

  Canvas(int width, int height);
  Result<void> open(const mjModel* model);
  Picture averaged() const;

  int width_, height_;
  std::vector<std::uint8_t> rgba_;  // [oversampled height][oversampled width][4], top row first
  OSMesaContext gl_ = nullptr;
  mjrContext context_;
};

}  // namespace jostle::physics_pool
