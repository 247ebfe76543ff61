#include "planners/controllers/catalogue.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "physics_pool/task/kinds.hpp"

namespace jostle::planners {
namespace {

using physics_pool::Scene;

// The hand that OR and NR steer moves in the plane and turns.
bool grasps_in_the_plane(const Scene& scene) {
  const auto planar = as_planar(scene.robot.model);
  return scene.task.kind == physics_pool::kGrasp.name && planar && planar->rotation >= 0;
}

bool pushes_in_the_plane(const Scene& scene) {
  return scene.task.kind == physics_pool::kPush.name && as_planar(scene.robot.model);
}

template <ControlOptions::Method method>
Result<Outcome> grasp(const ControlSetup& setup, const ControllerOptions& options, const OnEvent& on_event,
                      std::stop_token stop) {
  ControlOptions control = options.control;
  control.method = method;
  return run_controller(setup, control, on_event, std::move(stop));
}

Result<Outcome> push(const ControlSetup& setup, const ControllerOptions& options, const OnEvent& on_event,
                     std::stop_token stop) {
  return run_mpc(setup, options.mpc, on_event, std::move(stop));
}

constexpr ControllerKind kOnline{.name = "or",
                                 .purpose = "online re-planning (Alg. 2)",
                                 .parameters = "experiments/grasping.yaml",
                                 .fits = grasps_in_the_plane,
                                 .run = grasp<ControlOptions::Method::kOnline>};
constexpr ControllerKind kNaive{.name = "nr",
                                .purpose = "naive re-planning (Alg. 3)",
                                .parameters = "experiments/grasping.yaml",
                                .fits = grasps_in_the_plane,
                                .run = grasp<ControlOptions::Method::kNaive>};
constexpr ControllerKind kMpc{.name = "mpc",
                              .purpose = "model-predictive control of pushing (Sec. 6.2, 7.3)",
                              .parameters = "experiments/pushing.yaml",
                              .fits = pushes_in_the_plane,
                              .run = push};

std::vector<const ControllerKind*>& catalogue() {
  static std::vector<const ControllerKind*> kinds{&kOnline, &kNaive, &kMpc};
  return kinds;
}

}  // namespace

std::span<const ControllerKind* const> controllers() { return catalogue(); }

std::vector<std::string> controller_names() {
  std::vector<std::string> names;
  for (const ControllerKind* kind : catalogue()) names.emplace_back(kind->name);
  return names;
}

std::string controller_help() {
  std::string text;
  for (const ControllerKind* kind : catalogue()) {
    text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", kind->name, kind->purpose);
  }
  return text;
}

void add_controller(const ControllerKind& kind) { catalogue().push_back(&kind); }

Result<const ControllerKind*> find_controller(std::string_view name, const Scene& scene) {
  std::vector<const char*> fitting;
  for (const ControllerKind* kind : catalogue()) {
    if (!kind->fits(scene)) continue;
    if (name.empty() || kind->name == name) return kind;
    fitting.push_back(kind->name);
  }
  const std::string wanted =
      fitting.empty()
          ? fmt::format("another task or robot: no controller can do it with the robot '{}'", scene.robot.model.name)
          : fmt::format("{}", fmt::join(fitting, ", "));
  return invalid("controller", name.empty() ? "none" : fmt::format("'{}' for a task to {}", name, scene.task.kind),
                 wanted);
}

}  // namespace jostle::planners
