#pragma once
/// \file
/// A topic: name, type and promise in one value.

#include <string>

#include "services/dds/names.hpp"
#include "services/dds/qos.hpp"
#include "services/dds/types.hpp"

namespace jostle::dds {

template <class T>
struct Topic {
  std::string name;  ///< as on the wire without a namespace: "rt/" before the name that ROS 2 shows
  Qos qos;
  Scope scope = Scope::kRobot;
};

}  // namespace jostle::dds
