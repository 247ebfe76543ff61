#include "physics_pool/render/canvas.hpp"

#include <GL/gl.h>
#include <fmt/format.h>

#include <mutex>
#include <numeric>

namespace jostle::physics_pool {
namespace {

// Llvmpipe's largest surface is 16384 pixels; half of half of it, so that a
// mistyped size does not ask for gigabytes.
constexpr int kLargest = 4096;

// The engine finds OpenGL's functions once per process, into globals.
std::mutex& engine_globals() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

// Makes a context the thread's own for a while: the next user may be another thread.
class Canvas::Current {
 public:
  explicit Current(Canvas& canvas)
      : succeeded_(OSMesaMakeCurrent(canvas.gl_, canvas.rgba_.data(), GL_UNSIGNED_BYTE, canvas.width_ * kOversampling,
                                     canvas.height_ * kOversampling) == GL_TRUE) {
    OSMesaPixelStore(OSMESA_Y_UP, 0);
  }
  ~Current() { OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0); }
  Current(const Current&) = delete;
  Current& operator=(const Current&) = delete;

  bool succeeded() const { return succeeded_; }

 private:
  bool succeeded_;
};

Canvas::Canvas(int width, int height)
    : width_(width),
      height_(height),
      rgba_(static_cast<std::size_t>(4 * kOversampling * kOversampling) * static_cast<std::size_t>(width) *
            static_cast<std::size_t>(height)) {
  mjr_defaultContext(&context_);
}

Canvas::~Canvas() {
  if (gl_ == nullptr) return;
  {
    const Current current(*this);
    mjr_freeContext(&context_);
  }
  OSMesaDestroyContext(gl_);
}

Result<std::unique_ptr<Canvas>> Canvas::create(int width, int height, const mjModel* model) {
  if (width < 1 || height < 1 || width > kLargest || height > kLargest) {
    return Error{Code::kInvalidArgument,
                 fmt::format("picture size: got {}x{}, wanted 1x1 to {}x{}", width, height, kLargest, kLargest)};
  }
  install_engine_handlers();
  std::unique_ptr<Canvas> canvas(new Canvas(width, height));
  if (auto ok = canvas->open(model); !ok) return ok.error();
  return canvas;
}

Result<void> Canvas::open(const mjModel* model) {
  static constexpr int kAttributes[] = {
      OSMESA_FORMAT, OSMESA_RGBA, OSMESA_DEPTH_BITS, 24, OSMESA_PROFILE, OSMESA_COMPAT_PROFILE, 0};
  const std::lock_guard lock(engine_globals());
  gl_ = OSMesaCreateContextAttribs(kAttributes, nullptr);
  if (gl_ == nullptr) {
    return Error{Code::kUnavailable, "picture: OSMesa gave no OpenGL context; is libosmesa6 whole?"};
  }
  const Current current(*this);
  if (!current.succeeded()) {
    return Error{Code::kUnavailable, fmt::format("picture: OSMesa refused a surface of {}x{}", width_ * kOversampling,
                                                 height_ * kOversampling)};
  }
  try {
    mjr_makeContext(model, &context_, mjFONTSCALE_250);
    mjr_setBuffer(mjFB_WINDOW, &context_);
  } catch (const EngineError& error) {
    return Error{Code::kUnavailable, fmt::format("picture: OpenGL lacks something: {}", error.what())};
  }
  return {};
}

Result<Picture> Canvas::picture(const Draw& draw) {
  const Current current(*this);
  try {
    draw({0, 0, width_ * kOversampling, height_ * kOversampling}, context_);
    mjr_finish();
  } catch (const EngineError& error) {
    return Error{Code::kInternal, fmt::format("picture: the engine refused to draw: {}", error.what())};
  }
  return averaged();
}

Picture Canvas::averaged() const {
  Picture picture = blank_picture(width_, height_, 0);
  const std::size_t stride = static_cast<std::size_t>(4 * kOversampling * width_);
  auto out = picture.rgb.begin();
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        const std::uint8_t* in =
            rgba_.data() + static_cast<std::size_t>(kOversampling * y) * stride + 4 * kOversampling * x + channel;
        int sum = 0;
        for (int dy = 0; dy < kOversampling; ++dy) {
          for (int dx = 0; dx < kOversampling; ++dx) sum += in[static_cast<std::size_t>(dy) * stride + 4 * dx];
        }
        *out++ = static_cast<std::uint8_t>(sum / (kOversampling * kOversampling));
      }
    }
  }
  return picture;
}

double Canvas::text_width(const std::string& text) const {
  const int width = std::accumulate(text.begin(), text.end(), 0, [this](int sum, char letter) {
    return sum + context_.charWidth[static_cast<unsigned char>(letter) % 128];
  });
  return static_cast<double>(width) / kOversampling;
}

double Canvas::text_height() const { return static_cast<double>(context_.charHeight) / kOversampling; }

}  // namespace jostle::physics_pool
