#include "services/common/charts/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/common/charts/gnuplot.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;

// Pixels: a panel with its axis, and beside the last one the legend.
constexpr int kPanelWidth = 700, kLegendWidth = 300, kHeight = 600, kFont = 14;
constexpr int kAxis = 95, kGap = 20;  // left of a panel's frame and right of it

// Parts of the height.
constexpr double kBottom = 0.13, kTop = 0.90, kTitle = 0.955;

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

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.9g}", value) : "NaN"; }

std::string data_of(const Band& band, const std::string& name) {
  std::string text = fmt::format("{} << EOD\n", name);
  for (std::size_t i = 0; i < band.x.size(); ++i) {
    text += fmt::format("{} {} {} {}\n", number(band.x[i]), number(band.low[i]), number(band.middle[i]),
                        number(band.high[i]));
  }
  return text + "EOD\n";
}

// Makes an axis logarithmic, with its range and as many tics per decade as have room;
// gnuplot alone would widen the range to whole decades.
std::string logarithmic(char axis, const std::vector<double>& values) {
  double least = HUGE_VAL, most = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value) || value <= 0) continue;
    least = std::min(least, value);
    most = std::max(most, value);
  }
  std::string text = fmt::format("set logscale {}\n", axis);
  if (most == 0.0) return text;
  constexpr double kMargin = 1.04;
  text += fmt::format("set {}range [{}:{}]\n", axis, least / kMargin, most * kMargin);
  const double span = most / least;
  if (span > 1e4) return text + fmt::format("set {}tics autofreq\n", axis);
  const std::vector<int> digits = span > 8 ? std::vector{1, 2, 5} : std::vector{1, 2, 3, 4, 5, 6, 7, 8, 9};
  std::string tics;
  for (double decade = std::pow(10, std::floor(std::log10(least))); decade <= most; decade *= 10) {
    for (const int digit : digits) tics += fmt::format("{:g}, ", digit * decade);
  }
  return text + fmt::format("set {}tics ({})\n", axis, tics.substr(0, tics.size() - 2));
}

std::string linear(char axis) {
  return fmt::format("unset logscale {0}\nset autoscale {0}\nset {0}tics autofreq\n", axis);
}

std::string axes_of(const Panel& panel) {
  std::vector<double> x, y;
  for (const Band& band : panel.bands) {
    x.insert(x.end(), band.x.begin(), band.x.end());
    for (const auto* line : {&band.low, &band.middle, &band.high}) y.insert(y.end(), line->begin(), line->end());
  }
  return (panel.log_x ? logarithmic('x', x) : linear('x')) + (panel.log_y ? logarithmic('y', y) : linear('y')) +
         fmt::format("set xlabel {}\nset ylabel {} offset 1\n", quoted(panel.x_label), quoted(panel.y_label));
}

std::string script_of(const fs::path& png, const std::string& title, const std::vector<Panel>& panels) {
  const int frames = kPanelWidth * static_cast<int>(panels.size()), width = frames + kLegendWidth;
  const auto across = [width](int pixels) { return static_cast<double>(pixels) / width; };
  std::string text = fmt::format(
      "set terminal pngcairo noenhanced size {},{} font 'DejaVu Sans,{}' background '#ffffff'\n"
      "set output {}\n"
      "set border 3 lc rgb '#666666'\nset tics nomirror out textcolor rgb '#222222'\nset format '%g'\n"
      "set grid xtics ytics lt 1 lc rgb '#dddddd' lw 1\n"
      "set bmargin at screen {}\nset tmargin at screen {}\n"
      "set key at screen {},{} left top vertical Left reverse samplen 2 spacing 1.4 textcolor rgb '#222222'\n"
      "set label 1 {} at screen {},{} left font ',{}'\n"
      "set multiplot\n",
      width, kHeight, kFont, quoted(png.string()), kBottom, kTop, across(frames), kTop, quoted(title), across(kAxis),
      kTitle, kFont + 2);
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const int left = kPanelWidth * static_cast<int>(p);
    text += fmt::format("set lmargin at screen {}\nset rmargin at screen {}\n", across(left + kAxis),
                        across(left + kPanelWidth - kGap));
    text += axes_of(panels[p]);
    std::string areas, lines;
    for (std::size_t b = 0; b < panels[p].bands.size(); ++b) {
      const Band& band = panels[p].bands[b];
      const std::string data = fmt::format("$p{}b{}", p, b);
      const char* colour = kColours[b % kColours.size()];
      text += data_of(band, data);
      areas += fmt::format("{} using 1:2:4 with filledcurves fc rgb '{}' fs transparent solid 0.13 noborder notitle, ",
                           data, colour);
      lines += fmt::format("{} using 1:3 with lines lw 2.5 lc rgb '{}' dt {} title {}, ", data, colour,
                           1 + b / kColours.size(), quoted(band.name));
    }
    text += "plot " + areas + lines.substr(0, lines.size() - 2) + "\n";
    text += "unset key\nunset label 1\n";  // once suffices
  }
  return text + "unset multiplot\nunset output\n";
}

}  // namespace

Result<void> plot(const fs::path& png, const std::string& title, const std::vector<Panel>& panels) {
  if (auto ok = check(panels); !ok) return ok;
  return run_gnuplot(png, script_of(png, title, panels));
}

}  // namespace jostle::common
