#pragma once
/// \file
/// Composition: the one place where a run is put together, from values. The coordinator, studies, replay and tests
/// use it; nothing here knows a wire.

#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "physics_pool/api/pool.hpp"
#include "physics_pool/local/world.hpp"
#include "planners/controllers/catalogue.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::task {

/// What a run is made of.
struct RunParts {
  physics_pool::Scene belief;  ///< the planning world
  /// The belief is the world itself: observed states are possible ones, and must not be moved apart, so that the
  /// plan for a perfectly known world starts from that very world.
  bool belief_is_exact = false;
  Parameters parameters;
  std::string controller;  ///< a name of the catalogue; empty: the first that fits the belief
  std::uint64_t seed = 0;
  bool plan_only = false;  ///< stop after the first plan
};

/// A run that is ready to begin, on any robot and with any pool.
///
/// Threads  one.
/// Repeats  equal parts and equal observations make bit-equal decisions on any pool.
class Composition {
 public:
  /// Makes the planning world known to the pool, which outlives this.
  /// Errors   kInvalidArgument  the controller, or parameters that do not fit the robot; names the field
  ///          those of Pool::load
  static Result<Composition> make(RunParts parts, physics_pool::Pool& pool);

  /// Who hears of a run, and who stands around its planner.
  struct Watch {
    planners::OnEvent on_event;
    planners::OnProgress on_progress;  ///< called on the thread that plans: the run's, or one beside it
    /// What stands between the controller and the planner, such as a stopwatch; empty: nothing.
    std::function<std::unique_ptr<planners::Planner>(planners::Planner&)> around_planner;
    /// See ControlSetup.
    std::function<void(const planners::Problem&, const planners::Plan&, const planners::PlanOrigin&)> on_plan;
  };

  /// Errors   those of the controllers
  Result<planners::Outcome> perform(robot_bridge::Robot& robot, perception::ObjectSource& objects, const Watch& watch,
                                    std::stop_token stop);

  const planners::ControllerKind& controller() const { return *controller_; }
  const physics_pool::TaskGeometry& geometry() const { return believed_->geometry(); }  ///< that of the belief
  Parameters& parameters() { return parts_.parameters; }
  const Parameters& parameters() const { return parts_.parameters; }

 private:
  Composition() = default;

  // The controller's own planner, begun by one that coarse physics guides if it improves what it begins with; or Alg.
  // 1; or the guided one. A belief that coarse physics cannot show is planned for without guidance, and the log says
  // why.
  std::unique_ptr<planners::Planner> make_planner(const planners::OnProgress& on_progress) const;
  std::unique_ptr<planners::Planner> make_arm_planner(const planners::OnProgress& on_progress) const;
  Result<State> moved_apart(const State& x) const;
  Result<State> predict(const planners::ActionAhead& action, planners::TimePoint deadline, std::stop_token stop) const;

  RunParts parts_;
  const planners::ControllerKind* controller_ = nullptr;
  physics_pool::Pool* pool_ = nullptr;
  physics_pool::WorldPtr believed_;  // the planning world, in which observations are moved apart
  Hash world_;                       // its name in the pool
};

}  // namespace jostle::task
