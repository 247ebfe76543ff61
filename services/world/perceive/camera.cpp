#include "services/world/perceive/camera.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <vector>

#include "idl/types/transform.hpp"
#include "perception/tags/detector.hpp"
#include "perception/tags/pose.hpp"
#include "physics_pool/render/picture.hpp"
#include "physics_pool/scene/scene.hpp"
#include "services/common/process/trouble.hpp"
#include "services/world/camera/scene_tags.hpp"
#include "services/world/perceive/images.hpp"
#include "services/world/perceive/sight.hpp"

namespace jostle::world {
namespace {

using Clock = std::chrono::steady_clock;
using Eigen::Isometry3d;

constexpr auto kTick = std::chrono::milliseconds(100);
constexpr auto kSilence = std::chrono::seconds(5);
constexpr double kDoubtfulTilt = 10.0 * M_PI / 180;  // most objects stand
constexpr double kMostDoubt = 9.0;

std::array<double, 36> turned(const std::array<double, 36>& covariance, const Eigen::Matrix3d& R) {
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = R;
  std::array<double, 36> result{};
  Eigen::Map<Matrix6d>(result.data()) = turn * Eigen::Map<const Matrix6d>(covariance.data()) * turn.transpose();
  return result;
}

// What a tag says of its object. Of two minima the likelier one explains the corners better, and stands.
perception::Sighting sighting(const ObjectTag& tag, const perception::PoseEstimate& estimate, const Isometry3d& X_WC) {
  perception::Sighting sighting{.name = tag.object, .explanations = {}, .steady = perception::kSteadyShare};
  const auto add = [&](const perception::Fit& fit) {
    const Isometry3d X_WB = X_WC * transform(fit.X_CB);
    const double tilt = std::acos(std::clamp(X_WB.linear()(2, 2), -1.0, 1.0));
    sighting.explanations.push_back(
        {.X_WB = pose_of(X_WB),
         .covariance = turned(estimate.covariance, X_WC.linear()),
         .surprise = surprise_of(fit, estimate) + std::min(std::pow(tilt / kDoubtfulTilt, 2), kMostDoubt)});
  };
  add(estimate.best);
  if (estimate.other) add(*estimate.other);
  return sighting;
}

void draw_line(physics_pool::Picture& picture, const perception::Pixel& from, const perception::Pixel& to) {
  constexpr std::array<std::uint8_t, 3> kGreen{0, 220, 0};
  const int steps = 1 + static_cast<int>(std::max(std::abs(to.x - from.x), std::abs(to.y - from.y)));
  for (int i = 0; i <= steps; ++i) {
    const double share = static_cast<double>(i) / steps;
    const auto x = std::lround(from.x + share * (to.x - from.x)), y = std::lround(from.y + share * (to.y - from.y));
    if (x < 0 || y < 0 || x >= picture.width || y >= picture.height) continue;
    std::ranges::copy(kGreen, picture.rgb.begin() + 3 * (y * picture.width + x));
  }
}

physics_pool::Picture with_outlines(const perception::GreyImage& image,
                                    const std::vector<perception::Detection>& detections) {
  physics_pool::Picture picture{.width = image.width, .height = image.height};
  picture.rgb.reserve(3 * image.pixels.size());
  for (const std::uint8_t shade : image.pixels) picture.rgb.insert(picture.rgb.end(), 3, shade);
  for (const perception::Detection& detection : detections) {
    for (std::size_t i = 0; i < 4; ++i) draw_line(picture, detection.corners[i], detection.corners[(i + 1) % 4]);
  }
  return picture;
}

// Finds tags in images.
class Looker {
 public:
  Looker(std::vector<ObjectTag> tags, const Pose& X_WC) : tags_(std::move(tags)), X_WC_(transform(X_WC)) {}

  std::vector<perception::Detection> detect(const perception::GreyImage& image) { return detector_.detect(image); }

  std::vector<perception::Sighting> sightings_of(const perception::Camera& camera,
                                                 const std::vector<perception::Detection>& detections) {
    std::vector<perception::Sighting> sightings;
    for (const perception::Detection& detection : detections) {
      const auto tag = std::ranges::find(tags_, detection.id, &ObjectTag::id);
      if (tag == tags_.end()) continue;
      const perception::TagView view{.corners = detection.corners, .size = tag->size, .X_BT = tag->X_BT};
      const auto estimate = perception::estimate_pose(camera, {&view, 1});
      if (estimate)
        sightings.push_back(sighting(*tag, *estimate, X_WC_));
      else
        bad_.warn("tag {}: {}", detection.id, estimate.error().message);
    }
    return sightings;
  }

 private:
  const std::vector<ObjectTag> tags_;
  const Isometry3d X_WC_;
  perception::Detector detector_;
  common::Trouble bad_{"tags without a pose"};
};

Result<std::unique_ptr<ImageSource>> open_source(const wire::Participant& participant, const CameraOptions& options) {
  if (!perception::is_video_source(options.source)) {
    if (options.intrinsics.empty())
      return std::unique_ptr<ImageSource>(std::make_unique<TopicImages>(participant, options.source));
    return invalid("--intrinsics", "it for the topics of '" + options.source + "'",
                   "none: they bring their own on camera_info");
  }
  if (options.intrinsics.empty()) {
    return invalid("--intrinsics", "none for " + options.source,
                   "the file that `jostle calibrate camera` writes: a video says nothing of its lens");
  }
  auto camera_result = perception::load_camera(options.intrinsics);
  if (!camera_result) return camera_result.error();
  auto video_result = perception::Video::open(options.source, camera_result->width, camera_result->height);
  if (!video_result) return video_result.error();
  return std::unique_ptr<ImageSource>(std::make_unique<VideoImages>(std::move(video_result).value(), *camera_result));
}

}  // namespace

Result<void> look_through_camera(const wire::Participant& participant, const CameraOptions& options,
                                 std::stop_token stop) {
  auto scene_result = physics_pool::load_scene(options.scene);
  if (!scene_result) return scene_result.error();
  auto tags_result = tags_of(*scene_result);
  if (!tags_result) return tags_result.error();
  auto source_result = open_source(participant, options);
  if (!source_result) return source_result.error();
  ImageSource& source = **source_result;
  Looker looker(std::move(tags_result).value(), options.X_WC.value_or(overhead(*scene_result)));
  Sight sight(participant, std::move(scene_result).value());
  common::Trouble bad("images of another size");
  std::uint64_t frames = 0;
  Clock::time_point silent_since = Clock::now();
  perception::GreyImage last;
  std::vector<perception::Detection> found_last;
  spdlog::info("looking at {}, domain {}", options.source, participant.domain());
  while (!stop.stop_requested() && !source.has_ended()) {
    auto shot_result = source.take(Clock::now() + kTick, stop);
    if (!shot_result) return shot_result.error();
    if (!*shot_result) {
      if (frames == 0 && Clock::now() > silent_since + kSilence) {
        silent_since = Clock::now();
        spdlog::warn("no image{} from {} for {} s; `jostle doctor --camera {}` says what comes",
                     source.camera() ? "" : ", or no intrinsics,", options.source, kSilence.count(), options.source);
      }
      continue;
    }
    const perception::GreyImage& image = (*shot_result)->image;
    const perception::Camera& camera = *source.camera();
    if (image.width != camera.width || image.height != camera.height) {
      bad.warn("image: got {}x{} pixels, wanted {}x{} as the intrinsics say", image.width, image.height, camera.width,
               camera.height);
      continue;
    }
    if (frames++ == 0) spdlog::info("frames come from {}", options.source);
    found_last = looker.detect(image);
    sight.look((*shot_result)->time, looker.sightings_of(camera, found_last));
    sight.say_unseen();
    last = std::move((*shot_result)->image);
  }
  spdlog::info("{} frames, {} bad messages", frames, source.bad() + bad.count());
  sight.say_counts();
  if (options.snapshot.empty()) return {};
  if (frames == 0) return Error{Code::kIo, fmt::format("{}: no image came", options.snapshot.string())};
  return physics_pool::write_png(options.snapshot, with_outlines(last, found_last));
}

}  // namespace jostle::world
