#pragma once
/// \file
/// The system's own topics as a table, for who is interested in all: recorders, tools.

#include <string>
#include <vector>

#include "services/wire/dds/raw.hpp"

namespace jostle::wire {

struct SystemTopic : RawTopic {
  bool keyed = false;
  Scope scope = Scope::kRobot;
};

/// Those of topics.hpp, in its order, named as without a namespace; topics of single workers are not among them.
const std::vector<SystemTopic>& system_topics();

}  // namespace jostle::wire
