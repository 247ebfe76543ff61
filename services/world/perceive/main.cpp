// jostle perceive: what a sensor sees of the objects, as topics.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <optional>
#include <vector>

#include "perception/natnet/client.hpp"
#include "physics_pool/scene/scene.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/program.hpp"
#include "services/world/perceive/camera.hpp"
#include "services/world/perceive/sight.hpp"

namespace {

using namespace jostle;
using namespace jostle::world;
namespace natnet = perception::natnet;
using Clock = std::chrono::steady_clock;

constexpr auto kTick = std::chrono::milliseconds(100);
constexpr double kMarkers = 0.04;  // m, about what markers are from the middle of an object

struct MocapOptions {
  natnet::Client::Options client;
  bool by_servers_clock = false;
  double noise = 0.0005;  // m
};

std::vector<perception::Sighting> sightings(const natnet::Seen& seen, double noise) {
  std::vector<perception::Sighting> sightings;
  for (const natnet::NamedBody& one : seen.bodies) {
    if (!one.body.tracked) continue;
    const auto& p = one.body.position;
    const auto& q = one.body.orientation;
    perception::Explanation explanation{
        .X_WB = {.position = {p[0], p[1], p[2]}, .orientation = {q[0], q[1], q[2], q[3]}}};
    const double sigma = std::hypot(noise, one.body.mean_error);
    for (std::size_t i = 0; i < 6; ++i) explanation.covariance[7 * i] = std::pow(i < 3 ? sigma : sigma / kMarkers, 2);
    sightings.push_back({one.name, {explanation}});
  }
  return sightings;
}

// Says what changes: frames that come or stay away, objects that are lost or found.
void watch(const natnet::Client& client, Sight& sight, const std::string& host, std::stop_token stop) {
  std::string said = "-";
  do {
    if (const std::string trouble = client.trouble(); trouble != said) {
      trouble.empty() ? spdlog::info("frames come from {}", host) : spdlog::warn("waiting: {}", trouble);
      said = trouble;
    }
    sight.say_unseen();
  } while (common::pause_until(Clock::now() + kTick, stop));
  const auto counts = client.counts();
  spdlog::info("{} frames, {} lost on the way, {} bad messages", counts.frames, counts.lost, counts.malformed);
  sight.say_counts();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Publishes what a sensor sees of the objects: /objects/states, /objects/poses, /tf.", "jostle perceive");
  app.require_subcommand(1);
  common::ProcessOptions process;
  MocapOptions options;
  std::string stamps = "host", mocap_scene;
  auto* mocap = app.add_subcommand("mocap",
                                   "Motion capture that speaks NatNet 3.0 to 4.1; rigid bodies have the names of "
                                   "the scene's objects, and up is z");
  mocap->add_option("--host", options.client.host, "The server's address or name")->capture_default_str();
  mocap->add_option("--port", options.client.command_port, "Its command port")
      ->capture_default_str()
      ->check(common::port(1));
  mocap->add_option("--interface", options.client.interface,
                    "IPv4 address of this host on which multicast is heard (default: the system's choice)");
  mocap
      ->add_option("--stamps", stamps,
                   "host: when a frame was exposed, by this host's clock; server: the frames' own timestamps")
      ->capture_default_str()
      ->check(CLI::IsMember({"host", "server"}));
  mocap->add_option("--scene", mocap_scene,
                    "Scene file: objects that may well stand are published standing, and none inside another\n"
                    "(default: as they are estimated)");
  mocap->add_option("--noise", options.noise, "Standard deviation of a coordinate, m; rotations follow from it")
      ->capture_default_str()
      ->check(CLI::Range(1e-5, 1.0));
  common::add_process_options(*mocap, process);
  CameraOptions camera_options;
  std::vector<double> at;
  auto* camera = app.add_subcommand("camera", "A camera that sees AprilTags (36h11) on the tops of the objects");
  camera
      ->add_option(
          "source", camera_options.source,
          "A device (/dev/video0), a video file, or an address (rtsp://HOST/PATH); else the name of a camera of\n"
          "ROS 2: images come on NAME/image_raw, intrinsics on NAME/camera_info")
      ->capture_default_str();
  camera->add_option("--intrinsics", camera_options.intrinsics,
                     "Of a device, a file or an address: the camera's file that `jostle calibrate camera` writes");
  camera
      ->add_option("--scene", camera_options.scene,
                   "Scene file; its first object has tag 0, and so on, each as large as fits in whole millimetres")
      ->required();
  camera
      ->add_option("--at", at,
                   "Where the camera is in the world: x y z (m) and the quaternion w x y z; z looks forward, y down\n"
                   "(default: above the middle of the surface, as the simulated camera)")
      ->expected(7);
  camera->add_option("--snapshot", camera_options.snapshot,
                     "PNG of the last image with the tags that were found in it outlined, written at the end");
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
    std::optional<physics_pool::Scene> scene;
    if (!mocap_scene.empty()) {
      auto scene_result = physics_pool::load_scene(mocap_scene);
      if (!scene_result) return fail(scene_result.error());
      scene = std::move(scene_result).value();
    }
    options.by_servers_clock = stamps == "server";
    Sight sight(*participant_result, std::move(scene));
    auto client_result = natnet::Client::start(options.client, [&](const natnet::Seen& seen) {
      const std::chrono::duration<double> exposed = seen.exposed.time_since_epoch();
      sight.look(options.by_servers_clock ? seen.timestamp : exposed.count(), sightings(seen, options.noise));
    });
    if (!client_result) return fail(client_result.error());
    spdlog::info("looking for motion capture at {}:{}, domain {}", options.client.host, options.client.command_port,
                 participant_result->domain());
    watch(**client_result, sight, options.client.host, signal.token());
    return common::kExitOk;
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()});
  }
}
