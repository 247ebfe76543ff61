#include "services/common/process/exit_codes.hpp"

#include <fmt/format.h>

namespace jostle::common {

ExitCode exit_code_of(const Error& error) {
  switch (error.code) {
    case Code::kInvalidArgument:
    case Code::kNotFound:
    case Code::kUnknownWorld:
      return kExitUsage;
    case Code::kDeadline:
      return kExitFailed;
    case Code::kCancelled:
      return kExitInterrupted;
    case Code::kUnavailable:
    case Code::kIo:
    case Code::kInternal:
      break;
  }
  return kExitBroken;
}

std::vector<ExitCodeMeaning> exit_codes(const std::string& done, const std::string& failed) {
  return {{kExitOk, done},
          {kExitFailed, failed},
          {kExitUsage, "bad input or usage"},
          {kExitBroken, "a part of the system failed, or an output cannot be written"},
          {kExitInterrupted, "interrupted"}};
}

std::string exit_codes_help(const std::string& done, const std::string& failed) {
  std::string text;
  for (const auto& [code, meaning] : exit_codes(done, failed))
    text += fmt::format("{}{} {}", text.empty() ? "Exit codes: " : ", ", static_cast<int>(code), meaning);
  return text + ".";
}

}  // namespace jostle::common
