#include "physics_pool/render/montage.hpp"

#include <gmock/gmock.h>

#include <algorithm>

namespace jostle::physics_pool {
namespace {

using ::testing::HasSubstr;

std::vector<Picture> grey_pictures(int count) {
  return std::vector<Picture>(static_cast<std::size_t>(count), blank_picture(100, 60, 128));
}

TEST(Montage, GrowsByRowsAndColumns) {
  const std::vector<std::string> captions(5);

  const auto one = montage(grey_pictures(1), std::vector<std::string>(1), 3);
  const auto sheet = montage(grey_pictures(5), captions, 3);

  ASSERT_TRUE(one && sheet);
  const int margin = one->width - 100;  // left and right together
  EXPECT_EQ(sheet->width, 3 * 100 + 2 * margin);
  EXPECT_EQ(sheet->height, 2 * 60 + margin + margin / 2);
}

TEST(Montage, PlacesPicturesInReadingOrder) {
  std::vector<Picture> pictures{blank_picture(10, 10, 0), blank_picture(10, 10, 100)};

  const auto sheet = montage(pictures, std::vector<std::string>(2), 2);

  ASSERT_TRUE(sheet);
  EXPECT_EQ(sheet->pixel(sheet->width / 4 + 1, sheet->height / 2)[0], 0);
  EXPECT_EQ(sheet->pixel(3 * sheet->width / 4 - 1, sheet->height / 2)[0], 100);
  EXPECT_EQ(sheet->pixel(0, 0)[0], 255);
}

TEST(Montage, WritesCaptionsDarkOnWhiteBelowThePicture) {
  const std::vector<std::string> captions{"t = 0 s"};

  const auto plain = montage(grey_pictures(1), std::vector<std::string>(1), 1);
  const auto captioned = montage(grey_pictures(1), captions, 1);

  ASSERT_TRUE(plain && captioned);
  ASSERT_GT(captioned->height, plain->height);
  const auto strip = captioned->rgb.begin() + static_cast<std::ptrdiff_t>(3) * captioned->width * (plain->height - 8);
  EXPECT_LT(*std::min_element(strip, captioned->rgb.end()), 80);
}

TEST(Montage, RefusesNoPictures) { EXPECT_FALSE(montage({}, {}, 1)); }

TEST(Montage, RefusesCaptionsThatDoNotMatch) {
  const std::vector<std::string> captions(1);

  const auto sheet = montage(grey_pictures(2), captions, 1);

  ASSERT_FALSE(sheet);
  EXPECT_EQ(sheet.error().message, "captions: got 1, wanted one for each of 2 pictures");
}

TEST(Montage, RefusesPicturesOfUnequalSize) {
  std::vector<Picture> pictures{blank_picture(10, 10, 0), blank_picture(11, 10, 0)};

  const auto sheet = montage(pictures, std::vector<std::string>(2), 2);

  ASSERT_FALSE(sheet);
  EXPECT_THAT(sheet.error().message, HasSubstr("pictures[1]: got 11x10 pixels, wanted 10x10"));
}

}  // namespace
}  // namespace jostle::physics_pool
