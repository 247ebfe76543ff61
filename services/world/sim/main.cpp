// jostle sim: a simulated world that takes commands and publishes what it is
// seen to do.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "physics_pool/uncertainty/belief.hpp"
#include "physics_pool/uncertainty/levels.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/domain_claim.hpp"
#include "services/common/process/program.hpp"
#include "services/world/camera/camera_out.hpp"
#include "services/world/link/simulated_world.hpp"

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::world;
  CLI::App app("Simulates the world in which actions happen.", "jostle sim");
  std::string scene_file, belief_file, level = "none", mocap;
  bool has_camera = false;
  std::uint64_t seed = 0;
  MocapFaultOptions faults;
  SimulatedWorldOptions options;
  wire::ParticipantOptions participant_options{
      .name = "jostle_sim", .role = wire::Role::kRobot, .waits_for_server = true};
  common::ProcessOptions process;
  app.add_option("scene", scene_file, "Scene file")->required();
  auto* uncertainty =
      app.add_option("--uncertainty", level, "How disturbed it is and how badly seen: none, low, medium, high")
          ->capture_default_str();
  common::suggest(uncertainty, {"none", "low", "medium", "high"});
  double slope = 0.0;
  app.add_option("--noise", slope, "How its noise grows with the robot's speed, beside that (b of Eq. 5.10)")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  common::add_seed_option(app, "--seed", seed, "Of the noise");
  app.add_option("--belief", belief_file,
                 "The planner's scene: where its objects are is what is measured first (default: drawn as\n"
                 "`jostle scene perturb` does from --uncertainty and --seed)");
  app.add_option("--rate", options.rate, "World seconds per second; 0: as fast as possible")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0));
  app.add_flag("--free-running", options.free_running, "Go on between actions instead of standing still");
  auto* camera_option = app.add_flag(
      "--camera", has_camera,
      "Render what a camera above the surface sees of the objects and their tags, as /camera/image_raw and\n"
      "/camera/camera_info (`jostle perceive camera` looks at it); they are not published otherwise then");
  app.add_option("--mocap", mocap,
                 "IPv4 address at which a simulated motion capture sees the objects (NatNet; `jostle perceive mocap`\n"
                 "reads it); they are not published then (default: none)")
      ->excludes(camera_option);
  add_mocap_fault_options(app, faults);
  common::add_process_options(app, process);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  participant_options.domain = process.domain;
  const common::StopSignal signal;
  common::set_up_logging("sim");

  const auto fail = [](const Error& error) {
    spdlog::error("{}", error.message);
    return common::exit_code_of(error);
  };
  auto level_result = physics_pool::parse_uncertainty(level);
  if (!level_result) return fail(level_result.error());
  auto scene_result = physics_pool::load_scene(scene_file);
  if (!scene_result) return fail(scene_result.error());
  options.noise = {.sigma = physics_pool::velocity_noise(*level_result), .slope = slope, .seed = seed};
  if (belief_file.empty()) {
    options.belief = physics_pool::perturb(*scene_result, *level_result, seed);
  } else {
    auto belief_result = physics_pool::load_scene(belief_file);
    if (!belief_result) return fail(belief_result.error());
    options.belief = std::move(belief_result).value();
    if (auto ok = physics_pool::check_belief(*scene_result, options.belief); !ok) {
      return fail({ok.error().code, fmt::format("--belief: {}", ok.error().message)});
    }
  }
  auto world_result = physics_pool::World::compile(*scene_result);
  if (!world_result) return fail(world_result.error());
  auto participant_result = wire::Participant::open(participant_options);
  if (!participant_result) return fail(participant_result.error());
  // Before it says a word.
  const auto claim_result = common::DomainClaim::take("simulated world", participant_result->domain(),
                                                      std::chrono::seconds(1), participant_result->space());
  if (!claim_result) return fail(claim_result.error());

  try {
    std::unique_ptr<ObjectsOut> objects;
    if (has_camera) {
      auto tags_result = tags_of(*scene_result);
      if (!tags_result) return fail(tags_result.error());
      objects = std::make_unique<CameraOut>(*participant_result, *scene_result, std::move(tags_result).value(), seed);
    } else if (mocap.empty()) {
      objects = std::make_unique<ObjectTopics>(*participant_result, (*world_result)->hash());
    } else {
      auto cameras_result = MocapCameras::start(mocap, physics_pool::layout_of(*scene_result), faults);
      if (!cameras_result) return fail(cameras_result.error());
      objects = std::move(cameras_result).value();
    }
    SimulatedWorld world(*participant_result, *world_result, options, *objects);
    RobotServer server(*participant_result, world);
    spdlog::info("world '{}' of {} objects on domain {}, uncertainty {}", scene_result->name,
                 scene_result->objects.size(), participant_result->domain(), level);
    if (auto ok = server.run(signal.token()); !ok) return fail(ok.error());
    return common::kExitOk;
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()});
  }
}
