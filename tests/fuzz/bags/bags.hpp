#pragma once
/// \file
/// Bags to be mutated, and what is done to them.

#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

namespace jostle::fuzz {

/// A bag's files by name; one alone is a bag that is opened by its file.
using Files = std::vector<std::pair<std::string, std::string>>;

/// Random numbers that are the same everywhere for one seed, which the distributions of the library are not.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  /// 0 to below - 1; 0 for nothing.
  std::size_t operator()(std::size_t below) { return below == 0 ? 0 : static_cast<std::size_t>(engine_() % below); }
  bool one_in(std::size_t count) { return (*this)(count) == 0; }
  std::uint64_t any() { return engine_(); }

 private:
  std::mt19937_64 engine_;
};

/// Makes the bags that all cases begin with: MCAP of ours and of others, databases, one file and several.
std::vector<Files> seed_bags(const std::filesystem::path& scratch);

/// Changes a bag in a few ways: bytes, lengths, records, chunks (whose checksums are made right again), summaries,
/// rows, pages, metadata.yaml, files. Says what was done.
std::string mutate(Files& bag, Dice& dice, const std::filesystem::path& scratch);

}  // namespace jostle::fuzz
