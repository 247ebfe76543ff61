#include "services/world/camera/messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

constexpr const char* kFrame = "camera";
constexpr std::uint32_t kLargest = 1 << 14;  // pixels

std::optional<std::size_t> bytes_per_pixel(const std::string& encoding) {
  if (encoding == "mono8") return 1;
  if (encoding == "rgb8" || encoding == "bgr8") return 3;
  if (encoding == "rgba8" || encoding == "bgra8") return 4;
  return std::nullopt;
}

}  // namespace

sensor_msgs::msg::Image to_message(const perception::GreyImage& image, double time) {
  sensor_msgs::msg::Image message;
  message.header(make_header(time, kFrame));
  message.width(static_cast<std::uint32_t>(image.width));
  message.height(static_cast<std::uint32_t>(image.height));
  message.encoding("mono8");
  message.step(message.width());
  message.data(image.pixels);
  return message;
}

sensor_msgs::msg::CameraInfo to_message(const perception::Camera& camera, double time) {
  sensor_msgs::msg::CameraInfo message;
  message.header(make_header(time, kFrame));
  message.width(static_cast<std::uint32_t>(camera.width));
  message.height(static_cast<std::uint32_t>(camera.height));
  message.distortion_model("plumb_bob");
  message.d().assign(camera.distortion.begin(), camera.distortion.end());
  message.k({camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1});
  message.r({1, 0, 0, 0, 1, 0, 0, 0, 1});
  message.p({camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0});
  return message;
}

Result<perception::GreyImage> from_message(const sensor_msgs::msg::Image& message) {
  const auto channels = bytes_per_pixel(message.encoding());
  if (!channels)
    return invalid("image.encoding", "'" + message.encoding().substr(0, 32) + "'", "mono8, rgb8, bgr8, rgba8 or bgra8");
  if (message.width() < 1 || message.height() < 1 || message.width() > kLargest || message.height() > kLargest)
    return invalid("image", fmt::format("{}x{} pixels", message.width(), message.height()),
                   fmt::format("1x1 to {}x{}", kLargest, kLargest));
  if (message.step() < message.width() * *channels)
    return invalid("image.step", fmt::format("{}", message.step()),
                   fmt::format("at least {}", message.width() * *channels));
  if (message.data().size() != static_cast<std::size_t>(message.step()) * message.height())
    return invalid("image.data", fmt::format("{} bytes", message.data().size()),
                   fmt::format("{} * {}", message.step(), message.height()));
  perception::GreyImage image{.width = static_cast<int>(message.width()), .height = static_cast<int>(message.height())};
  image.pixels.reserve(static_cast<std::size_t>(message.width()) * message.height());
  for (std::size_t y = 0; y < message.height(); ++y) {
    const std::uint8_t* row = message.data().data() + y * message.step();
    if (*channels == 1) {
      image.pixels.insert(image.pixels.end(), row, row + message.width());
      continue;
    }
    for (std::size_t x = 0; x < message.width(); ++x) {
      const std::uint8_t* pixel = row + x * *channels;
      image.pixels.push_back(static_cast<std::uint8_t>((pixel[0] + pixel[1] + pixel[2]) / 3));
    }
  }
  return image;
}

Result<perception::Camera> from_message(const sensor_msgs::msg::CameraInfo& message) {
  if (message.distortion_model() != "plumb_bob" || message.d().size() != 5)
    return invalid("camera_info.distortion_model",
                   fmt::format("'{}' of {} coefficients", message.distortion_model().substr(0, 32), message.d().size()),
                   "plumb_bob of 5");
  const auto& k = message.k();
  perception::Camera camera{.width = static_cast<int>(message.width()),
                            .height = static_cast<int>(message.height()),
                            .fx = k[0],
                            .fy = k[4],
                            .cx = k[2],
                            .cy = k[5]};
  std::ranges::copy(message.d(), camera.distortion.begin());
  const auto finite = [](double value) { return std::isfinite(value); };
  if (!std::ranges::all_of(k, finite) || !std::ranges::all_of(camera.distortion, finite) || !(camera.fx > 0) ||
      !(camera.fy > 0))
    return invalid("camera_info", fmt::format("fx {}, fy {}", camera.fx, camera.fy),
                   "finite numbers, fx and fy > 0: is the camera calibrated?");
  return camera;
}

}  // namespace jostle::world
