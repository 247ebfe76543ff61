#include "services/common/charts/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "services/common/charts/axis.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;

// Pixels.
constexpr int kFrameWidth = 585, kFrameHeight = 460;
constexpr int kName = 90;                // width of a frame for each name, if that is more
constexpr int kAbove = 60, kBelow = 78;  // of a frame: title; ticks and label
constexpr int kLabel = 34, kTick = 20;   // left of a frame: its label; between tick labels and frame, and around both
constexpr int kRight = 25;               // of a frame
constexpr int kLine = 22;                // height of a line of text
constexpr int kLegend = 65;              // of an entry: line and blanks
constexpr int kTitleCharacter = 11;      // width
constexpr double kSlope = 40;            // degrees, of names that have no room side by side
constexpr const char* kMarks[] = {"7", "5", "9", "13", "11", "6", "4", "8"};  // gnuplot's point types

Result<void> check(const std::vector<Panel>& panels) {
  if (panels.empty()) return Error{Code::kInvalidArgument, "plot: got no panel, wanted at least one"};
  for (const Panel& panel : panels) {
    if (panel.bands.empty())
      return Error{Code::kInvalidArgument, "plot: got a panel without bands, wanted at least one"};
    for (const Band& band : panel.bands) {
      const std::size_t n = band.x.size();
      if (n > 0 && band.low.size() == n && band.middle.size() == n && band.high.size() == n) continue;
      return Error{
          Code::kInvalidArgument,
          fmt::format("plot: {}: got {} x, {} low, {} middle and {} high values, wanted equally many, at least one",
                      band.name, n, band.low.size(), band.middle.size(), band.high.size())};
    }
  }
  return {};
}

int length_of(const std::string& text) {
  return static_cast<int>(std::ranges::count_if(text, [](unsigned char c) { return (c & 0xC0) != 0x80; }));  // of UTF-8
}

// In two lines, if there is a blank or a comma to break it at, as equally long as can be.
std::vector<std::string> in_two_lines(const std::string& name) {
  std::size_t best = std::string::npos, least = name.size();
  for (std::size_t i = 0; i + 1 < name.size(); ++i) {
    if (name[i] != ' ' && name[i] != ',') continue;
    const std::size_t longer = std::max(i + 1, name.size() - i - 1);
    if (longer < least) best = i, least = longer;
  }
  if (best == std::string::npos) return {name};
  return {name.substr(0, name[best] == ' ' ? best : best + 1), name.substr(best + 1)};
}

// How the names of an axis are written.
struct Names {
  std::vector<std::vector<std::string>> lines;
  bool sloping = false;
  int left = 0, below = 0;  // pixels that they need beyond the first tick and below the frame
};

int frame_width(const std::vector<std::string>& names) {
  return std::max(kFrameWidth, kName * static_cast<int>(names.size()));
}

Names arranged(const std::vector<std::string>& names) {
  Names result;
  int longest = 0, most = 1;
  for (const std::string& name : names) {
    result.lines.push_back(in_two_lines(name));
    most = std::max(most, static_cast<int>(result.lines.back().size()));
    for (const std::string& line : result.lines.back()) longest = std::max(longest, length_of(line));
  }
  const int width = longest * kCharacterWidth, slot = frame_width(names) / std::max(static_cast<int>(names.size()), 1);
  result.sloping = width > slot;
  const double slope = result.sloping ? kSlope * std::numbers::pi / 180 : 0.0;
  result.left = result.sloping ? static_cast<int>(width * std::cos(slope)) - slot / 2 : 0;
  result.below = static_cast<int>(width * std::sin(slope)) + most * kLine;
  return result;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += (text.empty() ? "" : ".\"\\n\".") + quoted(line);
  return text;
}

// A panel, its axes, and the room it needs.
struct Sheet {
  const Panel& panel;
  Axis x, y;
  Names names;
  int frame = kFrameWidth, left = 0, below = kBelow;  // pixels: its width, and beside and below it

  explicit Sheet(const Panel& drawn) : panel(drawn), names(arranged(drawn.names)), frame(frame_width(drawn.names)) {
    std::vector<double> all_x, middles, bounds;
    for (const Band& band : panel.bands) {
      all_x.insert(all_x.end(), band.x.begin(), band.x.end());
      middles.insert(middles.end(), band.middle.begin(), band.middle.end());
      for (const auto* line : {&band.low, &band.high}) bounds.insert(bounds.end(), line->begin(), line->end());
    }
    x = !panel.names.empty() ? naming_axis(panel.names)
        : panel.counts_x     ? counting_axis(all_x)
        : panel.log_x        ? logarithmic_axis(all_x, {}, panel.zero)
                             : linear_axis(all_x);
    if (panel.log_y) {
      y = logarithmic_axis(middles, bounds, panel.zero);
    } else {
      bounds.insert(bounds.end(), middles.begin(), middles.end());
      y = linear_axis(bounds);
    }
    int longest = 1;
    for (const auto& [place, text] : y.ticks) longest = std::max(longest, length_of(text));
    left = std::max(kLabel + kTick + longest * kCharacterWidth, names.left);
    if (!panel.names.empty()) below += names.below - kLine;
    if (panel.x_label.empty()) below -= kLine;
  }

  int width() const { return left + frame + kRight; }
};

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.9g}", value) : "NaN"; }

std::string data_of(const Sheet& sheet, const Band& band, const std::string& name) {
  std::string text = fmt::format("{} << EOD\n", name);
  for (std::size_t i = 0; i < band.x.size(); ++i) {
    text += fmt::format("{} {} {} {}\n", number(band.x[i]), number(sheet.y.place(band.low[i])),
                        number(sheet.y.place(band.middle[i])), number(sheet.y.place(band.high[i])));
  }
  return text + "EOD\n";
}

std::string axis_of(char name, const Axis& axis, const std::vector<std::vector<std::string>>& names = {}) {
  std::string ticks;
  for (std::size_t i = 0; i < axis.ticks.size(); ++i) {
    const auto& [place, text] = axis.ticks[i];
    ticks += fmt::format("{}{} {:.9g}", i ? ", " : "", names.empty() ? quoted(text) : joined(names[i]), place);
  }
  return fmt::format("{0} logscale {1}\nset {1}range [{2:.9g}:{3:.9g}]\nset {1}tics ({4})\n",
                     axis.logarithmic ? "set" : "unset", name, axis.low, axis.high, ticks);
}

// Where things stand in a picture.
struct Layout {
  int width = 0, height = 0, below = 0;  // pixels
  double across(int pixels) const { return static_cast<double>(pixels) / width; }
  double up(int pixels) const { return static_cast<double>(pixels) / height; }
};

std::string label(int number, const std::string& text, double x, double y, const std::string& how) {
  return fmt::format("set label {} {} at screen {:.6f},{:.6f} {}\n", number, quoted(text), x, y, how);
}

// A panel whose left edge is so far from the picture's.
std::string panel_of(const Sheet& sheet, std::size_t index, int from, const Layout& layout) {
  const Panel& panel = sheet.panel;
  const int frame = from + sheet.left;
  std::string text = fmt::format("set lmargin at screen {:.6f}\nset rmargin at screen {:.6f}\n", layout.across(frame),
                                 layout.across(frame + sheet.frame));
  text += axis_of('x', sheet.x, sheet.names.lines) + axis_of('y', sheet.y);
  text += sheet.names.sloping ? fmt::format("set xtics rotate by {} right\n", kSlope) : "set xtics norotate\n";
  // A label longer than its frame is written smaller.
  const int tall = std::max(length_of(panel.y_label) * kCharacterWidth, 1);
  text += label(2, panel.x_label, layout.across(frame + sheet.frame / 2), layout.up(layout.below - sheet.below + 22),
                "center");
  text += label(3, panel.y_label, layout.across(from + kLabel / 2), layout.up(layout.below + kFrameHeight / 2),
                fmt::format("center rotate by 90 font ',{:.3g}'",
                            kFont * std::min(1.0, static_cast<double>(kFrameHeight + kAbove) / tall)));
  std::string areas, lines;
  for (std::size_t b = 0; b < panel.bands.size(); ++b) {
    const Band& band = panel.bands[b];
    const std::string data = fmt::format("$p{}b{}", index, b);
    const char* colour = kColours[b % kColours.size()];
    const std::string marks = fmt::format("pt {} ps 1.2", kMarks[b % std::size(kMarks)]);
    text += data_of(sheet, band, data);
    if (!panel.names.empty()) {
      lines += fmt::format("{} using 1:3:2:4 with yerrorbars lw 2.5 lc rgb '{}' {} title {}, ", data, colour, marks,
                           quoted(band.name));
      continue;
    }
    areas += fmt::format("{} using 1:2:4 with filledcurves fc rgb '{}' fs transparent solid 0.13 noborder notitle, ",
                         data, colour);
    lines += fmt::format("{} using 1:3 with {} lw 2.5 lc rgb '{}' dt {} {} title {}, ", data,
                         panel.counts_x ? "linespoints" : "lines", colour, 1 + b / kColours.size(),
                         panel.counts_x ? marks : "", quoted(band.name));
  }
  if (sheet.y.zero > 0) areas += fmt::format("{:.9g} with lines lw 1 dt 3 lc rgb '#666666' notitle, ", sheet.y.zero);
  return text + "plot " + areas + lines.substr(0, lines.size() - 2) + "\n";
}

}  // namespace

Result<void> plot(const fs::path& picture, const std::string& title, const std::vector<Panel>& panels) {
  if (auto ok = check_picture(picture); !ok) return ok;
  if (auto ok = check(panels); !ok) return ok;
  std::vector<Sheet> sheets(panels.begin(), panels.end());
  const bool has_legend = std::ranges::any_of(panels, [](const Panel& panel) { return panel.names.empty(); });
  int frames = 0, legend = 0;
  Layout layout;
  for (const Sheet& sheet : sheets) {
    frames += sheet.width();
    layout.below = std::max(layout.below, sheet.below);
    for (const Band& band : sheet.panel.bands) legend = std::max(legend, length_of(band.name));
  }
  const int wide = sheets.front().left + length_of(title) * kTitleCharacter + kRight;
  layout.width = std::max(frames + (has_legend ? kLegend + legend * kCharacterWidth : 0), wide);
  layout.height = kAbove + kFrameHeight + layout.below;

  const double top = layout.up(layout.below + kFrameHeight);
  std::string script = fmt::format(
      "set border 3 lc rgb '#666666'\nset tics nomirror out textcolor rgb '#222222'\n"
      "set grid xtics ytics lt 1 lc rgb '#dddddd' lw 1\nset bmargin at screen {:.6f}\nset tmargin at screen {:.6f}\n",
      layout.up(layout.below), top);
  script += has_legend ? fmt::format(
                             "set key at screen {:.6f},{:.6f} left top vertical Left reverse samplen 2 spacing "
                             "1.4 textcolor rgb '#222222'\n",
                             layout.across(frames), top)
                       : "unset key\n";
  script += label(1, title, layout.across(sheets.front().left), layout.up(layout.height - kAbove / 2),
                  fmt::format("left font ',{}'", kFont + 2));
  script += "set multiplot\n";
  int from = 0;
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    script += panel_of(sheets[i], i, from, layout) + "unset key\nunset label 1\n";  // once suffices
    from += sheets[i].width();
  }
  return run_gnuplot(picture, layout.width, layout.height, script + "unset multiplot\n");
}

}  // namespace jostle::common
