#include "physics_pool/render/montage.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "physics_pool/render/canvas.hpp"

namespace jostle::physics_pool {
namespace {

constexpr int kMargin = 8;          // pixels around and between pictures
constexpr int kCaptionHeight = 34;  // pixels; a line of text is about 23 high
constexpr std::uint8_t kWhite = 255;

Error invalid(const std::string& message) { return {Code::kInvalidArgument, message}; }

Result<void> check(std::span<const Picture> pictures, std::span<const std::string> captions, int columns) {
  if (pictures.empty()) return invalid("pictures: got none, wanted at least one");
  if (columns < 1) return invalid(fmt::format("columns: got {}, wanted at least 1", columns));
  if (captions.size() != pictures.size()) {
    return invalid(
        fmt::format("captions: got {}, wanted one for each of {} pictures", captions.size(), pictures.size()));
  }
  const Picture& first = pictures.front();
  for (std::size_t i = 1; i < pictures.size(); ++i) {
    if (pictures[i].width == first.width && pictures[i].height == first.height) continue;
    return invalid(fmt::format("pictures[{}]: got {}x{} pixels, wanted {}x{} like the first", i, pictures[i].width,
                               pictures[i].height, first.width, first.height));
  }
  return {};
}

// A caption in the middle of a white strip.
Result<Picture> caption_strip(Canvas& canvas, const std::string& caption, int width) {
  return canvas.picture([&](mjrRect area, const mjrContext& context) {
    mjr_rectangle(area, 1, 1, 1, 1);
    const double left = std::max(0.0, (1 - canvas.text_width(caption) / width) / 2);
    const double bottom = (1 - canvas.text_height() / kCaptionHeight) / 2;
    mjr_text(mjFONT_NORMAL, caption.c_str(), &context, static_cast<float>(left), static_cast<float>(bottom), 0.1f, 0.1f,
             0.1f);
  });
}

}  // namespace

Result<Picture> montage(std::span<const Picture> pictures, std::span<const std::string> captions, int columns) {
  if (auto ok = check(pictures, captions, columns); !ok) return ok.error();
  const int count = static_cast<int>(pictures.size());
  const int across = std::min(columns, count), down = (count + across - 1) / across;
  const bool captioned = !std::ranges::all_of(captions, &std::string::empty);
  const int cell_width = pictures[0].width + kMargin;
  const int cell_height = pictures[0].height + kMargin + (captioned ? kCaptionHeight : 0);

  Picture sheet = blank_picture(kMargin + across * cell_width, kMargin + down * cell_height, kWhite);
  auto canvas_result = Canvas::create(pictures[0].width, kCaptionHeight, nullptr);
  if (!canvas_result) return canvas_result.error();
  for (int i = 0; i < count; ++i) {
    const Picture& picture = pictures[static_cast<std::size_t>(i)];
    const int x = kMargin + i % across * cell_width, y = kMargin + i / across * cell_height;
    paste(sheet, picture, x, y);
    if (!captioned) continue;
    auto strip_result = caption_strip(**canvas_result, captions[static_cast<std::size_t>(i)], picture.width);
    if (!strip_result) return strip_result.error();
    paste(sheet, *strip_result, x, y + picture.height);
  }
  return sheet;
}

}  // namespace jostle::physics_pool
