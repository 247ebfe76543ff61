#include "services/common/charts/gnuplot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "services/common/process/child_process.hpp"
#include "services/common/process/files.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;

constexpr double kPixelsPerInch = 96, kPixelsPerPoint = kPixelsPerInch / 72;

std::string ending_of(const fs::path& picture) {
  std::string ending = picture.extension();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending;
}

// A line that sets the terminal. All have the same proportions of text and picture.
Result<std::string> terminal_of(const fs::path& picture, int width, int height) {
  const std::string ending = ending_of(picture);
  const auto with = [](const std::string& kind, double font) {
    return fmt::format("set terminal {} noenhanced font 'DejaVu Sans,{:g}' background '#ffffff'\n", kind, font);
  };
  if (ending == ".png") return with(fmt::format("pngcairo size {},{}", width, height), kFont);
  if (ending == ".svg") return with(fmt::format("svg size {},{}", width, height), kFont * kPixelsPerPoint);
  if (ending == ".pdf") {
    return with(fmt::format("pdfcairo size {}in,{}in", width / kPixelsPerInch, height / kPixelsPerInch), kFont);
  }
  return Error{Code::kInvalidArgument,
               fmt::format("picture: got '{}', wanted a name that ends in .png, .svg or .pdf", picture.string())};
}

Result<void> draw_in(const fs::path& folder, const fs::path& picture, const std::string& terminal,
                     const std::string& script) {
  const fs::path drawn = folder / "picture", file = folder / "plot.gp";
  const std::string text =
      terminal + fmt::format("set output {}\n", quoted(drawn.string())) + script + "unset output\n";
  if (auto ok = write_text(file, text); !ok) return ok;
  if (auto ok = run_tool("gnuplot", "gnuplot-nox", {file.string()}, folder / "log"); !ok) return ok;
  auto bytes_result = read_text(drawn);
  if (!bytes_result) return bytes_result.error();
  return write_text(picture, *bytes_result);
}

}  // namespace

std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("''") : std::string(1, c == '\n' ? ' ' : c);
  return result + "'";
}

Result<void> check_picture(const fs::path& picture) {
  if (auto terminal_result = terminal_of(picture, 1, 1); !terminal_result) return terminal_result.error();
  return {};
}

Result<void> run_gnuplot(const fs::path& picture, int width, int height, const std::string& script) {
  auto terminal_result = terminal_of(picture, width, height);
  if (!terminal_result) return terminal_result.error();
  auto folder_result = make_temporary_folder("plot");
  if (!folder_result) return folder_result.error();
  auto drawn = draw_in(*folder_result, picture, *terminal_result, script);
  std::error_code ignored;
  fs::remove_all(*folder_result, ignored);
  return drawn;
}

}  // namespace jostle::common
