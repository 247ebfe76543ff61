#include "services/tools/doctor/sensors.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "perception/tags/detector.hpp"
#include "services/wire/dds/camera_topics.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/world/camera/messages.hpp"

namespace jostle::tools {
namespace {

using std::chrono::steady_clock;

constexpr auto kPatience = std::chrono::seconds(5);  // for the first frame, or image
constexpr auto kLook = std::chrono::seconds(3);      // from then on
constexpr auto kTick = std::chrono::milliseconds(50);
constexpr double kFewFrames = 10.0;  // per second: objects that are pushed are seen too late
constexpr const char* kPage = "docs/perception.md";

double seconds_since(steady_clock::time_point begin) {
  return std::chrono::duration<double>(steady_clock::now() - begin).count();
}

// What a server sends while we listen.
class Watch {
 public:
  void take(const perception::natnet::Seen& seen) {
    const std::lock_guard lock(mutex_);
    if (frames_++ == 0) begin_ = steady_clock::now();
    for (const perception::natnet::NamedBody& one : seen.bodies) tracked_[one.name] += one.body.tracked ? 1 : 0;
  }

  struct Result {
    std::uint64_t frames = 0;
    double seconds = 0.0;                          // since the first
    std::map<std::string, std::uint64_t> tracked;  // frames in which each body was seen
  };
  Result result() const {
    const std::lock_guard lock(mutex_);
    return {frames_, frames_ > 0 ? seconds_since(begin_) : 0.0, tracked_};
  }

 private:
  mutable std::mutex mutex_;  // guards all
  std::uint64_t frames_ = 0;
  steady_clock::time_point begin_;
  std::map<std::string, std::uint64_t> tracked_;
};

Check frames_of(const Watch::Result& seen, const perception::natnet::Client::Counts& counts) {
  const double rate = static_cast<double>(seen.frames) / seen.seconds;
  Check check{.name = "frames",
              .finding = fmt::format("{:.0f} per second, {} lost, {} malformed", rate, counts.lost, counts.malformed)};
  if (rate < kFewFrames || counts.lost > 0 || counts.malformed > 0) {
    check.verdict = Verdict::kWarn;
    check.remedy = "a wired network for the server and this host, and nothing else that takes all cores";
  }
  return check;
}

Check bodies_of(const Watch::Result& seen) {
  std::vector<std::string> names, hidden;
  for (const auto& [name, frames] : seen.tracked) (frames > 0 ? names : hidden).push_back(name);
  if (names.empty() && hidden.empty()) {
    return {"rigid bodies", Verdict::kFail, "none in its frames",
            fmt::format("make a rigid body of each object in the motion capture's own program, by the name that the "
                        "scene has, and stream rigid bodies: {}",
                        kPage)};
  }
  Check check{.name = "rigid bodies", .finding = fmt::format("{}", fmt::join(names, ", "))};
  if (!hidden.empty()) {
    check.verdict = Verdict::kWarn;
    check.finding += fmt::format("{}hidden all the time: {}", names.empty() ? "" : "; ", fmt::join(hidden, ", "));
    check.remedy = "move what is in the way, or give these bodies larger markers";
  }
  return check;
}

Check clock_of(const perception::natnet::Client::Counts& counts) {
  if (counts.round_trip > 0) {
    return {"clock", Verdict::kOk, fmt::format("echoed in {:.2f} ms", 1e3 * counts.round_trip), ""};
  }
  return {"clock", Verdict::kWarn, "the server echoes nothing: frames are stamped as they come",
          "NatNet 3.0 or newer; or `jostle perceive mocap --stamps server`"};
}

// What comes from a camera while we listen.
struct Images {
  std::uint64_t count = 0, unreadable = 0;
  double seconds = 0.0;  // since the first
  std::string encoding, problem;
  perception::GreyImage newest;
  std::optional<sensor_msgs::msg::CameraInfo> info;
};

Images listen(const wire::Participant& participant, const std::string& name) {
  wire::Inbox<sensor_msgs::msg::Image> images(participant, wire::camera_image(name), 4);
  wire::Inbox<sensor_msgs::msg::CameraInfo> infos(participant, wire::camera_info(name), 4);
  Images seen;
  const auto start = steady_clock::now();
  std::optional<steady_clock::time_point> first;
  while (steady_clock::now() < (first ? *first + kLook : start + kPatience)) {
    const auto image = images.take(steady_clock::now() + kTick);
    for (sensor_msgs::msg::CameraInfo& info : infos.take_all()) seen.info = std::move(info);
    if (!image) continue;
    if (!first) first = steady_clock::now();
    ++seen.count;
    seen.encoding = image->encoding();
    auto grey_result = world::from_message(*image);
    if (grey_result) {
      seen.newest = std::move(grey_result).value();
    } else {
      ++seen.unreadable;
      seen.problem = grey_result.error().message;
    }
  }
  if (first) seen.seconds = seconds_since(*first);
  return seen;
}

Check images_of(const Images& seen, const std::string& name) {
  const std::string topic = fmt::format("{}{}/image_raw", name.starts_with('/') ? "" : "/", name);
  if (seen.count == 0) {
    return {"camera", Verdict::kFail, fmt::format("no image on {} for {} s", topic, kPatience.count()),
            "start the camera's ROS 2 driver on the same ROS_DOMAIN_ID, and name what stands before /image_raw"};
  }
  if (seen.unreadable > 0) {
    return {"camera", Verdict::kFail,
            fmt::format("{}: {} of {} images: {}", topic, seen.unreadable, seen.count, seen.problem),
            "have the driver publish mono8, rgb8, bgr8, rgba8 or bgra8"};
  }
  const double rate = static_cast<double>(seen.count) / seen.seconds;
  Check check{.name = "camera",
              .finding = fmt::format("{}: {:.1f} images per second of {}x{}, {}", topic, rate, seen.newest.width,
                                     seen.newest.height, seen.encoding)};
  if (rate < kFewFrames) {
    check.verdict = Verdict::kWarn;
    check.remedy = "more light for shorter exposures, smaller images, a wired network";
  }
  return check;
}

Check intrinsics_of(const Images& seen, const std::string& name) {
  const std::string topic = fmt::format("{}{}/camera_info", name.starts_with('/') ? "" : "/", name);
  const std::string calibrate = fmt::format("`jostle calibrate camera`, and give its file to the driver: {}", kPage);
  if (!seen.info) return {"intrinsics", Verdict::kFail, fmt::format("none on {}", topic), calibrate};
  const auto camera_result = world::from_message(*seen.info);
  if (!camera_result) {
    return {"intrinsics", Verdict::kFail, fmt::format("{}: {}", topic, camera_result.error().message), calibrate};
  }
  const auto width = static_cast<int>(seen.info->width()), height = static_cast<int>(seen.info->height());
  if (width != seen.newest.width || height != seen.newest.height) {
    return {"intrinsics", Verdict::kFail,
            fmt::format("{}: of images of {}x{}, got such of {}x{}", topic, width, height, seen.newest.width,
                        seen.newest.height),
            calibrate};
  }
  return {"intrinsics", Verdict::kOk, fmt::format("focal length {:.0f} pixels", camera_result->fx), ""};
}

Check tags_of(const Images& seen) {
  std::vector<int> ids;
  for (const perception::Detection& detection : perception::Detector().detect(seen.newest)) ids.push_back(detection.id);
  if (ids.empty()) {
    return {"tags", Verdict::kWarn, "none of family 36h11 in the newest image",
            "nearer, sharper, more light, larger tags with their white margin (`jostle tags print`); `jostle perceive "
            "camera --snapshot FILE` shows what it looks at"};
  }
  return {"tags", Verdict::kOk, fmt::format("{}: {}", ids.size(), fmt::join(ids, ", ")), ""};
}

}  // namespace

std::vector<Check> check_mocap(const perception::natnet::Client::Options& options) {
  constexpr const char* kName = "motion capture";
  Watch watch;
  auto client_result = perception::natnet::Client::start(options, [&](const auto& seen) { watch.take(seen); });
  if (!client_result) return {{kName, Verdict::kFail, client_result.error().message, "see --mocap"}};
  const auto start = steady_clock::now();
  while (watch.result().frames == 0 && steady_clock::now() < start + kPatience) std::this_thread::sleep_for(kTick);
  if (watch.result().frames == 0) {
    return {{kName, Verdict::kFail, (*client_result)->trouble(),
             fmt::format("the server's address, its streaming switched on, ports 1510 and 1511 open: {}", kPage)}};
  }
  std::this_thread::sleep_for(kLook);
  const auto counts = (*client_result)->counts();
  const Watch::Result seen = watch.result();
  return {{kName, Verdict::kOk, fmt::format("frames come from {}:{}", options.host, options.command_port), ""},
          frames_of(seen, counts),
          bodies_of(seen),
          clock_of(counts)};
}

std::vector<Check> check_camera(const wire::Participant& participant, const std::string& name) {
  const Images seen = listen(participant, name);
  std::vector<Check> checks{images_of(seen, name)};
  if (checks.front().verdict == Verdict::kFail) return checks;
  checks.push_back(intrinsics_of(seen, name));
  checks.push_back(tags_of(seen));
  return checks;
}

}  // namespace jostle::tools
