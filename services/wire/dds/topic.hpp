#pragma once
/// \file
/// A topic: name, type and promise in one value.

#include <string>

#include "idl/types/qos.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/types.hpp"

namespace jostle::wire {

template <class T>
struct Topic {
  std::string name;  ///< as on the wire without a namespace: "rt/" before the name that ROS 2 shows
  Qos qos;
  Scope scope = Scope::kRobot;
};

}  // namespace jostle::wire
