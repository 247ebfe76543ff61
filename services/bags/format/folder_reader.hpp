#pragma once
/// \file
/// BagReader with what checking and recovering need beyond reading.

#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "services/bags/format/bag_reader.hpp"

namespace jostle::bags {

class CheckedReader : public BagReader {
 public:
  /// Checks what reading does not look at: checksums and indices of the files, and
  /// whether they hold what they say they hold. `go_on` is asked before each file.
  /// Errors   as next(); kCancelled
  /// Returns what differs, and what findings() have of the folder.
  virtual Result<std::vector<Finding>> verify(const std::function<bool(const std::filesystem::path&)>& go_on) = 0;

  /// `index`: into BagInfo::attachments. Error as next().
  virtual Result<Attachment> attachment(std::size_t index) const = 0;

  /// Messages that stand in two files and are given out once.
  virtual std::uint64_t repeated() const = 0;
};

/// Opens a bag as BagReader::open does. `recover`: takes what is readable of damaged files, and of a folder every
/// file, whatever its metadata.yaml says; fails only if nothing is readable. A look at a whole file ends with
/// kCancelled once `stop` is requested.
Result<std::unique_ptr<CheckedReader>> open_bag(const std::filesystem::path& path, bool recover,
                                                std::stop_token stop = {});

}  // namespace jostle::bags
