#include "perception/camera/video.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <utility>
#include <vector>

namespace jostle::perception {
namespace {

namespace fs = std::filesystem;

constexpr int kOpening = 5000, kReading = 2000;  // ms, that a stream may take
constexpr double kUsualRate = 30.0;              // images per second, of a file that does not say

bool is_address(const std::string& text) { return text.find("://") != std::string::npos; }

std::optional<int> device_of(const std::string& text) {
  constexpr std::string_view kDevice = "/dev/video";
  const std::string number = text.starts_with(kDevice) ? text.substr(kDevice.size()) : "";
  if (number.empty() || number.size() > 3 || number.find_first_not_of("0123456789") != number.npos) return {};
  return std::stoi(number);
}

GreyImage grey(const cv::Mat& picture) {
  cv::Mat shades = picture;
  if (picture.channels() == 3) cv::cvtColor(picture, shades, cv::COLOR_BGR2GRAY);
  if (picture.channels() == 4) cv::cvtColor(picture, shades, cv::COLOR_BGRA2GRAY);
  GreyImage image{.width = shades.cols, .height = shades.rows, .pixels = {}};
  image.pixels.reserve(static_cast<std::size_t>(shades.cols) * static_cast<std::size_t>(shades.rows));
  for (int row = 0; row < shades.rows; ++row) {
    const auto* first = shades.ptr<std::uint8_t>(row);
    image.pixels.insert(image.pixels.end(), first, first + shades.cols);
  }
  return image;
}

}  // namespace

bool is_video_source(const std::string& text) {
  std::error_code missing;
  return is_address(text) || text.starts_with("/dev/") || fs::is_regular_file(text, missing);
}

struct Video::Parts {
  std::string source;
  bool is_file = false;
  double period = 1.0 / kUsualRate;  // s, of a file
  long count = 0;                    // images so far
  cv::VideoCapture capture;
};

Video::Video(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Video::Video(Video&&) noexcept = default;
Video& Video::operator=(Video&&) noexcept = default;
Video::~Video() = default;

Result<Video> Video::open(const std::string& source, int width, int height) {
  auto parts = std::make_unique<Parts>();
  parts->source = source;
  const auto device = device_of(source);
  std::error_code missing;
  if (!is_address(source) && !fs::exists(source, missing)) {
    return Error{Code::kNotFound, fmt::format("{}: got no such {}, wanted one", source, device ? "device" : "file")};
  }
  parts->is_file = !device && !is_address(source);
  bool is_open = false;
  if (device) {
    setenv("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "2", 0);  // s; else it waits ten for a camera that was unplugged
    is_open = parts->capture.open(*device, cv::CAP_V4L2);
  } else {
    is_open = parts->capture.open(source, cv::CAP_FFMPEG,
                                  {cv::CAP_PROP_OPEN_TIMEOUT_MSEC, kOpening, cv::CAP_PROP_READ_TIMEOUT_MSEC, kReading});
  }
  if (!is_open) {
    return Error{Code::kUnavailable,
                 fmt::format("{}: cannot be opened as a video; {}", source,
                             device ? "another program may have it, or this user may not (group video)"
                                    : "`ffprobe` says what it is")};
  }
  if (width > 0) parts->capture.set(cv::CAP_PROP_FRAME_WIDTH, width);
  if (height > 0) parts->capture.set(cv::CAP_PROP_FRAME_HEIGHT, height);
  if (device) parts->capture.set(cv::CAP_PROP_BUFFERSIZE, 1);  // nobody wants yesterday's
  const double rate = parts->capture.get(cv::CAP_PROP_FPS);
  if (parts->is_file && rate > 0) parts->period = 1.0 / rate;
  return Video(std::move(parts));
}

Result<std::optional<VideoFrame>> Video::next() {
  cv::Mat picture;
  if (!parts_->capture.read(picture) || picture.empty()) {
    if (parts_->is_file && parts_->count > 0) return std::optional<VideoFrame>();
    return Error{Code::kUnavailable, fmt::format("{}: gives no image{}", parts_->source,
                                                 parts_->count > 0 ? " any more; is it unplugged?" : "")};
  }
  const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
  const double time = parts_->is_file ? static_cast<double>(parts_->count) * parts_->period : now.count();
  ++parts_->count;
  return std::optional(VideoFrame{.image = grey(picture), .time = time});
}

bool Video::is_file() const { return parts_->is_file; }

}  // namespace jostle::perception
