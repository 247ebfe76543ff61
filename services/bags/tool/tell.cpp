#include <fmt/format.h>

#include <cstdio>

#include "services/bags/tool/commands.hpp"
#include "services/common/process/program.hpp"

namespace jostle::bags {

void tell(const std::string& text) { fmt::print(stderr, "jostle bag: {}\n", text); }

int fail(const Error& error, int otherwise) {
  tell(error.message);
  if (error.code == Code::kCancelled) return common::kExitInterrupted;
  return error.code == Code::kNotFound ? common::kExitUsage : otherwise;
}

}  // namespace jostle::bags
