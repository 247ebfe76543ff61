#pragma once
/// \file
/// What feedback calls the phases of a run.

#include "planners/execution/execution.hpp"

namespace jostle::task {

/// Returns Feedback.phase for a phase: one word. After that of kDone a result follows.
constexpr const char* word(planners::Phase phase) {
  switch (phase) {
    case planners::Phase::kPlanning:
      return "planning";
    case planners::Phase::kActing:
      return "acting";
    case planners::Phase::kClosing:
      return "closing";
    case planners::Phase::kDone:
      return "done";
  }
  return "";
}

}  // namespace jostle::task
