#pragma once
/// \file
/// Images of a device, a file or a network stream, by OpenCV.

#include <memory>
#include <optional>
#include <string>

#include "idl/types/result.hpp"
#include "perception/camera/image.hpp"

namespace jostle::perception {

/// Whether a text names a video rather than something else: a device (/dev/video0), a file that is there, or an address
/// such as rtsp://HOST/PATH.
bool is_video_source(const std::string& text);

/// An image, and when it was taken.
struct VideoFrame {
  GreyImage image;
  double time = 0.0;  ///< s: of a file since its first image; of anything else since 1970, as this host received it
};

/// A Video gives one image after the other.
///
/// Threads  one at a time. next() waits for a camera, two seconds at most.
class Video {
 public:
  /// `width`, `height`: what a device is asked for, pixels; 0: what it does by itself.
  /// Errors   kNotFound     no such device or file
  ///          kUnavailable  it cannot be opened, or another program has it
  static Result<Video> open(const std::string& source, int width = 0, int height = 0);
  Video(Video&&) noexcept;
  Video& operator=(Video&&) noexcept;
  ~Video();

  /// Returns nothing at the end of a file.
  /// Error kUnavailable: a device or a stream that gives no image any more.
  Result<std::optional<VideoFrame>> next();

  bool is_file() const;

 private:
  struct Parts;
  explicit Video(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace jostle::perception
