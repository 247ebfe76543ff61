#include "services/common/charts/lanes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/common/charts/gnuplot.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;

// Pixels.
constexpr int kLanes = 1000, kAbove = 60, kBelow = 75;
constexpr int kLeastHeight = 180, kMostHeight = 900;  // of all lanes; the legend needs the least
constexpr int kThick = 40, kThin = 14;                // a lane, where there are few and where there are many
constexpr double kBar = 0.38;                         // half of a bar's height, in lanes

constexpr std::size_t kColourCount = kColours.size() - 1;  // black is for text

const char* colour_of(int series) { return kColours[1 + static_cast<std::size_t>(series) % kColourCount]; }

Error wrong(const std::string& got, const std::string& wanted) {
  return {Code::kInvalidArgument, fmt::format("picture: got {}, wanted {}", got, wanted)};
}

Result<void> check(const LaneChart& chart) {
  if (chart.lanes.empty()) return wrong("no lanes", "at least one");
  if (!(chart.length > 0 && std::isfinite(chart.length)))
    return wrong(fmt::format("a length of {}", chart.length), "more than 0");
  for (const LaneChart::Bar& bar : chart.bars) {
    const bool ok = bar.lane >= 0 && bar.lane < std::ssize(chart.lanes) && bar.series >= 0 &&
                    bar.series < std::ssize(chart.series) && std::isfinite(bar.from) && std::isfinite(bar.to);
    if (ok) continue;
    return wrong(fmt::format("a bar from {} to {} in lane {}, series {}", bar.from, bar.to, bar.lane, bar.series),
                 fmt::format("finite times, {} lanes and {} series from 0", chart.lanes.size(), chart.series.size()));
  }
  return {};
}

// Bars of one series, hatched or not: x, y and the four edges.
std::string data_of(const LaneChart& chart, int series, bool hatched) {
  std::string text;
  for (const LaneChart::Bar& bar : chart.bars) {
    if (bar.series != series || bar.hatched != hatched) continue;
    text += fmt::format("{:.9g} {} {:.9g} {:.9g} {} {}\n", bar.from, bar.lane, bar.from, bar.to, bar.lane - kBar,
                        bar.lane + kBar);
  }
  return text;
}

std::string ground_of(const LaneChart& chart) {
  std::string text;
  for (std::size_t i = 0; i < chart.lanes.size(); ++i) {
    const auto lane = static_cast<double>(i);
    text += fmt::format("0 {} 0 {:.9g} {} {}\n", lane, chart.length, lane - kBar, lane + kBar);
  }
  return text;
}

struct Size {
  int width = 0, height = 0;  // pixels
};

// Everything but the bars, and how large the picture is.
std::pair<std::string, Size> frame_of(const LaneChart& chart) {
  const auto count = static_cast<int>(chart.lanes.size());
  const int thickness = std::clamp(kMostHeight / count, kThin, kThick);
  const int lanes = std::max(kLeastHeight, count * thickness);
  std::size_t longest = 0;
  std::string names;
  for (std::size_t i = 0; i < chart.lanes.size(); ++i) {
    longest = std::max(longest, chart.lanes[i].size());
    names += fmt::format("{}{} {}", i ? ", " : "", quoted(chart.lanes[i]), i);
  }
  const int left = 25 + kCharacterWidth * static_cast<int>(longest);
  std::size_t longest_series = std::max(chart.hatched.size(), sizeof "idle");
  for (const std::string& name : chart.series) longest_series = std::max(longest_series, name.size());
  const int legend = 85 + kCharacterWidth * static_cast<int>(longest_series);
  const int width = left + kLanes + legend, height = kAbove + lanes + kBelow;
  const auto across = [&](int pixels) { return static_cast<double>(pixels) / width; };
  const auto up = [&](int pixels) { return static_cast<double>(pixels) / height; };
  const std::string text = fmt::format(
      "set lmargin at screen {}\nset rmargin at screen {}\nset bmargin at screen {}\nset tmargin at screen {}\n"
      "set border 1 lc rgb '#666666'\nset tics nomirror out textcolor rgb '#222222'\n"
      "set xrange [0:{:.9g}]\nset yrange [{}:-0.5]\nset xlabel {}\nset ytics scale 0 ({}) font ',{}'\n"
      "set grid noytics xtics front lt 1 lc rgb '#bbbbbb' lw 0.5\n"
      "set key at screen {},{} left top vertical Left reverse samplen 1.5 spacing 1.4 textcolor rgb '#222222'\n"
      "set label 1 {} at screen {},{} left font ',{}'\n",
      across(left), across(left + kLanes), up(kBelow), up(kBelow + lanes), chart.length, count - 0.5,
      quoted(chart.x_label), names, std::min(kFont, thickness), across(left + kLanes + 20), up(kBelow + lanes),
      quoted(chart.title), across(left), up(kBelow + lanes + kAbove / 2), kFont + 2);
  return {text, {width, height}};
}

// One plot of boxes, with its data before it; an entry of the legend alone without data.
struct Layers {
  std::string data, plots;

  void add(const std::string& boxes, const std::string& fill, const std::string& name) {
    const std::string title = name.empty() ? "notitle" : "title " + quoted(name);
    if (boxes.empty()) {
      if (!name.empty()) plots += fmt::format("NaN with boxes {} {}, ", fill, title);
      return;
    }
    const std::string block = fmt::format("$d{}", count++);
    data += fmt::format("{} << EOD\n{}EOD\n", block, boxes);
    plots += fmt::format("{} using 1:2:3:4:5:6 with boxxyerror {} {}, ", block, fill, title);
  }

 private:
  int count = 0;
};

// The bars, the ground and the legend.
std::string plot_of(const LaneChart& chart) {
  constexpr const char* kIdle = "fc rgb '#e9e9e9' fs solid noborder";
  Layers layers;
  layers.add(ground_of(chart), kIdle, "");
  for (int series = 0; series < std::ssize(chart.series); ++series) {
    const char* colour = colour_of(series);
    layers.add(data_of(chart, series, false),
               fmt::format("fc rgb '{}' fs solid border lc rgb '#ffffff' lw 0.6", colour),
               chart.series[static_cast<std::size_t>(series)]);
    layers.add(data_of(chart, series, true), fmt::format("fc rgb '{0}' fs pattern 4 border lc rgb '{0}'", colour), "");
  }
  if (!chart.hatched.empty()) layers.add("", "fc rgb '#444444' fs pattern 4 border lc rgb '#444444'", chart.hatched);
  layers.add("", kIdle, "idle");
  return layers.data + "plot " + layers.plots.substr(0, layers.plots.size() - 2) + "\n";
}

}  // namespace

Result<void> draw(const fs::path& picture, const LaneChart& chart) {
  if (auto ok = check_picture(picture); !ok) return ok;
  if (auto ok = check(chart); !ok) return ok;
  const auto [frame, size] = frame_of(chart);
  return run_gnuplot(picture, size.width, size.height, frame + plot_of(chart));
}

}  // namespace jostle::common
