#pragma once
/// \file
/// An index made of all records of an MCAP file, for want of a summary that says all, or to check one.

#include <cstdint>
#include <stop_token>

#include "idl/types/result.hpp"
#include "services/bags/format/input_file.hpp"
#include "services/bags/format/mcap_index.hpp"

namespace jostle::bags::mcap {

enum class ScanMode {
  kRead,     ///< up to the first damage, which is the error
  kRecover,  ///< steps over damage: FileInfo::findings say what, there is no error
  kVerify,   ///< as kRead, with a look at what reading does not need
};

/// Finds blocks, notes and attachments anew; definitions are added to those that `index` has from its summary. Notes
/// among FileInfo::findings whatever cannot be taken. `end`: where the footer is, or where a file without one ends.
/// `census`: takes what was met.
/// Error kCancelled once `stop` is requested, whatever the mode.
Result<void> scan(const InputFile& file, std::uint64_t end, ScanMode mode, Index& index, Census& census,
                  const std::stop_token& stop);

}  // namespace jostle::bags::mcap
