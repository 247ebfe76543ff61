#pragma once
/// \file
/// The table of parameters: reading, checking, setting, listing and comparing them are loops over it.

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "services/task/config/parameters.hpp"

namespace jostle::task {

/// The value of one parameter. Its alternative says what the parameter is, so setting it takes the same one.
using ParameterValue = std::variant<bool, std::int64_t, double, std::vector<double>, std::string>;

/// One key of parameter files.
struct ParameterKey {
  std::string section;             ///< "planner"; empty: at the top
  std::string name;                ///< "rollouts"
  std::string unit;                ///< empty: none, or a count
  double least, most;              ///< closed range of a number, or of each of a list
  std::string meaning;             ///< one sentence, with its source
  std::vector<std::string> words;  ///< of a text: what it may be
  std::string also;                ///< an earlier name, under which files may still have it; empty: none
  std::function<ParameterValue(const Parameters&)> get;
  std::function<void(Parameters&, const ParameterValue&)> set;

  std::string path() const { return section.empty() ? name : section + "." + name; }
  /// Returns the range or the words, such as "1 to 1000000", "at least 0", "greedy or cost-weighted".
  std::string wanted() const;
};

/// Returns every key: the sections in the order of a file, and in `objective` what the catalogue of terms has now.
std::vector<ParameterKey> parameter_keys();

/// Returns a value as YAML files spell it; numbers read back bit-equal.
std::string to_text(const ParameterValue& value);

/// Where two sets of parameters differ.
struct ParameterDifference {
  std::string key;  ///< its path
  ParameterValue before, after;
};
std::vector<ParameterDifference> differences(const Parameters& before, const Parameters& after);

}  // namespace jostle::task
