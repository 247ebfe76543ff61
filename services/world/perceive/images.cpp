#include "services/world/perceive/images.hpp"

#include <fmt/format.h>

#include <utility>

#include "services/common/process/program.hpp"
#include "services/world/camera/messages.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;

}  // namespace

TopicImages::TopicImages(const wire::Participant& participant, const std::string& name)
    : images_(participant, wire::camera_image(name), 1), infos_(participant, wire::camera_info(name), 1) {}

Result<std::optional<Shot>> TopicImages::take(steady_clock::time_point deadline, std::stop_token stop) {
  auto image = images_.take(deadline, std::move(stop));
  for (const sensor_msgs::msg::CameraInfo& info : infos_.take_all()) {
    auto camera_result = from_message(info);
    if (camera_result)
      camera_ = *camera_result;
    else
      bad_.warn("{}", camera_result.error().message);
  }
  std::optional<Shot> shot;
  if (!image || !camera_) return shot;
  auto image_result = from_message(*image);
  if (image_result)
    shot = Shot{.image = std::move(image_result).value(), .time = seconds(image->header())};
  else
    bad_.warn("{}", image_result.error().message);
  return shot;
}

VideoImages::VideoImages(perception::Video video, const perception::Camera& camera)
    : camera_(camera), video_(std::move(video)), thread_([this](std::stop_token stop) { read(std::move(stop)); }) {}

void VideoImages::read(std::stop_token stop) {
  const auto begin = steady_clock::now();
  while (!stop.stop_requested()) {
    auto frame_result = video_.next();
    if (frame_result && *frame_result && video_.is_file()) {
      const std::chrono::duration<double> due((*frame_result)->time);
      if (!common::pause_until(begin + std::chrono::duration_cast<steady_clock::duration>(due), stop)) return;
    }
    {
      const std::lock_guard lock(mutex_);
      if (!frame_result) {
        failure_ = frame_result.error();
      } else if (!*frame_result) {
        has_ended_ = true;
      } else {
        const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
        newest_ = Shot{.image = std::move((*frame_result)->image), .time = now.count()};
      }
    }
    arrived_.notify_one();
    if (!frame_result || !*frame_result) return;
  }
}

Result<std::optional<Shot>> VideoImages::take(steady_clock::time_point deadline, std::stop_token stop) {
  std::unique_lock lock(mutex_);
  arrived_.wait_until(lock, std::move(stop), deadline, [this] { return newest_ || failure_ || has_ended_; });
  if (!newest_ && failure_) return *failure_;
  return std::exchange(newest_, std::nullopt);
}

bool VideoImages::has_ended() const {
  const std::lock_guard lock(mutex_);
  return has_ended_ && !newest_;
}

}  // namespace jostle::world
