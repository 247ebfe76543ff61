#include "physics_pool/local/engine.hpp"

#include <cmath>
#include <mutex>

namespace jostle::physics_pool {
namespace {

void throw_error(const char* message) { throw EngineError(message); }

// Warnings are counted in mjData::warning, which every rollout reads.
void ignore_warning(const char*) {}

bool is_surface(const mjModel* model, int geom) {
  return model->nuser_geom > 0 && model->geom_user[geom * model->nuser_geom] == kSurfaceMark;
}

bool is_beyond_edge(const mjModel* model, const mjData* data, int surface, int geom) {
  const mjtNum* half = model->geom_size + 3 * surface;
  const mjtNum* centre = data->xpos + 3 * model->geom_bodyid[geom];
  return std::abs(centre[0]) > half[0] || std::abs(centre[1]) > half[1];
}

// Returns nonzero to discard a pair. Replaces the engine's own mask test.
int filter_contact(const mjModel* model, mjData* data, int a, int b) {
  const bool paired = (model->geom_contype[a] & model->geom_conaffinity[b]) != 0 ||
                      (model->geom_contype[b] & model->geom_conaffinity[a]) != 0;
  if (!paired) return 1;
  if (is_surface(model, a)) return is_beyond_edge(model, data, a, b) ? 1 : 0;
  if (is_surface(model, b)) return is_beyond_edge(model, data, b, a) ? 1 : 0;
  return 0;
}

}  // namespace

void install_engine_handlers() {
  static std::once_flag once;
  std::call_once(once, [] {
    mju_user_error = throw_error;
    mju_user_warning = ignore_warning;
    mjcb_contactfilter = filter_contact;
  });
}

const char* engine_version() { return mj_versionString(); }

}  // namespace jostle::physics_pool
