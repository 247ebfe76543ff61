#pragma once
/// \file
/// Selection: topics by glob.

#include <string>
#include <vector>

namespace jostle::bags {

/// Selects topics by globs of ROS names, as a shell's (fnmatch(3)); `*` goes past slashes: "/robot/*", "*pose*".
struct Selection {
  std::vector<std::string> topics;  ///< empty: all
  std::vector<std::string> excluded;

  bool wants(const std::string& topic) const;
};

}  // namespace jostle::bags
