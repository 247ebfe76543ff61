// jostle calibrate, as a user starts it, with rendered pictures of a sheet that an arm holds before a camera.

#include <gmock/gmock.h>
#include <lodepng.h>

#include "tests/support/run_fixture.hpp"
#include "tests/support/tag_views.hpp"

namespace jostle::tests {
namespace {

using ::testing::HasSubstr;

class Calibrate : public RunFixture {
 protected:
  // Pictures of the sheet, and a line of poses for each: as the camera stands at X_WC and the page is the flange.
  void show_sheet(const Pose& X_WC) {
    const perception::SceneCamera eye(distorting_camera());
    for (int i = 0; i < kPictures; ++i) {
      const double about = 2 * M_PI * i / kPictures;
      const Eigen::Isometry3d X_CB =
          transform(tilted({0.05 * std::cos(about), 0.03 * std::sin(about), 0.45}, 0.5, about, 0.5 * (i % 3 - 1))) *
          Eigen::Translation3d(-0.095, -0.125, 0);
      const perception::GreyImage image = eye.render(view_of_sheet(pose_of(X_CB)), static_cast<std::uint64_t>(i));
      const std::string file = folder.path() / fmt::format("{:02}.png", i);
      ASSERT_EQ(lodepng::encode(file, image.pixels, static_cast<unsigned>(image.width),
                                static_cast<unsigned>(image.height), LCT_GREY, 8),
                0u);
      pictures.push_back(file);
      const Eigen::Isometry3d X_WF = transform(X_WC) * X_CB;
      const Eigen::AngleAxisd turn(X_WF.linear());
      const Eigen::Vector3d p = X_WF.translation(), w = turn.angle() * turn.axis();
      poses +=
          fmt::format("{:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}\n", p.x(), p.y(), p.z(), w.x(), w.y(), w.z());
    }
  }

  std::unique_ptr<ProgramProcess> calibrate(const std::string& lines) {
    std::vector<std::string> arguments{"hand-eye",
                                       "--camera",
                                       folder.write("camera.yaml", perception::to_yaml(distorting_camera())),
                                       "--poses",
                                       folder.write("poses.txt", lines),
                                       "--mounted",
                                       "sheet"};
    arguments.insert(arguments.end(), pictures.begin(), pictures.end());
    auto program_ended = program("jostle_calibrate", arguments);
    code = program_ended->wait(kPatience).value_or(-1);
    return program_ended;
  }

  static constexpr int kPictures = 9;
  std::vector<std::string> pictures;
  std::string poses = "# x y z, rotation vector\n";
  int code = -1;
};

TEST_F(Calibrate, SaysWhereACameraBesideAnArmIs) {
  ASSERT_NO_FATAL_FAILURE(show_sheet(perception::looking_at({0.6, -0.4, 0.8}, {0, 0, 0})));
  const auto sut = calibrate(poses);
  ASSERT_EQ(code, 0) << sut->err();
  double x = 0, y = 0, z = 0;
  ASSERT_EQ(std::sscanf(sut->out().c_str() + sut->out().find("--at"), "--at %lf %lf %lf", &x, &y, &z), 3) << sut->out();
  EXPECT_NEAR(x, 0.6, 0.002);
  EXPECT_NEAR(y, -0.4, 0.002);
  EXPECT_NEAR(z, 0.8, 0.002);
}

TEST_F(Calibrate, PosesThatAreNoneOrTooFewAreRefused) {
  ASSERT_NO_FATAL_FAILURE(show_sheet(perception::looking_at({0.6, -0.4, 0.8}, {0, 0, 0})));
  EXPECT_THAT(calibrate("1 2 3\n")->err(), HasSubstr("poses.txt:1: got 3 numbers, wanted x y z in m"));
  EXPECT_EQ(code, 2);
  EXPECT_THAT(calibrate("0.1 0.2 0.3 0 0 0\n")->err(), HasSubstr("got 1 poses in"));
  EXPECT_EQ(code, 2);
}

}  // namespace
}  // namespace jostle::tests
