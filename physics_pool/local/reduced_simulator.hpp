#pragma once
/// \file
/// F with less physics: objects that nobody touches are frozen, steps may be long.

#include <memory>
#include <vector>

#include "physics_pool/api/rollout.hpp"
#include "physics_pool/local/dynamics.hpp"

namespace jostle::physics_pool {

/// Steps a world whose resting objects have no freedom, as `Fidelity` says.
///
/// At the start of a control step every object that stands still is frozen: a
/// body without degrees of freedom that meets the robot and free objects, and
/// nothing else. Before each engine step's forces are calculated its contacts are
/// looked through; a frozen object among them is set free, the state moves to a
/// model that has one freedom more, and the step begins anew. So nothing is ever
/// pushed against something that ought to have yielded.
///
/// What differs from the fine model: frozen objects do not creep, settle, or push
/// each other apart where they overlap, and the solver's warm start is reset when
/// an object is freed. With all objects free, and the world's own time step, it is
/// the fine model bit for bit.
///
/// Models are made per number of free objects, not per set of them: which objects
/// they are is a matter of sizes, masses and frictions, written into this thread's
/// copy of the model.
///
/// Threads  one at a time. Allocates when it has no model for the present number of free
///          objects: the first time, and again if that model was dropped, as there were many.
class ReducedSimulator final : public Dynamics {
 public:
  ReducedSimulator(WorldPtr world, const Fidelity& fidelity);
  ~ReducedSimulator() override;

  const World& world() const override { return *world_; }
  double time_step() const override { return time_step_; }

  Advance advance(State& x, std::span<const double> u, int engine_steps, const std::function<bool()>& interrupted = {},
                  const Disturbance& disturbance = {}) override;
  std::size_t bytes() const override;

 private:
  struct Part;

  void freeze(const State& x);
  Part& enter(const State& x, std::span<const double> u);
  void drop_remotest(int count);
  int thaw_touched(const Part& part);
  void run(Advance& result, State& x, std::span<const double> u, int engine_steps,
           const std::function<bool()>& interrupted);

  WorldPtr world_;
  Fidelity fidelity_;
  double time_step_;
  std::vector<bool> free_;                    // by object
  std::vector<std::unique_ptr<Part>> parts_;  // by number of free objects
};

/// Whether an object stands on the surface and moves so little that without its
/// freedom it would be in the same place.
bool stands_still(const TaskGeometry& geometry, const State& x, std::size_t object);

}  // namespace jostle::physics_pool
