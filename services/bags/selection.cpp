#include "services/bags/selection.hpp"

#include <fnmatch.h>

#include <algorithm>

namespace jostle::bags {

bool Selection::wants(const std::string& topic) const {
  const auto fits = [&](const std::string& glob) { return fnmatch(glob.c_str(), topic.c_str(), 0) == 0; };
  return (topics.empty() || std::ranges::any_of(topics, fits)) && std::ranges::none_of(excluded, fits);
}

}  // namespace jostle::bags
