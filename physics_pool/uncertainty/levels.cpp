#include "physics_pool/uncertainty/levels.hpp"

#include <fmt/format.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "idl/text/nearest.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::array<std::pair<const char*, Uncertainty>, 4> kLevels{{{"none", Uncertainty::kNone},
                                                                      {"low", Uncertainty::kLow},
                                                                      {"medium", Uncertainty::kMedium},
                                                                      {"high", Uncertainty::kHigh}}};

}  // namespace

Result<Uncertainty> parse_uncertainty(std::string_view word) {
  for (const auto& [name, level] : kLevels) {
    if (word == name) return level;
  }
  std::vector<std::string> known;
  for (const auto& [name, level] : kLevels) known.emplace_back(name);
  return Error{Code::kInvalidArgument, fmt::format("uncertainty: got '{}', wanted none, low, medium or high{}", word,
                                                   did_you_mean(word, known))};
}

const char* to_string(Uncertainty level) { return kLevels[static_cast<std::size_t>(level)].first; }

double velocity_noise(Uncertainty level) { return 0.003 * static_cast<int>(level); }

}  // namespace jostle::physics_pool
