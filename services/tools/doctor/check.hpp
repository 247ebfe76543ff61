#pragma once
/// \file
/// What one look at the machine found.

#include <string>

namespace jostle::tools {

enum class Verdict {
  kOk,
  kWarn,  ///< works, yet slower or in fewer places than it could
  kFail,  ///< Jostle cannot work like this
};

/// Returns "ok", "warn" or "FAIL".
inline const char* word(Verdict verdict) {
  switch (verdict) {
    case Verdict::kOk:
      return "ok";
    case Verdict::kWarn:
      return "warn";
    case Verdict::kFail:
      break;
  }
  return "FAIL";
}

struct Check {
  std::string name;  ///< what was looked at
  Verdict verdict = Verdict::kOk;
  std::string finding;  ///< what was found, with numbers
  std::string remedy;   ///< what to do; empty if ok
};

}  // namespace jostle::tools
