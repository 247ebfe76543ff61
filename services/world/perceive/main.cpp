// jostle perceive: what a sensor sees of the objects, as topics.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <mutex>
#include <set>

#include "perception/natnet/client.hpp"
#include "perception/tracking/tracker.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/program.hpp"
#include "services/world/link/objects_out.hpp"
#include "services/world/perceive/camera.hpp"

namespace {

using namespace jostle;
using namespace jostle::world;
namespace natnet = perception::natnet;
using Clock = std::chrono::steady_clock;

constexpr auto kTick = std::chrono::milliseconds(100);
constexpr auto kUnseen = std::chrono::seconds(1);                // worth a word
constexpr auto kStandardForms = std::chrono::milliseconds(100);  // between two messages of them

// Frames in, topics out. Threads: the client's.
class Sight {
 public:
  Sight(const wire::Participant& participant, bool by_servers_clock)
      : by_servers_clock_(by_servers_clock), topics_(participant, kStandardForms) {}

  void look(const natnet::Seen& seen) {
    const std::chrono::duration<double> exposed = seen.exposed.time_since_epoch();
    const double time = by_servers_clock_ ? seen.timestamp : exposed.count();
    for (const natnet::NamedBody& one : seen.bodies) {
      const auto& p = one.body.position;
      const auto& q = one.body.orientation;
      const bool taken =
          one.body.tracked && tracker_.take(one.name, {p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}, time);
      note(one.name, taken);
    }
    const auto readings = tracker_.readings(time);
    if (!readings.empty()) topics_.tell(readings, time);
  }

  // Objects that were not seen for a while.
  std::set<std::string> unseen() const {
    const std::lock_guard lock(mutex_);
    std::set<std::string> names;
    for (const auto& [name, when] : seen_) {
      if (Clock::now() - when > kUnseen) names.insert(name);
    }
    return names;
  }

 private:
  void note(const std::string& name, bool taken) {
    const std::lock_guard lock(mutex_);
    const auto [found, is_new] = seen_.try_emplace(name);
    if (taken) found->second = Clock::now();
  }

  const bool by_servers_clock_;
  perception::Tracker tracker_;
  ObjectTopics topics_;
  mutable std::mutex mutex_;  // guards seen_
  std::map<std::string, Clock::time_point> seen_;
};

// Says what changes: frames that come or stay away, objects that are lost or found.
void watch(const natnet::Client& client, const Sight& sight, const std::string& host, std::stop_token stop) {
  std::string said = "-";
  std::set<std::string> lost;
  do {
    if (const std::string trouble = client.trouble(); trouble != said) {
      trouble.empty() ? spdlog::info("frames come from {}", host) : spdlog::warn("waiting: {}", trouble);
      said = trouble;
    }
    if (auto unseen = sight.unseen(); unseen != lost) {
      unseen.empty() ? spdlog::info("every object is seen")
                     : spdlog::warn("not seen: {}; kept where they were", fmt::join(unseen, ", "));
      lost = std::move(unseen);
    }
  } while (common::pause_until(Clock::now() + kTick, stop));
  const auto counts = client.counts();
  spdlog::info("{} frames, {} lost on the way, {} bad messages", counts.frames, counts.lost, counts.malformed);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Publishes what a sensor sees of the objects: /objects/states, /objects/poses, /tf.", "jostle perceive");
  app.require_subcommand(1);
  common::ProcessOptions process;
  natnet::Client::Options options;
  std::string stamps = "host";
  auto* mocap = app.add_subcommand("mocap",
                                   "Motion capture that speaks NatNet 3.0 to 4.1; rigid bodies have the names of "
                                   "the scene's objects, and up is z");
  mocap->add_option("--host", options.host, "The server's address or name")->capture_default_str();
  mocap->add_option("--port", options.command_port, "Its command port")->capture_default_str();
  mocap->add_option("--interface", options.interface,
                    "IPv4 address of this host on which multicast is heard (default: the system's choice)");
  mocap
      ->add_option("--stamps", stamps,
                   "host: when a frame was exposed, by this host's clock; server: the frames' own timestamps")
      ->capture_default_str()
      ->check(CLI::IsMember({"host", "server"}));
  common::add_process_options(*mocap, process);
  CameraOptions camera_options;
  std::vector<double> at;
  auto* camera =
      app.add_subcommand("camera", "A camera of ROS 2 that sees AprilTags (36h11) on the tops of the objects");
  camera->add_option("topic", camera_options.name, "Images come on TOPIC/image_raw, intrinsics on TOPIC/camera_info")
      ->capture_default_str();
  camera
      ->add_option("--scene", camera_options.scene,
                   "Scene file; its first object has tag 0, and so on, each as large as fits in whole millimetres")
      ->required();
  camera
      ->add_option("--at", at,
                   "Where the camera is in the world: x y z (m) and the quaternion w x y z; z looks forward, y down\n"
                   "(default: above the middle of the surface, as the simulated camera)")
      ->expected(7);
  common::add_process_options(*camera, process);
  app.footer("Exit codes: 0 stopped by a signal, 2 bad input, 3 a part of the system failed.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  const common::StopSignal signal;
  common::set_up_logging("perceive");
  const auto fail = [](const Error& error) {
    spdlog::error("{}", error.message);
    return common::exit_code_of(error);
  };
  auto participant_result = wire::Participant::open(
      {.name = "jostle_perceive", .domain = process.domain, .role = wire::Role::kRobot, .waits_for_server = true});
  if (!participant_result) return fail(participant_result.error());
  try {
    if (camera->parsed()) {
      if (!at.empty()) {
        const double length = std::hypot(std::hypot(at[3], at[4]), std::hypot(at[5], at[6]));
        if (!(std::abs(length - 1) < 0.01))
          return fail(invalid("--at", fmt::format("a quaternion of length {}", length), "1"));
        camera_options.X_WC = Pose{.position = {at[0], at[1], at[2]}, .orientation = {at[3], at[4], at[5], at[6]}};
      }
      if (auto ok = look_through_camera(*participant_result, camera_options, signal.token()); !ok)
        return fail(ok.error());
      return common::kExitOk;
    }
    Sight sight(*participant_result, stamps == "server");
    auto client_result = natnet::Client::start(options, [&](const natnet::Seen& seen) { sight.look(seen); });
    if (!client_result) return fail(client_result.error());
    spdlog::info("looking for motion capture at {}:{}, domain {}", options.host, options.command_port,
                 participant_result->domain());
    watch(**client_result, sight, options.host, signal.token());
    return common::kExitOk;
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()});
  }
}
