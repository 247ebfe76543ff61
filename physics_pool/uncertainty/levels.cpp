#include "physics_pool/uncertainty/levels.hpp"

#include <fmt/format.h>

#include <array>
#include <ranges>
#include <utility>

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
  return Error{Code::kInvalidArgument, fmt::format("uncertainty: got '{}', wanted none, low, medium or high{}", word,
                                                   did_you_mean(word, std::views::keys(kLevels)))};
}

const char* to_string(Uncertainty level) { return kLevels[static_cast<std::size_t>(level)].first; }

double velocity_noise(Uncertainty level) { return 0.003 * static_cast<int>(level); }

}  // namespace jostle::physics_pool
