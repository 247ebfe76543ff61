#pragma once
/// \file
/// A plan that is made while the robot acts.

#include <cstdint>
#include <functional>
#include <latch>
#include <optional>
#include <stop_token>
#include <thread>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "planners/api/planner.hpp"

namespace jostle::planners {

/// PlanAhead makes one plan on a thread of its own, in three steps:
///
///   x_1     what the action at work is predicted to come to
///   problem what is to be planned from there, if anything
///   plan    its solution, from the first rollout to the last: no clock ends it, so it depends on the problem alone
///
/// Threads  its steps run on its own, one after the other; all else is called from one other thread.
/// Repeats  whoever takes the plan takes what the same steps would have made at any other time.
class PlanAhead {
 public:
  struct Steps {
    std::function<Result<State>(std::stop_token)> predict;
    std::function<Result<std::optional<Problem>>(const State& predicted)> ask;
    std::function<Result<Plan>(const Problem&, std::stop_token)> plan;
  };

  /// Begins. `stop`, and destroying it, give up what is under way.
  PlanAhead(Steps steps, const std::stop_token& stop);
  ~PlanAhead();

  PlanAhead(const PlanAhead&) = delete;
  PlanAhead& operator=(const PlanAhead&) = delete;

  /// Waits until it is known what is to be planned. Neither `predict` nor `ask` is called after that.
  void wait_until_asked() const { asked_.wait(); }

  // From then on:
  const std::optional<State>& predicted() const { return predicted_; }  ///< nothing: prediction failed
  const std::optional<Problem>& problem() const { return problem_; }    ///< nothing: there is nothing to be planned

  /// Waits for the plan of problem(), and returns it. Errors   those of Planner::plan
  Result<Plan> take();

  /// Ends what is under way, and waits until it has ended.
  void give_up();

  /// Rollouts that were asked for, for the plan only; known after take() or give_up().
  std::uint64_t rollouts() const { return rollouts_; }

 private:
  void work(const Steps& steps, const std::stop_token& stop);

  std::stop_source stop_;
  const std::stop_callback<std::function<void()>> forward_;
  std::latch asked_{1};
  std::optional<State> predicted_;
  std::optional<Problem> problem_;
  std::uint64_t rollouts_ = 0;
  Result<Plan> plan_;
  std::thread thread_;  // last: it uses all the others
};

}  // namespace jostle::planners
