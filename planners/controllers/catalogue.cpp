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

bool adapts_in_the_plane(const Scene& scene) { return pushes_in_the_plane(scene) || grasps_in_the_plane(scene); }

AdaptiveOptions as_it_is(AdaptiveOptions options) { return options; }

// `method` makes one of the three methods of Sec. 5.6 of the same options.
template <AdaptiveOptions (*method)(AdaptiveOptions)>
Result<Outcome> adapt(const ControlSetup& setup, const ControllerOptions& options, const OnEvent& on_event,
                      std::stop_token stop) {
  return run_adaptive(setup, method(options.adaptive), on_event, std::move(stop));
}

template <AdaptiveOptions (*method)(AdaptiveOptions)>
std::unique_ptr<Planner> adaptive_planner(physics_pool::Pool& pool, const physics_pool::TaskGeometry& geometry,
                                          const PbstoOptions& optimizer, const ControllerOptions& options,
                                          OnProgress on_progress) {
  return std::make_unique<AdaptivePlanner>(pool, geometry, optimizer, method(options.adaptive), std::move(on_progress));
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
constexpr ControllerKind kTampc{.name = "tampc",
                                .purpose = "task-adaptive control, fast or slow (Alg. 6)",
                                .parameters = "experiments/adaptive.yaml",
                                .fits = adapts_in_the_plane,
                                .run = adapt<as_it_is>,
                                .planner = adaptive_planner<as_it_is>};
constexpr ControllerKind kUampc{.name = "uampc",
                                .purpose = "the same with slow actions only (Sec. 5.5)",
                                .parameters = "experiments/adaptive.yaml",
                                .fits = adapts_in_the_plane,
                                .run = adapt<slow_only>,
                                .planner = adaptive_planner<slow_only>};
constexpr ControllerKind kSlowMpc{.name = "slow-mpc",
                                  .purpose = "one slow plan without a thought of noise (MPC of Sec. 5.5)",
                                  .parameters = "experiments/adaptive.yaml",
                                  .fits = adapts_in_the_plane,
                                  .run = adapt<standard_mpc>,
                                  .planner = adaptive_planner<standard_mpc>};

std::vector<const ControllerKind*>& catalogue() {
  static std::vector<const ControllerKind*> kinds{&kOnline, &kNaive, &kMpc, &kTampc, &kUampc, &kSlowMpc};
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

std::unique_ptr<Planner> make_planner(const ControllerKind& kind, physics_pool::Pool& pool,
                                      const physics_pool::TaskGeometry& geometry, const PbstoOptions& optimizer,
                                      const ControllerOptions& options, OnProgress on_progress) {
  if (kind.planner) return kind.planner(pool, geometry, optimizer, options, std::move(on_progress));
  return std::make_unique<Pbsto>(pool, optimizer, std::move(on_progress));
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
