// jostle calibrate: what a camera is like, and where it is, from pictures of a printed sheet of tags.

#include <fmt/format.h>
#include <lodepng.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "idl/types/number.hpp"
#include "idl/types/transform.hpp"
#include "perception/tags/calibration.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"

namespace jostle::tools {
namespace {

using namespace perception;

struct Arguments {
  std::vector<std::filesystem::path> images;
  std::filesystem::path out, camera, poses;
  std::string mounted;
  std::string name = "camera", paper = "a4";
  std::vector<int> ids{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  double size_mm = 45.0;
  std::vector<double> at;  // x, y, m; yaw, degrees
};

Result<GreyImage> read_png(const std::filesystem::path& file) {
  auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  GreyImage image;
  unsigned width = 0, height = 0;
  const auto* bytes = reinterpret_cast<const unsigned char*>(text_result->data());
  if (const unsigned code = lodepng::decode(image.pixels, width, height, bytes, text_result->size(), LCT_GREY, 8))
    return invalid(file.string(), lodepng_error_text(code), "a PNG: others are converted by `convert a.jpg a.png`");
  image.width = static_cast<int>(width);
  image.height = static_cast<int>(height);
  return image;
}

Result<Page> sheet(const Arguments& arguments) {
  std::vector<PrintedTag> tags;
  for (const int id : arguments.ids) tags.push_back({.id = id, .size = arguments.size_mm / 1e3, .label = {}});
  const Paper paper = arguments.paper == "a4" ? Paper{} : Paper{.width = 0.2159, .height = 0.2794};
  auto pages_result = lay_out(tags, paper);
  if (!pages_result) return pages_result.error();
  if (pages_result->size() > 1)
    return invalid("--ids", fmt::format("tags for {} pages", pages_result->size()), "one: fewer or smaller ones");
  return std::move(pages_result->front());
}

struct Pictures {
  int width = 0, height = 0;
  std::vector<std::vector<TagView>> views;
};

Result<Pictures> look(const Arguments& arguments) {
  auto page_result = sheet(arguments);
  if (!page_result) return page_result.error();
  Detector detector({.decimation = 1.0});
  Pictures pictures;
  for (const std::filesystem::path& file : arguments.images) {
    const auto image_result = read_png(file);
    if (!image_result) return image_result.error();
    if (pictures.views.empty()) {
      pictures.width = image_result->width;
      pictures.height = image_result->height;
    } else if (image_result->width != pictures.width || image_result->height != pictures.height) {
      return invalid(file.string(), fmt::format("{}x{} pixels", image_result->width, image_result->height),
                     fmt::format("{}x{} as the first: pictures of one camera, not cut or scaled", pictures.width,
                                 pictures.height));
    }
    pictures.views.push_back(on_board(detector.detect(*image_result), *page_result));
    fmt::print("{}: {} of {} tags\n", file.string(), pictures.views.back().size(), page_result->size());
  }
  return pictures;
}

Result<void> find_camera(const Arguments& arguments) {
  if (auto ok = common::check_outputs({{"--out", arguments.out, {".yaml"}}}); !ok) return ok;
  const auto pictures_result = look(arguments);
  if (!pictures_result) return pictures_result.error();
  auto calibration_result = calibrate(pictures_result->width, pictures_result->height, pictures_result->views);
  if (!calibration_result) return calibration_result.error();
  Camera& camera = calibration_result->camera;
  camera.name = arguments.name;
  if (auto ok = common::write_text(arguments.out, to_yaml(camera)); !ok) return ok;
  fmt::print(
      "{}: focal length {:.2f}, {:.2f} +- {:.2f} pixels, centre {:.2f}, {:.2f} +- {:.2f}; corners are {:.3f} pixels "
      "from where they should be ({} views)\n",
      arguments.out.string(), camera.fx, camera.fy, 2 * calibration_result->focal_sigma, camera.cx, camera.cy,
      2 * calibration_result->centre_sigma, calibration_result->error_px, calibration_result->X_CB.size());
  return {};
}

// X_WB of the page: its x to the right, y down, z into the table.
Eigen::Isometry3d page_pose(const std::vector<double>& at) {
  Eigen::Isometry3d X_WB = Eigen::Isometry3d::Identity();
  X_WB.translation() = Eigen::Vector3d(at[0], at[1], 0);
  X_WB.rotate(Eigen::AngleAxisd(at[2] * M_PI / 180, Eigen::Vector3d::UnitZ()));
  X_WB.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
  return X_WB;
}

Result<void> check_size(const Pictures& pictures, const Camera& camera, const std::filesystem::path& file) {
  if (pictures.width == camera.width && pictures.height == camera.height) return {};
  return invalid("pictures", fmt::format("{}x{} pixels", pictures.width, pictures.height),
                 fmt::format("{}x{} as {} says", camera.width, camera.height, file.string()));
}

Result<void> find_place(const Arguments& arguments) {
  const auto camera_result = load_camera(arguments.camera);
  if (!camera_result) return camera_result.error();
  const auto pictures_result = look(arguments);
  if (!pictures_result) return pictures_result.error();
  if (auto ok = check_size(*pictures_result, *camera_result, arguments.camera); !ok) return ok;
  std::vector<TagView> tags;
  for (const auto& view : pictures_result->views) {
    for (TagView tag : view) {
      tag.X_BT = pose_of(page_pose(arguments.at) * transform(tag.X_BT));
      tags.push_back(tag);
    }
  }
  const auto place_result = locate_camera(*camera_result, tags);
  if (!place_result) return place_result.error();
  const auto& [p, q] = place_result->X_WC;
  fmt::print("--at {:.6f} {:.6f} {:.6f} {:.8f} {:.8f} {:.8f} {:.8f}\n", p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
  fmt::print("known to {:.2f} mm and {:.3f} degrees; corners are {:.3f} pixels from where they should be\n",
             2e3 * place_result->position_sigma, 360 / M_PI * place_result->rotation_sigma, place_result->error_px);
  return {};
}

// Lines of x y z and a rotation: a quaternion w x y z, or a rotation vector as controllers of Universal Robots show it.
Result<std::vector<Pose>> read_poses(const std::filesystem::path& file) {
  const auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  std::vector<Pose> poses;
  std::istringstream lines(*text_result);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.empty() || line.front() == '#') continue;
    std::ranges::replace(line, ',', ' ');
    std::vector<double> v;
    std::istringstream words(line);
    std::string bad;
    for (std::string word; words >> word;) {
      const auto value = parse_number(word);
      if (!value) bad = word;
      v.push_back(value.value_or(0.0));
    }
    const double length = v.size() == 7 ? std::hypot(std::hypot(v[3], v[4]), std::hypot(v[5], v[6])) : 1.0;
    if (!bad.empty() || (v.size() != 6 && v.size() != 7) || std::abs(length - 1) > 0.01) {
      return invalid(fmt::format("{}:{}", file.string(), number),
                     bad.empty() ? fmt::format("{} numbers", v.size()) : fmt::format("'{}'", bad),
                     "x y z in m and a rotation vector in rad, or a unit quaternion w x y z");
    }
    Pose pose{.position = {v[0], v[1], v[2]}};
    if (v.size() == 7) {
      for (std::size_t i = 0; i < 4; ++i) pose.orientation[i] = v[3 + i] / length;
    } else if (const Eigen::Vector3d w(v[3], v[4], v[5]); w.norm() > 0) {
      pose.orientation = pose_of(Eigen::Isometry3d(Eigen::AngleAxisd(w.norm(), w.normalized()))).orientation;
    }
    poses.push_back(pose);
  }
  return poses;
}

Result<void> find_hand_eye(const Arguments& arguments) {
  const auto camera_result = load_camera(arguments.camera);
  if (!camera_result) return camera_result.error();
  const auto poses_result = read_poses(arguments.poses);
  if (!poses_result) return poses_result.error();
  if (poses_result->size() != arguments.images.size())
    return invalid("--poses", fmt::format("{} poses in {}", poses_result->size(), arguments.poses.string()),
                   fmt::format("{}: one for each picture, in the same order", arguments.images.size()));
  const auto pictures_result = look(arguments);
  if (!pictures_result) return pictures_result.error();
  if (auto ok = check_size(*pictures_result, *camera_result, arguments.camera); !ok) return ok;
  std::vector<HandEyeView> views;
  for (std::size_t i = 0; i < poses_result->size(); ++i)
    views.push_back({.X_WF = (*poses_result)[i], .tags = pictures_result->views[i]});
  const bool rides = arguments.mounted == "camera";
  const auto found_result = calibrate_hand_eye(*camera_result, views, rides ? Mounted::kCamera : Mounted::kSheet);
  if (!found_result) return found_result.error();
  const auto numbers = [](const Pose& X) {
    const auto& [p, q] = X;
    return fmt::format("{:.6f} {:.6f} {:.6f} {:.8f} {:.8f} {:.8f} {:.8f}", p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
  };
  if (rides)
    fmt::print("camera in the flange: {}\nsheet in the frame of the poses: {}\n", numbers(found_result->X_camera),
               numbers(found_result->X_sheet));
  else
    fmt::print("--at {}\nsheet in the flange: {}\n", numbers(found_result->X_camera), numbers(found_result->X_sheet));
  fmt::print("the sheet is {:.2f} mm and {:.3f} degrees from where it should be, root mean square of {} pictures\n",
             1e3 * found_result->position_error, 180 / M_PI * found_result->rotation_error, views.size());
  return {};
}

}  // namespace
}  // namespace jostle::tools

int main(int argc, char** argv) {
  using namespace jostle;
  CLI::App app("Finds what a camera is like, and where it is, from pictures of a sheet of tags (`jostle tags print`).",
               "jostle calibrate");
  app.require_subcommand(1);
  tools::Arguments arguments;
  const auto add_sheet = [&](CLI::App& command) {
    command.add_option("images", arguments.images, "Pictures: PNG, whole, not rectified")->required();
    command.add_option("--ids", arguments.ids, "The sheet's tags, in the order in which they were printed")
        ->delimiter(',')
        ->capture_default_str();
    command.add_option("--size", arguments.size_mm, "Their size in mm, as measured on the paper")
        ->capture_default_str()
        ->check(CLI::Range(1.0, 200.0));
    command.add_option("--paper", arguments.paper, "a4 or letter")
        ->capture_default_str()
        ->check(CLI::IsMember({"a4", "letter"}));
  };
  auto* camera = app.add_subcommand(
      "camera",
      "Its intrinsics, as ROS's camera file: ten pictures of the sheet or more, glued to something flat, near\n"
      "enough to fill a third of the image, in all its corners, tilted left, right, up and down");
  add_sheet(*camera);
  camera->add_option("--out", arguments.out, "The camera's file, .yaml")->required();
  camera->add_option("--name", arguments.name, "The camera's name in it")->capture_default_str();
  auto* extrinsics = app.add_subcommand(
      "extrinsics", "Where it is in the world: a picture, or some from one place, of the sheet flat on the surface");
  add_sheet(*extrinsics);
  extrinsics->add_option("--camera", arguments.camera, "The camera's file")->required();
  extrinsics
      ->add_option(
          "--at", arguments.at,
          "Where the paper's top left corner is on the surface, x y in m, and how far its upper edge is turned\n"
          "from the world's x axis, in degrees")
      ->expected(3)
      ->required();
  auto* hand_eye = app.add_subcommand(
      "hand-eye",
      "Where it is on an arm, or beside one: pictures of the sheet, and the flange's pose for each. Either the\n"
      "camera rides on the flange and the sheet lies still, or the sheet rides and the camera stands still");
  add_sheet(*hand_eye);
  hand_eye->add_option("--camera", arguments.camera, "The camera's file")->required();
  hand_eye
      ->add_option("--poses", arguments.poses,
                   "File with a line for each picture: x y z of the flange in m, and a rotation vector in rad (as the\n"
                   "pendant of a UR shows it) or a quaternion w x y z")
      ->required();
  hand_eye->add_option("--mounted", arguments.mounted, "What rides on the flange: camera or sheet")
      ->required()
      ->check(CLI::IsMember({"camera", "sheet"}));
  app.footer("Exit codes: 0 found, 2 bad input, or pictures that do not say enough, 3 a file could not be written.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  const auto ok = camera->parsed()     ? tools::find_camera(arguments)
                  : hand_eye->parsed() ? tools::find_hand_eye(arguments)
                                       : tools::find_place(arguments);
  if (ok) return common::kExitOk;
  fmt::print(stderr, "jostle calibrate: {}\n", ok.error().message);
  return common::exit_code_of(ok.error());
}
