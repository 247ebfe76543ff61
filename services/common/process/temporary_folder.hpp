#pragma once
/// \file
/// Folders for as long as a process works.

#include <filesystem>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::common {

/// Makes a folder that only this user can read, for its caller to remove; `purpose` becomes part of its name,
/// jostle-PURPOSE-XXXXXX in TMPDIR. It is locked for as long as this process lives; folders of this user and purpose
/// whose owner is gone without removing them (a killed run) are removed first.
/// Error kIo naming TMPDIR, or the folder.
Result<std::filesystem::path> make_temporary_folder(const std::string& purpose);

}  // namespace jostle::common
