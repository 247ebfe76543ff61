#pragma once
/// \file
/// What a rollout is scored by: a list of weighted terms, as data. It is evaluated where the simulation runs, so that
/// costs travel and states need not.

#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::physics_pool {

/// One weighted term. catalogue.hpp has the kinds, what each measures and what its parameters mean.
struct Term {
  std::string kind;
  double weight = 0.0;         ///< >= 0, so a running sum of costs never falls: that makes stopping losers early exact
  std::vector<double> values;  ///< parameters in the order of the kind's row, or a state's positions if it takes one

  bool operator==(const Term&) const = default;
};

/// An Objective is J = sum of weight·term over all terms and steps. Equal terms in another order are the same
/// objective: they are summed in the catalogue's order, which is part of every cost's last bit.
struct Objective {
  std::vector<Term> terms;
  /// C_thresh of Alg. 1: a rollout succeeds when the goal is reached (`at_goal`) and the cost so far, goal cost
  /// included, is at most this.
  double success_cost = 1000.0;

  /// Returns every kind of the catalogue at its default weight and parameters: those of Sec. 3.3.1 where the thesis
  /// gives one; docs/chapter3.md says how the others were chosen, and experiments/pushing.yaml has those of pushing.
  static Objective standard();

  /// Returns the term of a kind; adds it with its defaults and weight 0 if it is not there. The kind must be in the
  /// catalogue.
  Term& operator[](std::string_view kind);
  const Term* find(std::string_view kind) const;

  double weight(std::string_view kind) const;  ///< 0 where there is no such term
  /// Returns a parameter; the kind's default where there is no such term. Both names must be in the catalogue.
  double value(std::string_view kind, std::string_view parameter) const;
  double& value(std::string_view kind, std::string_view parameter);

  bool operator==(const Objective&) const = default;
};

/// Checks that kinds are known and given once, with as many values as parameters, and everything in its range.
/// Error kInvalidArgument: "objective.edge_rate: got …, wanted …".
Result<void> validate(const Objective& objective);

}  // namespace jostle::physics_pool
