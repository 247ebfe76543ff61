#pragma once
/// \file
/// Tables of text.

#include <string>
#include <vector>

namespace jostle::common {

/// Writes rows of cells, the first of which are headers. Columns are as wide as their widest cell and stand two blanks
/// apart; lines have no blanks at their ends. Cells may be missing at the end of a row.
std::string table(const std::vector<std::vector<std::string>>& rows);

}  // namespace jostle::common
