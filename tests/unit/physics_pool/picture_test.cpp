#include "physics_pool/render/picture.hpp"

#include <gmock/gmock.h>
#include <lodepng.h>

namespace jostle::physics_pool {
namespace {

TEST(WritePng, ReadsBackTheSamePixels) {
  const Picture picture{.width = 2, .height = 2, .rgb = {255, 0, 0, 0, 255, 0, 0, 0, 255, 1, 2, 3}};
  const std::string file = testing::TempDir() + "jostle_picture_test.png";

  const auto written = write_png(file, picture);

  ASSERT_TRUE(written) << written.error().message;
  std::vector<unsigned char> rgb;
  unsigned width = 0, height = 0;
  ASSERT_EQ(lodepng::decode(rgb, width, height, file, LCT_RGB), 0u);
  EXPECT_EQ(width, 2u);
  EXPECT_EQ(height, 2u);
  EXPECT_EQ(rgb, picture.rgb);
}

TEST(WritePng, NamesAFileItCannotWrite) {
  const auto written = write_png("/nowhere/a.png", blank_picture(1, 1, 0));

  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, Code::kIo);
  EXPECT_THAT(written.error().message, testing::HasSubstr("/nowhere/a.png"));
}

TEST(Paste, CopiesRowsToTheirPlace) {
  Picture whole = blank_picture(3, 3, 9);

  paste(whole, blank_picture(1, 2, 5), 2, 1);

  EXPECT_EQ(whole.pixel(2, 1)[0], 5);
  EXPECT_EQ(whole.pixel(2, 2)[2], 5);
  EXPECT_EQ(whole.pixel(2, 0)[0], 9);
  EXPECT_EQ(whole.pixel(1, 1)[0], 9);
}

}  // namespace
}  // namespace jostle::physics_pool
