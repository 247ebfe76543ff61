#pragma once
/// \file
/// The system's own topics as a table, for who is interested in all: recorders, tools.

#include <string>
#include <vector>

#include "services/dds/raw.hpp"

namespace jostle::dds {

struct SystemTopic : RawTopic {
  bool keyed = false;
};

/// Those of topics.hpp, in its order; topics of single workers are not among them.
const std::vector<SystemTopic>& system_topics();

}  // namespace jostle::dds
