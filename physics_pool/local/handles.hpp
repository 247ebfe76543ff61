#pragma once
/// \file
/// Owning pointers to the engine's objects, without the engine's headers. The headers of this folder that
/// other rooms include use these pointers, so that only sources see MuJoCo.

#include <memory>

struct mjModel_;
struct mjData_;

namespace jostle::physics_pool {

struct ModelDeleter {
  void operator()(mjModel_* model) const;
};
struct DataDeleter {
  void operator()(mjData_* data) const;
};
using ModelPtr = std::unique_ptr<mjModel_, ModelDeleter>;
using DataPtr = std::unique_ptr<mjData_, DataDeleter>;

/// Returns the version of the MuJoCo library that is loaded, such as "2.2.2".
const char* engine_version();

}  // namespace jostle::physics_pool
