#include "perception/tags/sheet.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "perception/tags/detector.hpp"

namespace jostle::perception {
namespace {

constexpr double kGap = 0.004;           // m between papers, beside the label
constexpr double kLabel = 0.005;         // m, height of a label's line
constexpr double kRuler = 0.100;         // m
constexpr double kPoints = 72 / 0.0254;  // per m
constexpr std::uint8_t kBlack = 0, kWhite = 255, kCut = 200;

double side_of(const PrintedTag& tag) { return tag.size * kTagCells / kTagBorderCells; }

// A paper of text whose y runs up, in points.
class Drawing {
 public:
  explicit Drawing(const Paper& paper) : paper_(paper) {}

  void rectangle(double x, double y, double width, double height) {
    text_ += fmt::format("{:.4f} {:.4f} {:.4f} {:.4f} re f\n", kPoints * x, kPoints * (paper_.height - y - height),
                         kPoints * width, kPoints * height);
  }
  void frame(double x, double y, double side) {
    text_ += fmt::format("0.8 G 0.3 w {:.4f} {:.4f} {:.4f} {:.4f} re S 0 G\n", kPoints * x,
                         kPoints * (paper_.height - y - side), kPoints * side, kPoints * side);
  }
  void label(double x, double y, const std::string& words) {
    text_ += fmt::format("BT /F 8 Tf {:.4f} {:.4f} Td ({}) Tj ET\n", kPoints * x, kPoints * (paper_.height - y),
                         escaped(words));
  }
  const std::string& text() const { return text_; }

 private:
  static std::string escaped(const std::string& words) {
    std::string result;
    for (const char letter : words) {
      if (letter == '(' || letter == ')' || letter == '\\') result += '\\';
      result += letter >= ' ' && letter <= '~' ? letter : '?';
    }
    return result;
  }

  const Paper paper_;
  std::string text_;
};

std::string drawing_of(const Page& page, const Paper& paper) {
  Drawing drawing(paper);
  for (const PlacedTag& placed : page) {
    const double side = side_of(placed.tag), cell = side / kTagCells;
    const GreyImage cells = tag_cells(placed.tag.id);
    for (int y = 0; y < kTagCells; ++y) {
      // Neighbours in one rectangle: no hairlines between them.
      for (int x = 0; x < kTagCells; ++x) {
        int length = 0;
        while (x + length < kTagCells && cells.at(x + length, y) == kBlack) ++length;
        if (length > 0) drawing.rectangle(placed.x + x * cell, placed.y + y * cell, length * cell, cell);
        x += length;
      }
    }
    drawing.frame(placed.x, placed.y, side);
    drawing.label(placed.x, placed.y + side + 0.8 * kLabel, placed.tag.label);
  }
  const double ruler = paper.height - paper.margin;
  drawing.rectangle(paper.margin, ruler, kRuler, 0.0003);
  drawing.label(paper.margin, ruler - 0.001, "this line is 100 mm long");
  return drawing.text();
}

}  // namespace

Result<std::vector<Page>> lay_out(std::span<const PrintedTag> tags, const Paper& paper) {
  if (tags.empty()) return invalid("tags", "none", "at least one");
  const double room = std::min(paper.width, paper.height) - 2 * paper.margin - kGap - 2 * kLabel;
  std::vector<Page> pages(1);
  double x = paper.margin, y = paper.margin, tallest = 0.0;
  for (const PrintedTag& tag : tags) {
    if (tag.id < 0 || tag.id >= tag_count())
      return invalid("tag", fmt::format("{}", tag.id), fmt::format("0 to {}", tag_count() - 1));
    const double side = side_of(tag);
    if (!(tag.size > 0) || side > room)
      return invalid(fmt::format("size of tag {}", tag.id), fmt::format("{:g} mm", 1e3 * tag.size),
                     fmt::format("more than 0, up to {:.0f} mm on this paper",
                                 std::floor(1e3 * room * kTagBorderCells / kTagCells)));
    if (x + side > paper.width - paper.margin) {
      x = paper.margin, y += tallest + kLabel + kGap;
      tallest = 0.0;
    }
    if (y + side + kLabel > paper.height - paper.margin - kLabel) {
      pages.emplace_back();
      x = paper.margin, y = paper.margin;
      tallest = 0.0;
    }
    pages.back().push_back({tag, x, y});
    x += side + kGap;
    tallest = std::max(tallest, side);
  }
  return pages;
}

std::string to_pdf(std::span<const Page> pages, const Paper& paper) {
  std::string pdf = "%PDF-1.4\n";
  std::vector<std::size_t> places;
  const auto object = [&](const std::string& body) {
    places.push_back(pdf.size());
    pdf += fmt::format("{} 0 obj\n{}\nendobj\n", places.size(), body);
  };
  // Objects: 1 catalogue, 2 pages, 3 font, then two for each page.
  std::string kids;
  for (std::size_t i = 0; i < pages.size(); ++i) kids += fmt::format("{} 0 R ", 4 + 2 * i);
  object("<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>");
  object(fmt::format("<< /Type /Pages /Kids [{}] /Count {} >>", kids, pages.size()));
  object("<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>");
  for (std::size_t i = 0; i < pages.size(); ++i) {
    object(
        fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.4f} {:.4f}] /Contents {} 0 R "
                    "/Resources << /Font << /F 3 0 R >> >> >>",
                    kPoints * paper.width, kPoints * paper.height, 5 + 2 * i));
    const std::string drawing = drawing_of(pages[i], paper);
    object(fmt::format("<< /Length {} >>\nstream\n{}endstream", drawing.size(), drawing));
  }
  const std::size_t table = pdf.size();
  pdf += fmt::format("xref\n0 {}\n0000000000 65535 f \n", places.size() + 1);
  for (const std::size_t place : places) pdf += fmt::format("{:010} 00000 n \n", place);
  pdf += fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", places.size() + 1, table);
  return pdf;
}

GreyImage to_image(const Page& page, const Paper& paper, double dots_per_metre) {
  const auto dots = [&](double metres) { return static_cast<int>(std::lround(metres * dots_per_metre)); };
  GreyImage image{.width = dots(paper.width), .height = dots(paper.height)};
  image.pixels.assign(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), kWhite);
  const auto fill = [&](double x, double y, double width, double height, std::uint8_t shade) {
    for (int row = dots(y); row < std::min(dots(y + height), image.height); ++row) {
      const auto begin = image.pixels.begin() + static_cast<std::ptrdiff_t>(row) * image.width;
      std::fill(begin + dots(x), begin + std::min(dots(x + width), image.width), shade);
    }
  };
  const double thin = 1 / dots_per_metre;
  for (const PlacedTag& placed : page) {
    const double side = side_of(placed.tag), cell = side / kTagCells;
    fill(placed.x - thin, placed.y - thin, side + 2 * thin, side + 2 * thin, kCut);
    const GreyImage cells = tag_cells(placed.tag.id);
    for (int y = 0; y < kTagCells; ++y) {
      for (int x = 0; x < kTagCells; ++x) fill(placed.x + x * cell, placed.y + y * cell, cell, cell, cells.at(x, y));
    }
  }
  return image;
}

}  // namespace jostle::perception
