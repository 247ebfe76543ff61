// A term that a program brings along: this file is all there is to it.

#include "physics_pool/objective/catalogue.hpp"

namespace jostle::physics_pool {
namespace {

const TermKind kToll{.name = "toll",
                     .unit = "1",
                     .weight = 0.0,
                     .meaning = "per step, whatever happens in it",
                     .parameters = {{.name = "price", .unit = "1", .initial = 1.0, .meaning = "of a step"}},
                     .running = [](const Step&, std::span<const double> values) { return values[0]; }};

[[maybe_unused]] const bool kAdded = (add_term_kind(kToll), true);

}  // namespace
}  // namespace jostle::physics_pool
