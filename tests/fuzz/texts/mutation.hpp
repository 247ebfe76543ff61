#pragma once
/// \file
/// Texts spoilt at random, as disks, editors and people spoil them.

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace jostle::tests {

/// Equal everywhere for equal seeds, as std's distributions are not.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}

  std::size_t below(std::size_t count) { return count == 0 ? 0 : static_cast<std::size_t>(engine_() % count); }
  bool one_in(std::size_t count) { return below(count) == 0; }
  template <class T>
  const T& one_of(const std::vector<T>& choices) {
    return choices[below(choices.size())];
  }

 private:
  std::mt19937_64 engine_;
};

/// How a text is made up, so that spoiling it leaves most of it valid.
enum class Grammar { kBytes, kYaml, kXml };

/// Returns `text` with one to four changes: of bytes, or of values, keys, lines, elements. `others`: texts of the same
/// kind, of which parts may come.
std::string mutated(std::string text, Grammar grammar, const std::vector<std::string>& others, Dice& dice);

}  // namespace jostle::tests
