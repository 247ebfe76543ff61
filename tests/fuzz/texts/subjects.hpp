#pragma once
/// \file
/// What reads the texts.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/fuzz/texts/mutation.hpp"

namespace jostle::tests {

/// A kind of text.
struct Subject {
  std::string name;
  Grammar grammar;
  std::vector<std::string> originals;
  /// Reads one, and uses what it holds if it is taken. Returns whether it was. Throws std::runtime_error where a
  /// promise is broken: a text that is taken and does not survive being written and read, a refusal without words.
  std::function<bool(const std::string& text)> read;
};

/// Makes all five: scenes, parameters, networks, profiles, keystores. `folder`: for files, the keystore among them.
std::vector<Subject> make_subjects(const std::filesystem::path& folder);

}  // namespace jostle::tests
