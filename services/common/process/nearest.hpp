#pragma once
/// \file
/// What somebody meant who misspelt it.

#include <string>
#include <vector>

namespace jostle::common {

/// Finds the word that takes the fewest edits to reach; "" when none is near.
std::string nearest(const std::vector<std::string>& words, const std::string& word);

}  // namespace jostle::common
