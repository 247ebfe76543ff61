#include "planners/controllers/catalogue.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "idl/text/nearest.hpp"
#include "physics_pool/task/kinds.hpp"

namespace jostle::planners {
namespace {

using physics_pool::Scene;

// The hand that OR and NR steer moves in the plane and turns.
bool grasps_in_the_plane(const Scene& scene) {
  const auto planar = as_planar(scene.robot.model);
  return scene.task.kind == physics_pool::kGrasp.name && planar && planar->rotation >= 0;
}

// A hand that moves in the plane and turns, or one that an arm holds.
bool reaches(const Scene& scene) {
  if (as_planar(scene.robot.model)) return grasps_in_the_plane(scene);
  return scene.task.kind == physics_pool::kGrasp.name && scene.robot.model.hand;
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
std::unique_ptr<Planner> adaptive_planner(physics_pool::Pool& pool, const Scene&,
                                          const physics_pool::TaskGeometry& geometry, const PbstoOptions& optimizer,
                                          const ControllerOptions& options, OnProgress on_progress) {
  return std::make_unique<AdaptivePlanner>(pool, geometry, optimizer, method(options.adaptive), std::move(on_progress));
}

template <AdaptiveOptions (*method)(AdaptiveOptions)>
constexpr ControllerKind adaptive_kind(const char* name, const char* purpose) {
  return {.name = name,
          .purpose = purpose,
          .parameters = "experiments/adaptive.yaml",
          .fits = adapts_in_the_plane,
          .run = adapt<method>,
          .planner = adaptive_planner<method>};
}

// `method` makes one of the five methods of Sec. 4.5 of the same options.
template <RobustControlOptions (*method)(RobustControlOptions)>
Result<Outcome> robust(const ControlSetup& setup, const ControllerOptions& options, const OnEvent& on_event,
                       std::stop_token stop) {
  return run_robust(setup, method(options.robust), on_event, std::move(stop));
}

template <RobustControlOptions (*method)(RobustControlOptions)>
std::unique_ptr<Planner> robust_planner(physics_pool::Pool& pool, const Scene& scene,
                                        const physics_pool::TaskGeometry& geometry, const PbstoOptions& optimizer,
                                        const ControllerOptions& options, OnProgress on_progress) {
  return std::make_unique<RobustSto>(pool, scene, geometry, optimizer, method(options.robust).planner,
                                     std::move(on_progress));
}

template <RobustControlOptions (*method)(RobustControlOptions)>
constexpr ControllerKind robust_kind(const char* name, const char* purpose) {
  return {.name = name,
          .purpose = purpose,
          .parameters = "experiments/robust.yaml",
          .arm_parameters = "experiments/robust-arm.yaml",
          .fits = reaches,
          .run = robust<method>,
          .planner = robust_planner<method>,
          .improves_initial = true};
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
constexpr ControllerKind kTampc = adaptive_kind<as_it_is>("tampc", "task-adaptive control, fast or slow (Alg. 6)");
constexpr ControllerKind kUampc = adaptive_kind<slow_only>("uampc", "the same with slow actions only (Sec. 5.5)");
constexpr ControllerKind kSlowMpc =
    adaptive_kind<standard_mpc>("slow-mpc", "one slow plan without a thought of noise (MPC of Sec. 5.5)");

constexpr ControllerKind kOpenLoop = robust_kind<open_loop>("ol", "a whole plan without looking (OL of Sec. 4.5)");
constexpr ControllerKind kRobustOpenLoop =
    robust_kind<robust_open_loop>("rol", "the same with a plan that is robust in several worlds (ROL)");
constexpr ControllerKind kConvergent =
    robust_kind<convergent>("cp", "the same with a plan that is robust in the planning world (CP)");
constexpr ControllerKind kClosedLoop = robust_kind<closed_loop>("cc", "a new plan after every action (CC)");
constexpr ControllerKind kInterleaved =
    robust_kind<interleaved>("ocl", "robust parts open-loop, others closed-loop (Alg. 4)");

std::vector<const ControllerKind*>& catalogue() {
  static std::vector<const ControllerKind*> kinds{
      &kOnline,         &kNaive,      &kMpc,   &kInterleaved, &kClosedLoop, &kOpenLoop,
      &kRobustOpenLoop, &kConvergent, &kTampc, &kUampc,       &kSlowMpc};
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

std::unique_ptr<Planner> make_planner(const ControllerKind& kind, physics_pool::Pool& pool, const Scene& scene,
                                      const physics_pool::TaskGeometry& geometry, const PbstoOptions& optimizer,
                                      const ControllerOptions& options, OnProgress on_progress) {
  if (kind.planner) return kind.planner(pool, scene, geometry, optimizer, options, std::move(on_progress));
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
          : fmt::format("{}{}", fmt::join(fitting, ", "), did_you_mean(name, fitting));
  return invalid("controller",
                 name.empty() ? "none"
                              : fmt::format("'{}' for a task to {} with the robot '{}'", name, scene.task.kind,
                                            scene.robot.model.name),
                 wanted);
}

}  // namespace jostle::planners
