#pragma once
/// \file
/// What a terminal can do.

namespace jostle::common {

/// Whether a descriptor is a terminal that understands escape codes: any, unless TERM is `dumb`.
bool shows_escape_codes(int descriptor);

}  // namespace jostle::common
