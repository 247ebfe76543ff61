#pragma once
/// \file
/// The catalogue of terms: YAML, wire, checks and documentation are loops over it.

#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "physics_pool/objective/step.hpp"

namespace jostle::physics_pool {

/// A number that a kind of term needs beside its weight. Files spell it KIND_NAME: edge_rate.
struct TermParameter {
  const char* name;
  const char* unit;
  double initial;
  double least = 0.0, most = std::numeric_limits<double>::max();  ///< closed range
  const char* meaning;
};

/// One kind of term. `values` are in the order of `parameters`. Functions are pure, allocate nothing, and return
/// a number >= 0.
struct TermKind {
  const char* name;     ///< as files and the wire spell it; the weight's own key
  const char* unit;     ///< of the weight
  double weight;        ///< default
  const char* meaning;  ///< one sentence with its source
  std::vector<TermParameter> parameters;
  double (*running)(const Step& step, std::span<const double> values) = nullptr;  ///< per control step; may be null
  double (*final)(const TaskGeometry& geometry, const State& x, std::span<const double> values) = nullptr;
  /// Its values are the positions of a state, [nq], and no parameters. Without any there is no such state, and the term
  /// costs nothing.
  bool takes_state = false;
};

/// Returns all kinds, in the order in which costs are summed.
std::span<const TermKind* const> term_catalogue();

/// Finds a kind by its name; null if there is none.
const TermKind* find_term_kind(std::string_view name);

/// Adds a kind at the end, for programs that bring terms of their own. Call it from one thread, before any objective
/// or pool is made. `kind` outlives the program's objectives.
void add_term_kind(const TermKind& kind);

}  // namespace jostle::physics_pool
