// Sheets of tags: what is printed is what is found, where it was put.

#include "perception/tags/sheet.hpp"

#include <gmock/gmock.h>

#include <regex>

#include "perception/tags/detector.hpp"

namespace jostle::perception {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

std::vector<PrintedTag> tags_of_size(int count, double size) {
  std::vector<PrintedTag> tags;
  for (int i = 0; i < count; ++i) tags.push_back({.id = 3 * i, .size = size, .label = std::to_string(i)});
  return tags;
}

TEST(Sheet, TagsAreInTrueSize) {
  const auto pages = lay_out(tags_of_size(8, 0.04));
  ASSERT_TRUE(pages) << pages.error().message;
  ASSERT_THAT(*pages, SizeIs(1));
  constexpr double kDots = 5000;  // per m
  const GreyImage image = to_image(pages->front(), {}, kDots);
  EXPECT_EQ(image.width, 1050);
  EXPECT_EQ(image.height, 1485);
  const auto found = Detector().detect(image);
  ASSERT_THAT(found, SizeIs(8));
  for (std::size_t i = 0; i < found.size(); ++i) {
    const PlacedTag& placed = pages->front()[i];
    EXPECT_EQ(found[i].id, placed.tag.id);
    const double margin = placed.tag.size / kTagBorderCells;
    EXPECT_NEAR(found[i].corners[0].x, (placed.x + margin) * kDots - 0.5, 1.0);
    EXPECT_NEAR(found[i].corners[0].y, (placed.y + margin) * kDots - 0.5, 1.0);
    EXPECT_NEAR(found[i].corners[2].x - found[i].corners[0].x, 0.04 * kDots, 1.0);
    EXPECT_NEAR(found[i].corners[2].y - found[i].corners[0].y, 0.04 * kDots, 1.0);
  }
}

TEST(Sheet, ManyTagsTakeSeveralPagesAndStayOnThem) {
  const auto pages = lay_out(tags_of_size(40, 0.05));
  ASSERT_TRUE(pages);
  EXPECT_GT(pages->size(), 1u);
  std::size_t count = 0;
  for (const Page& page : *pages) {
    count += page.size();
    for (const PlacedTag& placed : page) {
      EXPECT_LE(placed.x + 0.0625, 0.200);
      EXPECT_LE(placed.y + 0.0625, 0.287);
    }
  }
  EXPECT_EQ(count, 40u);
}

TEST(Sheet, APdfsTableSaysWhereItsObjectsAre) {
  const auto pages = lay_out(tags_of_size(30, 0.05));
  ASSERT_TRUE(pages);
  const std::string pdf = to_pdf(*pages);
  const std::size_t table = std::stoul(pdf.substr(pdf.rfind("startxref\n") + 10));
  ASSERT_EQ(pdf.substr(table, 5), "xref\n");
  const std::regex entry("(\\d{10}) 00000 n \n");
  int number = 0;
  for (std::sregex_iterator at(pdf.begin() + static_cast<std::ptrdiff_t>(table), pdf.end(), entry), end; at != end;
       ++at) {
    const std::string begins = std::to_string(++number) + " 0 obj";
    EXPECT_EQ(pdf.substr(std::stoul((*at)[1]), begins.size()), begins);
  }
  EXPECT_EQ(number, 3 + 2 * static_cast<int>(pages->size()));
  EXPECT_THAT(pdf, HasSubstr("/MediaBox [0 0 595.2756 841.8898]"));  // A4
}

TEST(Sheet, SaysWhatDoesNotFit) {
  EXPECT_FALSE(lay_out({}));
  EXPECT_THAT(lay_out(tags_of_size(1, 0.2)).error().message, HasSubstr("size of tag 0: got 200 mm"));
  const PrintedTag none{.id = 587, .size = 0.04, .label = {}};
  EXPECT_THAT(lay_out({&none, 1}).error().message, HasSubstr("wanted 0 to 586"));
}

}  // namespace
}  // namespace jostle::perception
