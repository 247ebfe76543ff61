// jostle ur-sim: a UR5 with a Robotiq gripper that is simulated, with physics, behind the real ones' protocols.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <optional>
#include <thread>

#include "robot_bridge/ur/dashboard.hpp"
#include "robot_bridge/ur/primary.hpp"
#include "robot_bridge/ur_sim/dashboard_server.hpp"
#include "robot_bridge/ur_sim/external_control.hpp"
#include "robot_bridge/ur_sim/gripper_server.hpp"
#include "robot_bridge/ur_sim/pendant.hpp"
#include "robot_bridge/ur_sim/rtde_server.hpp"
#include "robot_bridge/ur_sim/script_server.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/program.hpp"
#include "services/world/arm/arm_scene.hpp"
#include "services/world/camera/camera_out.hpp"
#include "services/world/in_process/in_process_world.hpp"
#include "services/world/link/objects_out.hpp"
#include "services/world/ur_sim/plant.hpp"

namespace {

using namespace jostle;
using namespace jostle::world;
namespace ur_sim = robot_bridge::ur_sim;
using Clock = std::chrono::steady_clock;

constexpr auto kEyes = std::chrono::milliseconds(10);            // between two measurements of the objects
constexpr auto kStandardForms = std::chrono::milliseconds(100);  // and between two as ROS 2's tools want them
constexpr auto kPictures = std::chrono::milliseconds(200);       // each costs some 0.1 s of a core

// What cameras would see of the objects, stamped with the time of day.
class Eyes {
 public:
  Eyes(ObjectsOut& objects, Clock::duration pause) : pause_(pause), objects_(objects) {}

  void look(const physics_pool::ExecutionWorld& world) {
    const auto now = Clock::now();
    if (now < next_) return;
    next_ = now + pause_;
    const std::chrono::duration<double> time = std::chrono::system_clock::now().time_since_epoch();
    objects_.show(world.state(), time.count());
    objects_.tell(object_readings(world.world().geometry().layout, world.state()), time.count());
  }

 private:
  const Clock::duration pause_;
  Clock::time_point next_{};
  ObjectsOut& objects_;
};

struct Options {
  std::string scene_file, address = "127.0.0.1", generation = "cb3", mocap;
  bool has_eyes = true, has_camera = false;
  MocapFaultOptions faults;
  std::uint16_t pendant = 0;  // port; 0: none
};

// The controller and what serves it; everything happens in run().
class Machine {
 public:
  explicit Machine(physics_pool::WorldPtr world, const ur_sim::Generation& generation)
      : plant_(std::move(world)), controller_(plant_, generation), gripper_(plant_) {
    controller_.opening_rate = [this](double dt) { return gripper_.opening_rate(dt); };
    controller_.on_event = [this](const ur_sim::Controller::Event& event) {
      spdlog::info("{}", describe(event));
      if (primary_) primary_->tell(event);
    };
  }

  Result<void> listen(const std::string& address, std::uint16_t pendant_port) {
    using namespace robot_bridge;
    auto rtde = ur_sim::RtdeServer::listen(context_, controller_, address, ur::rtde::kPort);
    if (!rtde) return rtde.error();
    rtde_ = std::move(rtde).value();
    auto primary = ur_sim::ScriptServer::listen(context_, controller_, address, ur::primary::kPort, true);
    if (!primary) return primary.error();
    primary_ = std::move(primary).value();
    auto secondary = ur_sim::ScriptServer::listen(context_, controller_, address, ur::primary::kSecondaryPort, false);
    if (!secondary) return secondary.error();
    secondary_ = std::move(secondary).value();
    auto dashboard = ur_sim::serve_dashboard(context_, controller_, address, ur::kDashboardPort);
    if (!dashboard) return dashboard.error();
    dashboard_ = std::move(dashboard).value();
    auto gripper = ur_sim::serve_gripper(context_, gripper_, address, robotiq::kPort);
    if (!gripper) return gripper.error();
    gripper_server_ = std::move(gripper).value();
    if (pendant_port == 0) return {};
    auto pendant = ur_sim::serve_pendant(context_, controller_, address, pendant_port);
    if (!pendant) return pendant.error();
    pendant_ = std::move(pendant).value();
    return {};
  }

  const StateLayout& layout() { return plant_.world().world().geometry().layout; }

  // In real time. A machine that is too slow makes the arm slow, not jumpy: time that was missed is not made up for.
  Result<void> run(Eyes* eyes, std::stop_token stop) {
    const auto cycle =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(controller_.generation().cycle));
    auto next = Clock::now();
    int boots = controller_.boots();
    while (!stop.stop_requested()) {
      next = std::max(next + cycle, Clock::now() - 5 * cycle);
      if (context_.stopped()) context_.restart();
      context_.run_until(next);
      if (const auto left = next - Clock::now(); left > Clock::duration::zero()) std::this_thread::sleep_for(left);
      external_.tick();
      if (auto ok = controller_.tick(); !ok) return ok;
      if (boots != controller_.boots()) {
        boots = controller_.boots();
        rtde_->drop_clients();
        primary_->drop_clients();
        secondary_->drop_clients();
      }
      rtde_->publish();
      primary_->publish();
      secondary_->publish();
      if (eyes) eyes->look(plant_.world());
    }
    return {};
  }

 private:
  static std::string describe(const ur_sim::Controller::Event& event) {
    using Kind = ur_sim::Controller::Event::Kind;
    switch (event.kind) {
      case Kind::kProgramStarted:
        return fmt::format("program {} started", event.text);
      case Kind::kProgramStopped:
        return fmt::format("program {} stopped", event.text);
      case Kind::kError:
        break;
    }
    return event.text;
  }

  boost::asio::io_context context_{1};
  WorldPlant plant_;
  ur_sim::Controller controller_;
  ur_sim::Gripper gripper_;
  ur_sim::ExternalControl external_{context_, controller_};
  std::unique_ptr<ur_sim::RtdeServer> rtde_;
  std::unique_ptr<ur_sim::ScriptServer> primary_, secondary_;
  std::unique_ptr<robot_bridge::net::TcpServer> dashboard_, gripper_server_, pendant_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Simulates a UR5 with a Robotiq gripper: its controller's protocols, and the physics of its scene.",
               "jostle ur-sim");
  Options options;
  common::ProcessOptions process;
  app.add_option("scene", options.scene_file, "Scene file of a planar gripper; the arm holds its hand there")
      ->required();
  app.add_option("--address", options.address, "IPv4 address to listen at")->capture_default_str();
  auto* generation = app.add_option("--controller", options.generation, "cb3: 125 Hz; e-series: 500 Hz, remote control")
                         ->capture_default_str()
                         ->check(CLI::IsMember({"cb3", "e-series"}));
  common::suggest(generation, {"cb3", "e-series"});
  app.add_option(
         "--pendant", options.pendant,
         "Port that takes lines: protective stop, emergency stop, restart safety, reboot, remote, local (default: "
         "none)")
      ->check(common::port());
  auto* no_eyes = app.add_flag("!--no-eyes", options.has_eyes, "Do not publish where the objects are");
  auto* mocap =
      app.add_option(
             "--mocap", options.mocap,
             "IPv4 address at which a simulated motion capture sees the objects, instead of publishing where they are "
             "(NatNet; `jostle perceive mocap` reads it)")
          ->excludes(no_eyes);
  app.add_flag(
         "--camera", options.has_camera,
         "Render what a camera above the surface sees of the arm, the objects and their tags, five times a second,\n"
         "as /camera/image_raw and /camera/camera_info (`jostle perceive camera` looks at it), instead of\n"
         "publishing where the objects are")
      ->excludes(no_eyes)
      ->excludes(mocap);
  add_mocap_fault_options(app, options.faults);
  common::add_process_options(app, process);
  app.footer(
      "Ports: 29999 dashboard, 30001 primary, 30002 secondary, 30004 RTDE, 63352 gripper.\n"
      "It has no interpreter of URScript: it knows programs that obey registers (`jostle bridge` uploads one), and "
      "lists of "
      "movej, servoj, speedj, stopj, sleep.\n"
      "Exit codes: 0 stopped by a signal, 2 bad input, 3 a port is taken or the physics failed.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  const common::StopSignal signal;
  common::set_up_logging("ur-sim");
  const auto fail = [](const Error& error) {
    spdlog::error("{}", error.message);
    return common::exit_code_of(error);
  };
  auto scene_result = physics_pool::load_scene(options.scene_file);
  if (!scene_result) return fail(scene_result.error());
  auto arm_result = with_arm(*scene_result, {});
  if (!arm_result) return fail(arm_result.error());
  auto world_result = physics_pool::World::compile(*arm_result);
  if (!world_result) return fail(world_result.error());
  const auto& kind = options.generation == "cb3" ? ur_sim::Generation::cb3() : ur_sim::Generation::e_series();
  Machine machine(*world_result, kind);
  if (auto ok = machine.listen(options.address, options.pendant); !ok) return fail(ok.error());
  try {
    std::optional<wire::Participant> participant;
    std::unique_ptr<ObjectsOut> objects;
    if (!options.mocap.empty()) {
      auto cameras_result = MocapCameras::start(options.mocap, machine.layout(), options.faults);
      if (!cameras_result) return fail(cameras_result.error());
      objects = std::move(cameras_result).value();
    } else if (options.has_eyes) {
      auto participant_result = wire::Participant::open(
          {.name = "jostle_ur_sim", .domain = process.domain, .role = wire::Role::kRobot, .waits_for_server = true});
      if (!participant_result) return fail(participant_result.error());
      participant.emplace(*participant_result);
      if (options.has_camera) {
        auto tags_result = tags_of(*arm_result);
        if (!tags_result) return fail(tags_result.error());
        objects = std::make_unique<CameraOut>(*participant, *arm_result, std::move(tags_result).value(), 0);
      } else {
        objects = std::make_unique<ObjectTopics>(*participant, scene_hash(*scene_result), kStandardForms);
      }
    }
    std::optional<Eyes> eyes;
    if (objects) eyes.emplace(*objects, options.has_camera ? kPictures : kEyes);
    spdlog::info("{} ready at {}: scene '{}'", kind.model, options.address, scene_result->name);
    if (auto ok = machine.run(eyes ? &*eyes : nullptr, signal.token()); !ok) return fail(ok.error());
    return common::kExitOk;
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()});
  }
}
