#include "perception/camera/camera.hpp"

#include <gmock/gmock.h>

#include "tests/support/tag_views.hpp"

namespace jostle::perception {
namespace {

using namespace tests;
using testing::AllOf;
using testing::HasSubstr;

TEST(Camera, WithoutDistortionItIsAPinhole) {
  Camera sut = distorting_camera();
  sut.distortion = {};
  const Pixel pixel = project(sut, {0.1, -0.2, 0.5}).pixel;
  EXPECT_DOUBLE_EQ(pixel.x, 905.0 * 0.2 + 642.3);
  EXPECT_DOUBLE_EQ(pixel.y, 903.0 * -0.4 + 355.8);
}

TEST(Camera, DistortionIsThatOfTheFormula) {
  Camera sut = distorting_camera();
  sut.distortion = {0.1, 0.02, 0.003, 0.004, 0.005};
  // x = 0.2, y = -0.4: r^2 = 0.2, by hand.
  const double radial = 1 + 0.1 * 0.2 + 0.02 * 0.04 + 0.005 * 0.008;
  const double x = 0.2 * radial + 2 * 0.003 * 0.2 * -0.4 + 0.004 * (0.2 + 2 * 0.04);
  const double y = -0.4 * radial + 0.003 * (0.2 + 2 * 0.16) + 2 * 0.004 * 0.2 * -0.4;
  const Pixel pixel = project(sut, {0.2, -0.4, 1.0}).pixel;
  EXPECT_NEAR(pixel.x, 905.0 * x + 642.3, 1e-9);
  EXPECT_NEAR(pixel.y, 903.0 * y + 355.8, 1e-9);
}

TEST(Camera, SlopesAreDifferences) {
  const Camera sut = distorting_camera();
  const std::array<double, 3> p{0.31, -0.22, 0.8};
  const Projection projection = project(sut, p);
  for (std::size_t i = 0; i < 3; ++i) {
    constexpr double kStep = 1e-6;
    std::array<double, 3> more = p, less = p;
    more[i] += kStep, less[i] -= kStep;
    const Pixel a = project(sut, more).pixel, b = project(sut, less).pixel;
    EXPECT_NEAR(projection.slope[0][i], (a.x - b.x) / (2 * kStep), 1e-4);
    EXPECT_NEAR(projection.slope[1][i], (a.y - b.y) / (2 * kStep), 1e-4);
  }
}

TEST(Camera, RaysAreTheInverseEverywhereInTheImage) {
  const Camera sut = distorting_camera();
  for (double x = 0; x < sut.width; x += 99) {
    for (double y = 0; y < sut.height; y += 71) {
      const auto [across, down] = ray(sut, {x, y});
      const Pixel back = project(sut, {across, down, 1.0}).pixel;
      EXPECT_NEAR(back.x, x, 1e-8);
      EXPECT_NEAR(back.y, y, 1e-8);
    }
  }
}

TEST(CameraFile, ReadsWhatItWrites) {
  const Camera sut = distorting_camera();
  const auto read = parse_camera(to_yaml(sut), "camera.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, sut);
}

TEST(CameraFile, SaysWhatIsWrongAndWhere) {
  std::string text = to_yaml(distorting_camera());
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string copy = text;
    copy.replace(copy.find(from), from.size(), to);
    const auto result = parse_camera(copy, "camera.yaml");
    return result ? std::string("nothing") : result.error().message;
  };
  EXPECT_THAT(changed("plumb_bob", "equidistant"), AllOf(HasSubstr("distortion_model"), HasSubstr("plumb_bob")));
  EXPECT_THAT(changed("[905, 0,", "[-905, 0,"), AllOf(HasSubstr("camera_matrix"), HasSubstr("fx")));
  EXPECT_THAT(changed("image_width: 1280", "image_width: 0"), AllOf(HasSubstr("camera.yaml:1"), HasSubstr("wanted 1")));
  EXPECT_THAT(changed("cols: 5", "cols: 4"), HasSubstr("wanted 1 x 5"));
  EXPECT_THAT(changed("-0.12, ", ""), HasSubstr("got 4 numbers, wanted 5"));
}

}  // namespace
}  // namespace jostle::perception
