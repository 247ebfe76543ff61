#include "services/tools/render/film.hpp"

#include <fmt/format.h>

#include "idl/files/files.hpp"
#include "physics_pool/render/montage.hpp"
#include "services/common/process/child_process.hpp"
#include "services/common/process/files.hpp"

namespace jostle::tools {
namespace {

namespace fs = std::filesystem;
using physics_pool::Picture;

constexpr const char* kPattern = "frame-%05d.png";
constexpr std::size_t kMostFilm = std::size_t{4} << 30;  // bytes; an hour has about one GiB

// Draws one frame after the other into `use`.
Result<void> draw_each(const Frames& input, const DrawOptions& options, const std::stop_token& stop,
                       const std::function<Result<void>(std::size_t index, Picture)>& use) {
  auto renderer_result = physics_pool::Renderer::create(input.scene, options.picture);
  if (!renderer_result) return renderer_result.error();
  for (std::size_t i = 0; i < input.frames.size(); ++i) {
    if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    auto picture_result = renderer_result->render(input.frames[i].state);
    if (!picture_result) {
      return Error{picture_result.error().code, fmt::format("frames[{}].{}", i, picture_result.error().message)};
    }
    if (auto ok = use(i, std::move(picture_result).value()); !ok) return ok;
    if (options.on_progress) options.on_progress(i + 1, input.frames.size());
  }
  return {};
}

Result<void> draw_sheet(const Frames& input, const fs::path& output, const DrawOptions& options,
                        const std::stop_token& stop) {
  std::vector<Picture> pictures;
  std::vector<std::string> captions;
  for (const Frame& frame : input.frames) captions.push_back(frame.caption);
  const auto keep = [&](std::size_t, Picture picture) -> Result<void> {
    pictures.push_back(std::move(picture));
    return {};
  };
  if (auto ok = draw_each(input, options, stop, keep); !ok) return ok;
  auto sheet_result = physics_pool::montage(pictures, captions, options.columns);
  if (!sheet_result) return sheet_result.error();
  return physics_pool::write_png(output, *sheet_result);
}

Result<void> draw_sequence(const Frames& input, const fs::path& folder, const DrawOptions& options,
                           const std::stop_token& stop) {
  std::error_code problem;
  fs::create_directory(folder.has_filename() ? folder : folder.parent_path(), problem);
  if (problem) return Error{Code::kIo, fmt::format("{}: {}", folder.string(), problem.message())};
  return draw_each(input, options, stop, [&](std::size_t i, Picture picture) -> Result<void> {
    // A caption below each, even an empty one: all pictures of a film are equally large.
    const std::string caption = input.frames[i].caption.empty() ? " " : input.frames[i].caption;
    auto sheet_result = physics_pool::montage({&picture, 1}, {&caption, 1}, 1);
    if (!sheet_result) return sheet_result.error();
    return physics_pool::write_png(folder / fmt::format("frame-{:05}.png", i + 1), *sheet_result);
  });
}

std::vector<std::string> encoder_arguments(const fs::path& folder, const fs::path& output, double per_second) {
  std::vector<std::string> words{
      "-y", "-loglevel", "error", "-framerate", fmt::format("{}", per_second), "-i", (folder / kPattern).string()};
  if (output.extension() == ".gif") {
    words.insert(words.end(), {"-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse"});
  } else {
    // Players want even sizes and one luma sample in four coloured.
    words.insert(words.end(), {"-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-c:v", "libx264", "-crf", "20",
                               "-pix_fmt", "yuv420p", "-movflags", "+faststart"});
  }
  words.push_back(output.string());
  return words;
}

// Into a folder of its own first: a film that is cut short is none.
Result<void> draw_film(const Frames& input, const fs::path& output, const DrawOptions& options,
                       const std::stop_token& stop) {
  auto folder_result = common::make_temporary_folder("film");
  if (!folder_result) return folder_result.error();
  const fs::path film = *folder_result / ("film" + output.extension().string());
  auto drawn = draw_sequence(input, *folder_result, options, stop);
  if (drawn) {
    drawn = common::run_tool("ffmpeg", "ffmpeg", encoder_arguments(*folder_result, film, options.per_second),
                             *folder_result / "log");
  }
  if (drawn) {
    const auto bytes_result = files::read(film, kMostFilm);
    drawn = bytes_result ? files::write(output, *bytes_result) : Result<void>(bytes_result.error());
  }
  std::error_code ignored;
  fs::remove_all(*folder_result, ignored);
  return drawn;
}

bool is_film(const fs::path& output) { return output.extension() == ".mp4" || output.extension() == ".gif"; }

}  // namespace

bool is_sheet(const fs::path& output) { return output.extension() == ".png" || files::is_standard(output); }

Result<void> check_target(const fs::path& output, const std::string& still) {
  const bool is_folder = output.extension().empty() && !files::is_standard(output);
  const files::Output target{
      .option = "--output", .path = output, .endings = {".png", ".mp4", ".gif"}, .is_folder = is_folder};
  if (!still.empty() && is_film(output)) {
    return invalid(target.option, fmt::format("'{}' for {}", output.string(), still),
                   ".png; films are drawn of a run that moved, or of several frames");
  }
  auto ok = files::check_output(target);
  if (ok || !is_folder) return ok;
  return Error{ok.error().code, ok.error().message + "; or a file that ends in .png, .mp4 or .gif"};
}

Result<void> draw(const Frames& frames, const fs::path& output, const DrawOptions& options, std::stop_token stop) {
  if (is_sheet(output)) return draw_sheet(frames, output, options, stop);
  if (is_film(output)) return draw_film(frames, output, options, stop);
  return draw_sequence(frames, output, options, stop);
}

}  // namespace jostle::tools
