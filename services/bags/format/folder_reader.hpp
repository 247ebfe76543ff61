#pragma once
/// \file
/// BagReader with what checking and recovering need beyond reading.

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "services/bags/format/bag_reader.hpp"

namespace jostle::bags {

class CheckedReader : public BagReader {
 public:
  /// Checks what reading does not look at: checksums and indices of the files, and
  /// whether they hold what they say they hold. `go_on` is asked before each file.
  /// Errors   as next(); kCancelled
  virtual Result<void> verify(const std::function<bool(const std::filesystem::path&)>& go_on) = 0;

  /// Returns the damage that was stepped over, so far. Empty unless the bag was opened to recover it.
  virtual std::vector<std::string> damage() const = 0;
};

/// Opens a bag as BagReader::open does. `recover`: takes what is readable of damaged files; fails only if
/// nothing is.
Result<std::unique_ptr<CheckedReader>> open_bag(const std::filesystem::path& path, bool recover);

}  // namespace jostle::bags
