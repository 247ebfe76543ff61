#pragma once
/// \file
/// Where a camera's images come from: topics of ROS 2, or a device, a file, a network stream.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "perception/camera/camera.hpp"
#include "perception/camera/video.hpp"
#include "services/common/process/trouble.hpp"
#include "services/wire/dds/camera_topics.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"

namespace jostle::world {

/// An image as a camera took it.
struct Shot {
  perception::GreyImage image;
  double time = 0.0;  ///< s of the clock that stamps are of
};

/// An ImageSource gives the newest image, and knows the camera. One thread.
class ImageSource {
 public:
  virtual ~ImageSource() = default;

  /// Waits for an image that was not given before; nothing if `deadline` or a stop request comes first.
  /// Error kUnavailable: there will be no other one.
  virtual Result<std::optional<Shot>> take(std::chrono::steady_clock::time_point deadline, std::stop_token stop) = 0;
  /// Returns its intrinsics, once they are known.
  virtual const std::optional<perception::Camera>& camera() const = 0;
  /// Whether all of a file's images were given.
  virtual bool has_ended() const { return false; }
  /// How many messages were no image, or no camera.
  virtual std::uint64_t bad() const { return 0; }
};

/// Images on NAME/image_raw, intrinsics on NAME/camera_info, stamps as they have.
class TopicImages final : public ImageSource {
 public:
  TopicImages(const wire::Participant& participant, const std::string& name);

  Result<std::optional<Shot>> take(std::chrono::steady_clock::time_point deadline, std::stop_token stop) override;
  const std::optional<perception::Camera>& camera() const override { return camera_; }
  std::uint64_t bad() const override { return bad_.count(); }

 private:
  wire::Inbox<sensor_msgs::msg::Image> images_;
  wire::Inbox<sensor_msgs::msg::CameraInfo> infos_;
  std::optional<perception::Camera> camera_;
  common::Trouble bad_{"bad messages of the camera"};
};

/// Images of a video; a thread of its own reads them, a file's as fast as they were taken. Stamps are when it had them.
class VideoImages final : public ImageSource {
 public:
  VideoImages(perception::Video video, const perception::Camera& camera);

  Result<std::optional<Shot>> take(std::chrono::steady_clock::time_point deadline, std::stop_token stop) override;
  const std::optional<perception::Camera>& camera() const override { return camera_; }
  bool has_ended() const override;

 private:
  void read(std::stop_token stop);

  const std::optional<perception::Camera> camera_;
  perception::Video video_;  // of the thread

  mutable std::mutex mutex_;  // guards all down to thread_
  std::condition_variable_any arrived_;
  std::optional<Shot> newest_;
  std::optional<Error> failure_;
  bool has_ended_ = false;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace jostle::world
