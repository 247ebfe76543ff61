#include "physics_pool/render/picture.hpp"

#include <fmt/format.h>
#include <lodepng.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "idl/files/files.hpp"

namespace jostle::physics_pool {
namespace {

constexpr int kChannels = 3;

std::ptrdiff_t offset(const Picture& picture, int x, int y) {
  return (static_cast<std::ptrdiff_t>(y) * picture.width + x) * kChannels;
}

}  // namespace

std::array<std::uint8_t, 3> Picture::pixel(int x, int y) const {
  std::array<std::uint8_t, 3> colour;
  std::copy_n(rgb.begin() + offset(*this, x, y), kChannels, colour.begin());
  return colour;
}

Picture blank_picture(int width, int height, std::uint8_t grey) {
  Picture picture{.width = width, .height = height};
  picture.rgb.assign(static_cast<std::size_t>(offset(picture, 0, height)), grey);
  return picture;
}

void paste(Picture& whole, const Picture& part, int x, int y) {
  assert(x >= 0 && y >= 0 && x + part.width <= whole.width && y + part.height <= whole.height);
  for (int row = 0; row < part.height; ++row) {
    std::copy_n(part.rgb.begin() + offset(part, 0, row), part.width * kChannels,
                whole.rgb.begin() + offset(whole, x, y + row));
  }
}

Result<void> write_png(const std::filesystem::path& file, const Picture& picture, double dots_per_metre) {
  std::vector<unsigned char> bytes;
  lodepng::State state;
  state.info_raw.colortype = state.info_png.color.colortype = LCT_RGB;
  state.info_png.phys_defined = dots_per_metre > 0 ? 1 : 0;
  state.info_png.phys_x = state.info_png.phys_y = static_cast<unsigned>(std::lround(dots_per_metre));
  state.info_png.phys_unit = 1;  // per metre
  const unsigned problem = lodepng::encode(bytes, picture.rgb, static_cast<unsigned>(picture.width),
                                           static_cast<unsigned>(picture.height), state);
  if (problem == 0) return files::write(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  return Error{Code::kInternal, fmt::format("{}: picture of {}x{} not encoded: {}", file.string(), picture.width,
                                            picture.height, lodepng_error_text(problem))};
}

}  // namespace jostle::physics_pool
