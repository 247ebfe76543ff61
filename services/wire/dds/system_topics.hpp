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

/// Returns the topics of topics.hpp and display_topics.hpp, in their order, by their names without a namespace. Topics
/// of single workers are not among them.
const std::vector<SystemTopic>& system_topics();

}  // namespace jostle::wire
