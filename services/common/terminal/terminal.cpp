#include "services/common/terminal/terminal.hpp"

#include <unistd.h>

#include <cstdlib>
#include <string_view>

namespace jostle::common {

bool shows_escape_codes(int descriptor) {
  const char* terminal = std::getenv("TERM");
  return isatty(descriptor) == 1 && !(terminal && std::string_view(terminal) == "dumb");
}

}  // namespace jostle::common
