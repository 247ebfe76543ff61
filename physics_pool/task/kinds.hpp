#pragma once
/// \file
/// The rows of the table of tasks. One more is a file beside these, a line here and one in kinds.cpp.

#include "physics_pool/scene/task_kind.hpp"

namespace jostle::physics_pool {

extern const TaskKind kGrasp;
extern const TaskKind kPush;
extern const TaskKind kReach;

}  // namespace jostle::physics_pool
