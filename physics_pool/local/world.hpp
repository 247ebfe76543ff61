#pragma once
/// \file
/// World: a compiled scene.

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "idl/types/hash.hpp"
#include "idl/types/result.hpp"
#include "physics_pool/local/handles.hpp"
#include "physics_pool/objective/terms.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

class World;
/// A world is shared: every simulating thread reads the same compiled model, and the last
/// one to finish with it frees it.
using WorldPtr = std::shared_ptr<const World>;

/// A World is immutable after compilation; any number of threads may read it.
class World {
 public:
  enum class Purpose { kPhysics, kPictures };

  /// Errors   kInvalidArgument  the engine refused the model; says why.
  static Result<WorldPtr> compile(const Scene& scene, Purpose purpose = Purpose::kPhysics);

  const Scene& scene() const { return scene_; }
  const Hash& hash() const { return hash_; }
  const TaskGeometry& geometry() const { return geometry_; }
  const mjModel_* model() const { return model_.get(); }
  std::size_t bytes() const;  ///< memory of the compiled model, without reduced ones
  double time_step() const { return scene_.physics.time_step; }

  /// Returns the model of the same world in which only the first `free` objects can move (see
  /// ModelContent). Compiled when first asked for, once for all threads.
  /// Threads  safe from any thread. Throws EngineError.
  const mjModel_* reduced_model(int free) const;

 private:
  World(const Scene& scene, ModelPtr model);

  Scene scene_;
  Hash hash_;
  TaskGeometry geometry_;
  ModelPtr model_;
  mutable std::mutex mutex_;               // guards reduced_
  mutable std::vector<ModelPtr> reduced_;  // by number of free objects; empty until asked for
};

}  // namespace jostle::physics_pool
