#include "physics_pool/task/kinds.hpp"

#include <algorithm>
#include <array>

namespace jostle::physics_pool {
namespace {

constexpr std::array kKinds{&kGrasp, &kPush, &kReach};

}  // namespace

std::span<const TaskKind* const> task_kinds() { return kKinds; }

const TaskKind* find_task_kind(std::string_view name) {
  const auto found = std::ranges::find_if(kKinds, [&](const TaskKind* kind) { return kind->name == name; });
  return found == kKinds.end() ? nullptr : *found;
}

}  // namespace jostle::physics_pool
